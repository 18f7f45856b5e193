"""The link budget of one direction of an FMCW radar, as text or JSON."""

import json
from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING

import typer

from radarsim.cli.output import print_lines
from radarsim.errors import PresetError

if TYPE_CHECKING:
    from radarsim.addons.fmcw.budget import Budget, Entry
    from radarsim.geometry import Pose3
    from radarsim.scene.scene import Scene
    from radarsim.sensors.range_scanner import RangeScanner

_WIDTH = 38  # of the labels


def print_budget(
    scanner: "RangeScanner", scene: "Scene", pose: "Pose3", azimuth: int, as_json: bool
) -> None:
    """Print the link budget of a direction.

    Raises:
        typer.BadParameter: If the sensor is no FMCW radar, or has no such direction.
    """
    from radarsim.addons.fmcw.budget import link_budget

    try:
        budget = link_budget(scanner.fmcw, scene, pose, azimuth)
    except PresetError as error:
        raise typer.BadParameter(str(error)) from None
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="--beam") from None
    if as_json:
        typer.echo(json.dumps(asdict(budget)))
    else:
        print_lines(budget_lines(budget))


def budget_lines(budget: "Budget") -> Iterator[str]:
    """Yield the lines of a link budget."""
    import math

    angle = -math.degrees(budget.angle)
    yield f"azimuth {budget.azimuth}, {angle:.1f} deg clockwise from straight ahead"
    for number, entry in enumerate(budget.entries):
        yield _line(entry, "dBm" if number == 0 else "dB")
    for echo in budget.echoes:
        yield ""
        yield f"{echo.object_name} ({echo.material}), {echo.kind} at {echo.range:.2f} m"
        for entry in echo.entries:
            yield _line(entry, "dB")
        yield f"  {'received':{_WIDTH}}{echo.received:8.1f} dBm"
        yield f"  {'noise':{_WIDTH}}{budget.noise:8.1f} dBm"
        yield f"  {'signal to noise':{_WIDTH}}{echo.received - budget.noise:8.1f} dB"
    if not budget.echoes:
        yield "nothing comes back"


def _line(entry: "Entry", unit: str) -> str:
    return f"  {entry.label:{_WIDTH}}{entry.db:8.1f} {unit}"
