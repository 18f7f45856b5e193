"""Options of ``radarsim map``, and how their texts are checked."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Final

import typer

from radarsim.autonomy.exploration.options import StrategyName
from radarsim.autonomy.navigation.algorithms import ROBOT
from radarsim.cli.options import check_positive

_RESOLUTION_RANGE: Final = 0.005, 1  # m; finer, a room would have millions of cells


class MotionSourceName(StrEnum):
    """Sensor from which the robot's motion between scans is read."""

    INS = "ins"
    ODOMETRY = "odometry"
    NONE = "none"


class Mode(StrEnum):
    """Contents of the map for nav2."""

    TRINARY = "trinary"
    SCALE = "scale"


def _check_resolution(value: float) -> float:
    finest, coarsest = _RESOLUTION_RANGE
    if not finest <= value <= coarsest:
        text = f"{value!r}, expected {finest:g} to {coarsest:g}"
        raise typer.BadParameter(text)
    return value


OutArgument = Annotated[
    str,
    typer.Argument(
        metavar="OUT",
        help="A folder, or what the names of the files begin with.",
    ),
]

# How to explore.
StrategyOption = Annotated[
    StrategyName | None,
    typer.Option(help="Strategy of exploring.", show_default="auto"),
]
MOST_ROBOTS: Final = 16  # that explore at once
WayOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="X,Y",
        help="Drive to this waypoint instead of exploring, m, map frame; repeat it"
        " for waypoints to reach in turn.",
    ),
]
RobotsOption = Annotated[
    int,
    typer.Option(
        "--robots",
        min=1,
        max=MOST_ROBOTS,
        metavar="K",
        help="Explore with this many robots at once, each by a connection of its own,"
        " which begin at start poses of the map that follow each other; one map.",
    ),
]
RobotOption = Annotated[
    str | None,
    typer.Option(
        help="Class of the robot; to explore, it has to see all the way round.",
        show_default=ROBOT,
    ),
]
DensityOption = Annotated[
    float | None,
    typer.Option(
        metavar="PER_M",
        callback=check_positive,
        help="Density of the thinnest foliage that the robot may meet, for servers"
        " that send no echoes: the radar sees into it.",
    ),
]
RadiusOption = Annotated[
    float,
    typer.Option(
        metavar="M",
        callback=check_positive,
        help="Farthest distance from the start, where no walls are nearer.",
    ),
]
SpeedOption = Annotated[
    float,
    typer.Option(metavar="M_PER_S", callback=check_positive, help="Maximum speed."),
]

# Whom to follow instead, and what a client who does not ask cannot know.
ThroughOption = Annotated[
    int | None,
    typer.Option(
        min=0,
        max=65535,
        metavar="PORT",
        help="Map what another client drives: forward this port to the server"
        " until interrupted; 0 takes a free one.",
    ),
]
WatchOption = Annotated[
    str | None,
    typer.Option(
        metavar="ROBOT",
        help="Map this robot, which another client drives, by watching it on a"
        " server of radarsim, until it leaves or you interrupt.",
    ),
]
MountOption = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,YAW_DEG",
        help="With --through or --watch, pose of the scanner on the robot, if the"
        " server does not tell it.",
    ),
]
MaxRangeOption = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        callback=check_positive,
        help="With --through or --watch, maximum range of the scanner, if the"
        " server does not tell it.",
    ),
]

# How the map is made.
ScannerOption = Annotated[
    str | None, typer.Option(help="Scanner to map with; the first by default.")
]
MotionOption = Annotated[
    MotionSourceName,
    typer.Option(
        "--seed-from",
        "--motion-from",
        help="Sensor from which the motion between scans is read.",
    ),
]
EchoesOption = Annotated[
    bool,
    typer.Option(
        help="Ask the server for the echoes of each beam, or use ranges alone."
    ),
]
ResolutionOption = Annotated[
    float,
    typer.Option(metavar="M", callback=_check_resolution, help="Side of a cell."),
]
MapRangeOption = Annotated[
    float | None,
    typer.Option(
        metavar="M",
        callback=check_positive,
        help="Map only what is within this range of the scanner; its whole range by"
        " default. The pose is found with all of it.",
    ),
]
ModeOption = Annotated[
    Mode,
    typer.Option(
        help="Cells of the map for nav2: occupied, free and unknown, or probabilities."
    ),
]

# The simulation in this process.
ServeOption = Annotated[
    str | None,
    typer.Option(
        metavar="MAP",
        help="Simulate this map here, as fast as possible, instead of connecting to"
        " a server, and judge the result by it.",
    ),
]
SeedOption = Annotated[
    int | None,
    typer.Option(
        min=0,
        help="Seed of the simulation of --serve, and of the strategy turn_away.",
        show_default="0",
    ),
]
