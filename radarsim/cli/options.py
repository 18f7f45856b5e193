"""Options that several commands share, and how their texts are read and checked.

Nothing heavy is imported at the top: ``radarsim --help`` answers at once.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from radarsim.cli.completion import complete_map, complete_sensor
from radarsim.errors import (
    PresetError,
    describe_os_error,
    did_you_mean,
    expected_one_of,
)
from radarsim.files import write_atomically
from radarsim.processes import raise_on_signals

if TYPE_CHECKING:
    from radarsim.geometry import Pose2
    from radarsim.scene.scene import Scene


DEFAULT_PORT: Final = 3000  # of USARSim
DEFAULT_MAX_CLIENTS: Final = 1024

_GIVEN: Final = "COMMANDLINE"  # source of an option

PICTURE_FORMS: Final = ("png", "svg", "pdf")  # endings of files that plots go into


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
        typer.BadParameter: If these are not two finite numbers.
    """
    x, y = _read_numbers(text, "X,Y", hint)
    return x, y


def read_pose(text: str, hint: str) -> Pose2:
    """Read ``X,Y,YAW_DEG``, in m and degrees.

    Args:
        text: Value of the option.
        hint: Name of the option.

    Raises:
        typer.BadParameter: If these are not three finite numbers.
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
        raise typer.BadParameter(f"{text[:80]!r}, expected {form}", param_hint=hint)
    return numbers


def read_item_settings(texts: list[str]) -> dict[str, dict[str, Any]]:
    """Read ``ITEM.KEY=VALUE`` texts of ``--set`` into settings by item.

    Raises:
        typer.BadParameter: If a text has another form.
    """
    from radarsim.presets.sensors import parse_setting

    settings: dict[str, dict[str, Any]] = {}
    for text in texts:
        try:
            path, value = parse_setting(text)
        except PresetError as error:
            raise typer.BadParameter(str(error), param_hint="--set") from None
        item, dot, key = path.partition(".")
        if not dot or not item or not key:
            raise typer.BadParameter(
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
        typer.BadParameter: If there are any.
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
        typer.BadParameter: If there are any.
    """
    for name, value in options.items():
        if value is not None:
            raise typer.BadParameter(text, param_hint=name)


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
        typer.BadParameter: If there are two starts, or the map has no such start.
    """
    if start is None:
        return
    if pose is not None:
        raise typer.BadParameter("expected only one of --start and --pose")
    if scene is not None and scene.start(start) is None:
        names = [each.name for each in scene.starts]
        text = expected_one_of(start, names)
        raise typer.BadParameter(text, param_hint="--start")


def server_address(host: str | None, port: int | None) -> tuple[str, int]:
    """Return the address of the server, with defaults for what is not given."""
    return host or "127.0.0.1", port or DEFAULT_PORT


def penetration_depth(foliage_density: float | None, power: float) -> float:
    """Return how far a radar sees into foliage, m; 0 if the density is not given."""
    return 0.0 if foliage_density is None else power / foliage_density


def list_endings(known: Sequence[str]) -> str:
    """Return the kinds of files that there are, in words.

    >>> list_endings(["json", "csv", "png"])
    'a .json, .csv or .png file'
    """
    *others, last = (f".{each}" for each in known)
    return f"a {', '.join(others)} or {last} file" if others else f"a {last} file"


def check_ending(path: Path, known: Sequence[str], hint: str) -> str:
    """Return the ending of a file's name, in lower case and without the dot.

    Args:
        path: The file to be written.
        known: The endings that are possible.
        hint: Name of the option that asks for it.

    Raises:
        typer.BadParameter: If it is none of them.
    """
    ending = path.suffix.lower().removeprefix(".")
    if ending not in known:
        text = f"{path}, expected {list_endings(known)}"
        raise typer.BadParameter(text, param_hint=hint)
    return ending


def check_writable(path: Path, hint: str) -> None:
    """Check, as far as possible, that a file can be written later.

    Args:
        path: The file to be written.
        hint: Name of the option that asks for it.

    Raises:
        typer.BadParameter: If its folder is missing or not writable, or it is a folder.
    """
    if reason := _obstacle_to_writing(path):
        text = f"cannot write {path}: {reason}"
        raise typer.BadParameter(text, param_hint=hint)


def check_robot(robot: str, served: object | None) -> None:
    """Check the class of a robot: no simulation here has another than the shipped ones.

    Args:
        robot: Name of the class; a package may precede it.
        served: The simulation in this process; None for a server, which may know more
            classes, so that only a probable error in a name without package counts.

    Raises:
        typer.BadParameter: If the class is unknown, or probably misspelt.
    """
    from radarsim.presets.robots import robot_names

    package, _, name = robot.rpartition(".")
    if name.casefold() in (known.casefold() for known in robot_names()):
        return
    text = expected_one_of(name, robot_names())
    if served is None:
        if package or not did_you_mean(name, robot_names()):
            return
        text += f" A class of another server has a package: USARBot.{name[:80]}"
    raise typer.BadParameter(text, param_hint="--robot")


def _obstacle_to_writing(path: Path) -> str:
    target = Path(os.path.realpath(path))
    try:
        if not path.parent.is_dir() or not target.parent.is_dir():
            return "no such folder"
        if path.is_dir():
            return "a folder of that name"
    except OSError as error:  # the folder may not be entered
        return describe_os_error(error)
    return "" if os.access(path.parent, os.W_OK | os.X_OK) else "no permission"


def write_file(path: Path, data: bytes, hint: str = "-o") -> None:
    """Write a file as a whole or not at all; see ``write_atomically``.

    Args:
        path: The file to be written.
        data: Contents of the file.
        hint: Name of the option that asks for it.

    Raises:
        typer.BadParameter: If it cannot be written.
    """
    try:
        with raise_on_signals():  # which leaves no temporary file
            write_atomically({path: data})
    except OSError as error:
        reason = _obstacle_to_writing(path) or describe_os_error(error)
        text = f"cannot write {path}: {reason}"
        raise typer.BadParameter(text, param_hint=hint) from None
