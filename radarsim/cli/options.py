"""Options that several commands take.

Nothing heavy is imported here: ``radarsim --help`` answers at once.
"""

import os
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from radarsim.atomic_write import write_atomically


class DriveUnit(StrEnum):
    """Unit of DRIVE."""

    RAD_PER_S = "rad_per_s"
    REV_PER_S = "rev_per_s"


JsonOption = Annotated[bool, typer.Option("--json", help="For programs.")]
SeedOption = Annotated[int, typer.Option("--seed", min=0, help="Of all randomness.")]

# Of robots that drive by themselves, on any server.
HostOption = Annotated[
    str | None, typer.Option(help="Of the server.", show_default="127.0.0.1")
]
PortOption = Annotated[int | None, typer.Option(min=1, max=65535, show_default="3000")]
StartOption = Annotated[
    str | None, typer.Option(help="A start of the map; its first by default.")
]
PoseOption = Annotated[
    str | None, typer.Option(metavar="X,Y,YAW_DEG", help="Where to start instead.")
]
SafetyOption = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        help="From the robot's centre to what it sees; what the robot and"
        " --foliage-density ask for by default.",
    ),
]
PowerOption = Annotated[
    float, typer.Option(help="Of the radar, for --foliage-density.")
]
DriveUnitOption = Annotated[
    DriveUnit, typer.Option(help="In which the server counts wheel speeds.")
]
TimeoutOption = Annotated[
    float, typer.Option(metavar="S", help="Without a scan, then it gives up.")
]
TimeLimitOption = Annotated[
    float, typer.Option(metavar="S", help="Of the server's time for the whole run.")
]

# Of the server in this process that --serve makes.
ServedSeedOption = Annotated[
    int | None,
    typer.Option("--seed", min=0, help="Of the simulation.", show_default="0"),
]
ServedSettingsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="ITEM.KEY=VALUE",
        help="Change a setting of an item of the robot of --serve.",
    ),
]


# Section from cli.files.
# The files that options name.


def check_place(path: Path, hint: str) -> None:
    """Find out what would keep a file from being written, as far as that shows before.

    Args:
        path: Where it is to be.
        hint: The option that asks for it.

    Raises:
        typer.BadParameter: If there is no such folder, or no right to write there.
    """
    if reason := _hindrance(path):
        text = f"cannot write {path}: {reason}"
        raise typer.BadParameter(text, param_hint=hint)


def _hindrance(path: Path) -> str:
    if not path.parent.is_dir() or not Path(os.path.realpath(path)).parent.is_dir():
        return "no such folder"
    if path.is_dir():
        return "a folder of that name"
    return "" if os.access(path.parent, os.W_OK | os.X_OK) else "no right to"


def write_file(path: Path, data: bytes, hint: str = "-o") -> None:
    """Write a file whole or not at all, as ``write_atomically`` does.

    Args:
        path: Where.
        data: All of it.
        hint: The option that asks for it.

    Raises:
        typer.BadParameter: If it cannot be written.
    """
    try:
        write_atomically({path: data})
    except OSError as error:
        text = f"cannot write {path}: {error.strerror}"
        raise typer.BadParameter(text, param_hint=hint) from None
