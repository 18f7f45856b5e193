"""Options that several commands share, and how their texts are read and checked.

Nothing heavy is imported at the top: ``radarsim --help`` answers at once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import click
import typer

from radarsim.cli.completion import complete_map, complete_sensor
from radarsim.cli.fields import check_robot as check_robot
from radarsim.cli.files import PICTURE_FORMS as PICTURE_FORMS
from radarsim.cli.files import check_ending as check_ending
from radarsim.cli.files import check_writable as check_writable
from radarsim.cli.files import list_endings as list_endings
from radarsim.cli.files import write_file as write_file
from radarsim.errors import PresetError, expected_one_of

if TYPE_CHECKING:
    from radarsim.geometry import Pose2
    from radarsim.scene.scene import Scene


DEFAULT_PORT: Final = 3000  # of USARSim
DEFAULT_MAX_CLIENTS: Final = 1024

_GIVEN: Final = "COMMANDLINE"  # source of an option


class DriveUnit(StrEnum):
    """Unit of the wheel speeds in DRIVE commands."""

    RAD_PER_S = "rad_per_s"
    REV_PER_S = "rev_per_s"


def check_positive(value: float | None) -> float | None:
    """Return a number that is above 0 and finite, or None.

    Raises:
        typer.BadParameter: If it is not.
    """
    if value is not None and not 0 < value < math.inf:
        raise typer.BadParameter(f"{value!r}, expected above 0 and finite")
    return value


def _check_time_limit(value: float) -> float:
    if not value > 0:
        raise typer.BadParameter(f"{value!r}, expected above 0")
    return value


MapArgument = Annotated[
    str,
    typer.Argument(
        metavar="MAP",
        autocompletion=complete_map,
        help="A map file, or the name of a shipped map; @VARIANT may follow.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON, for programs.")]
SeedOption = Annotated[
    int, typer.Option("--seed", min=0, help="Seed of all random numbers.")
]

# One scanner in a map without a server: scan and explain.
SensorOption = Annotated[
    str,
    typer.Option(
        "--sensor",
        autocompletion=complete_sensor,
        help="Preset of the sensor; see 'radarsim sensors'.",
    ),
]
SensorPoseOption = Annotated[
    str | None,
    typer.Option(
        "--pose",
        metavar="X,Y,YAW_DEG",
        help="Pose of the sensor in the map frame; or X,Y,Z,ROLL,PITCH,YAW_DEG.",
    ),
]
SensorStartOption = Annotated[
    str | None,
    typer.Option(
        "--start", help="Place the sensor where a P3AT at this start pose carries it."
    ),
]
SensorSettingsOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a setting of the sensor."),
]

# Robots that drive autonomously, on any server: navigate and map.
HostOption = Annotated[
    str | None, typer.Option(help="Host of the server.", show_default="127.0.0.1")
]
PortOption = Annotated[
    int | None,
    typer.Option(min=1, max=65535, help="Port of the server.", show_default="3000"),
]
StartOption = Annotated[
    str | None,
    typer.Option(help="Name of a start pose of the map; the first by default."),
]
PoseOption = Annotated[
    str | None,
    typer.Option(metavar="X,Y,YAW_DEG", help="Start here instead, in the map frame."),
]
SafetyOption = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        callback=check_positive,
        help="Distance to keep between the robot's centre and obstacles; by default"
        " what the size of the robot and --foliage-density require.",
    ),
]
PowerOption = Annotated[
    float,
    typer.Option(
        callback=check_positive,
        help="Penetration power of the radar, for --foliage-density.",
    ),
]
DriveUnitOption = Annotated[
    DriveUnit, typer.Option(help="Unit in which the server takes wheel speeds.")
]
TimeoutOption = Annotated[
    float,
    typer.Option(
        metavar="S",
        callback=check_positive,
        help="Give up after this time without a scan.",
    ),
]
TimeLimitOption = Annotated[
    float,
    typer.Option(
        metavar="S",
        callback=_check_time_limit,
        help="Longest duration of the run, in the server's time.",
    ),
]

RecordOption = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR",
        help="Record the run in a new folder, as a bag of ROS 2 that 'radarsim replay'"
        " repeats. Needs the extra 'record'.",
    ),
]
FilmOption = Annotated[
    Path | None,
    typer.Option(
        "--film",
        metavar="FILE",
        help="Film the run into a .gif, or an .mp4 with 'radarsim\\[film]' installed;"
        " an interrupted run leaves the film so far.",
    ),
]
FilmSpeedOption = Annotated[
    float,
    typer.Option(
        "--film-speed",
        metavar="FACTOR",
        callback=check_positive,
        help="Seconds of the run in a second of its film.",
    ),
]

# The simulation in this process that --serve starts.
ServedSeedOption = Annotated[
    int | None,
    typer.Option("--seed", min=0, help="Seed of the simulation.", show_default="0"),
]
ServedSettingsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="ITEM.KEY=VALUE",
        help="Change a setting of an item of the robot that --serve simulates.",
    ),
]


def read_point(text: str, hint: str) -> tuple[float, float]:
    """Read ``X,Y``, in m.

    Args:
        text: Value of the option.
        hint: Name of the option.

    Raises:
        click.BadParameter: If these are not two finite numbers.
    """
    x, y = _read_numbers(text, "X,Y", hint)
    return x, y


def read_pose(text: str, hint: str) -> Pose2:
    """Read ``X,Y,YAW_DEG``, in m and degrees.

    Args:
        text: Value of the option.
        hint: Name of the option.

    Raises:
        click.BadParameter: If these are not three finite numbers.
    """
    from radarsim.geometry import Pose2

    x, y, yaw_deg = _read_numbers(text, "X,Y,YAW_DEG", hint)
    return Pose2(x, y, math.radians(yaw_deg))


def _read_numbers(text: str, form: str, hint: str) -> list[float]:
    try:
        numbers = [float(number) for number in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != form.count(",") + 1 or not all(map(math.isfinite, numbers)):
        raise click.BadParameter(f"{text[:80]!r}, expected {form}", param_hint=hint)
    return numbers


def read_item_settings(texts: list[str]) -> dict[str, dict[str, Any]]:
    """Read ``ITEM.KEY=VALUE`` texts of ``--set`` into settings by item.

    Raises:
        click.BadParameter: If a text has another form.
    """
    from radarsim.presets.sensors import parse_setting

    settings: dict[str, dict[str, Any]] = {}
    for text in texts:
        try:
            path, value = parse_setting(text)
        except PresetError as error:
            raise click.BadParameter(str(error), param_hint="--set") from None
        item, dot, key = path.partition(".")
        if not dot or not item or not key:
            raise click.BadParameter(
                f"setting {text[:80]!r}, expected ITEM.KEY=VALUE", param_hint="--set"
            )
        settings.setdefault(item, {})[key] = value
    return settings


def check_server_options(
    serve: str | None,
    *,
    host: str | None,
    port: int | None,
    seed: int | None,
    settings: list[str] | None,
) -> None:
    """Refuse options of a served map without ``--serve``, and of a server with it.

    Raises:
        click.BadParameter: If there are any.
    """
    if serve is None:
        others = {"--seed": seed, "--set": settings or None}
        refuse_options(others, "expected --serve with it")
    else:
        refuse_options({"--host": host, "--port": port}, "expected no --serve with it")


def refuse_options(options: Mapping[str, object], text: str) -> None:
    """Refuse options that are given, which are those that are not None.

    Args:
        options: Values by the names of options.
        text: The error message for them.

    Raises:
        click.BadParameter: If there are any.
    """
    for name, value in options.items():
        if value is not None:
            raise click.BadParameter(text, param_hint=name)


def given_options(context: typer.Context) -> dict[str, str]:
    """Return the options on the command line: how they begin, by parameter's name."""
    return {
        each.name: each.opts[0]
        for each in context.command.params
        if getattr(context.get_parameter_source(each.name), "name", "") == _GIVEN
    }


def check_start(start: str | None, pose: str | None, scene: Scene | None) -> None:
    """Check that only one start is given, and that the map has it, if it is known.

    Raises:
        click.BadParameter: If there are two starts, or the map has no such start.
    """
    if start is None:
        return
    if pose is not None:
        raise click.BadParameter("expected only one of --start and --pose")
    if scene is not None and scene.start(start) is None:
        names = [each.name for each in scene.starts]
        text = expected_one_of(start, names)
        raise click.BadParameter(text, param_hint="--start")


def server_address(host: str | None, port: int | None) -> tuple[str, int]:
    """Return the address of the server, with defaults for what is not given."""
    return host or "127.0.0.1", port or DEFAULT_PORT


def penetration_depth(foliage_density: float | None, power: float) -> float:
    """Return how far a radar sees into foliage, m; 0 if the density is not given."""
    return 0.0 if foliage_density is None else power / foliage_density
