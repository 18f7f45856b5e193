"""Options that several commands take.

Nothing heavy is imported here: ``radarsim --help`` answers at once.
"""

from enum import StrEnum
from typing import Annotated

import typer


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
