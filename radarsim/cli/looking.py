"""``radarsim check`` and ``radarsim sensors``."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any

import typer
from rich.console import Console
from rich.table import Table

from radarsim.errors import MapError
from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.presets.sensors import SensorPreset, load_settings, sensor_presets
from radarsim.scene.mapfile import load_map
from radarsim.scene.scene import Scene
from radarsim.scene.summary import summarise
from radarsim.simulation.simulation import Simulation


def check_map(map_: str) -> int:
    """Print what is in a map, or its errors; give the exit code."""
    try:
        scene = load_map(map_)
        lines, code = [*summarise(scene), *taken_starts(scene)], 0
    except MapError as error:
        lines, code = error.problems, 1
    for line in lines:
        typer.echo(line)
    return code


def taken_starts(scene: Scene) -> list[str]:
    """Tell which starts are no place for a P3AT."""
    lines = []
    simulation = Simulation(scene)
    for start in scene.starts:
        wanted = Pose2(start.pose.x, start.pose.y, start.pose.yaw)
        vehicle = simulation.spawn("check", load_robot("P3AT"), wanted)
        if vehicle is None:
            lines.append(f"  {start.name}: no place for a P3AT within 1 m")
            continue
        simulation.remove(vehicle)  # each start by itself
        pose = vehicle.robot.pose
        if pose != wanted:
            there = f"x {pose.x:.2f} m, y {pose.y:.2f} m"
            lines.append(f"  {start.name}: taken; a P3AT would stand at {there}")
    return ["starts that are not free", *lines] if lines else []


def list_sensors(names: Sequence[str], *, as_json: bool) -> None:
    """Print presets: those of these names, or an overview and all.

    Raises:
        typer.BadParameter: If there is none of a name.
    """
    presets = sensor_presets()
    unknown = [name for name in names if name not in presets]
    if unknown:
        raise typer.BadParameter(
            f"sensor {unknown[0][:80]!r}, expected one of {list(presets)}"
        )
    shown = {name: presets[name] for name in names or presets}
    if as_json:
        typer.echo(json.dumps(_plain(shown), indent=2, allow_nan=False))
        return
    console = Console(soft_wrap=False)
    if not names:
        console.print(_overview(shown), "")
    for name, preset in shown.items():
        console.print(_settings(name, preset))


def _plain(presets: Mapping[str, SensorPreset]) -> dict[str, Any]:
    """Make JSON of presets; it knows no infinity."""
    plain = {name: preset.model_dump() for name, preset in presets.items()}
    for told in plain.values():
        for number in told["settings"].values():
            if number["value"] == math.inf:
                number["value"] = None
    return plain


def _overview(presets: Mapping[str, SensorPreset]) -> Table:
    """Show a line for each, with the first sentence about it."""
    table = Table(box=None, pad_edge=False, collapse_padding=True)
    table.add_column("name", no_wrap=True)
    table.add_column("medium")
    for column in ("beams", "fov °", "step °", "range m"):
        table.add_column(column, justify="right")
    table.add_column("about")
    for name, preset in presets.items():
        told = load_settings(name)
        numbers = (told.beams, told.fov_deg, told.resolution_deg, told.max_range)
        sentence = preset.about.partition(". ")[0].rstrip(".")
        table.add_row(name, told.medium, *(f"{n:.4g}" for n in numbers), sentence)
    return table


def _settings(name: str, preset: SensorPreset) -> Table:
    table = Table(title=f"{name}: {preset.about}", title_justify="left")
    for column in ("setting", "value", "confidence", "source"):
        table.add_column(column, overflow="fold")
    for setting, number in preset.settings.items():
        table.add_row(setting, str(number.value), number.confidence, number.source)
    return table
