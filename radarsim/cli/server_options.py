"""Options of the commands that serve, or go along with a server that was served so."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from radarsim.cli.options import DriveUnit, check_positive, read_item_settings

if TYPE_CHECKING:
    from radarsim.presets.robots import RobotModel
    from radarsim.simulation.config import SimulationConfig


class DialectName(StrEnum):
    """Dialects of the USARSim protocol."""

    COMPAT = "compat"
    UDK = "udk"


class LogLevel(StrEnum):
    """Lowest levels of the log that are written."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


class LogFormat(StrEnum):
    """Forms of the log."""

    TEXT = "text"
    JSON = "json"


ListenHostOption = Annotated[str, typer.Option(help="Address to listen on.")]
ListenPortOption = Annotated[
    int,
    typer.Option(min=0, max=65535, help="Port to listen on; 0 takes a free one."),
]
ImagePortOption = Annotated[
    int | None,
    typer.Option(
        min=0,
        max=65535,
        help="Serve pictures of the first robot's camera on this port as well; the"
        " original's is 5003.",
    ),
]
SpeedOption = Annotated[
    float,
    typer.Option(
        callback=check_positive, help="Simulated seconds per second of real time."
    ),
]
DialectOption = Annotated[
    DialectName,
    typer.Option(
        help="Form of the lines: as today's clients need it, or the original's."
    ),
]
CommandUnitOption = Annotated[
    DriveUnit | None,
    typer.Option(help="Unit of DRIVE commands; the dialect's by default."),
]
ItemSettingsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="ITEM.KEY=VALUE",
        help="Change a setting of the robots' items, such as lms200.max_range=20.",
    ),
]
RobotsOption = Annotated[
    list[Path] | None,
    typer.Option(
        metavar="FILE",
        help="File of another robot class that clients may spawn; repeat it.",
    ),
]
MaxClientsOption = Annotated[
    int, typer.Option(min=1, help="Refuse clients when this many are connected.")
]
LogFormatOption = Annotated[LogFormat, typer.Option(help="Form of the log on stderr.")]
LogLevelOption = Annotated[
    LogLevel | None,
    typer.Option(
        help="What is logged: connections as well, or errors alone.",
        show_default="warning",
    ),
]
VerboseOption = Annotated[
    bool, typer.Option("--verbose", "-v", help="As --log-level info.")
]


@dataclass(frozen=True, slots=True)
class ServerOptions:
    """How a server speaks, and how its robots' items differ from their presets.

    Attributes:
        dialect: Dialect of its lines.
        drive_unit: Unit of commands to drive; None for the dialect's.
        settings: Values of ``--set``.
        robots: Files of robot classes.
    """

    dialect: DialectName
    drive_unit: DriveUnit | None
    settings: list[str] | None
    robots: Sequence[Path] = ()

    def config(self) -> SimulationConfig:
        """Return them as the configuration of a simulation.

        Raises:
            typer.BadParameter: If a setting, or the file of a class, cannot be read.
            PresetError: If the file of a class is wrong.
        """
        from radarsim.protocol.dialect import get_dialect
        from radarsim.simulation.config import SimulationConfig

        return SimulationConfig(
            get_dialect(self.dialect.value),
            None if self.drive_unit is None else self.drive_unit.value,
            read_item_settings(self.settings or []),
            tuple(map(_read_robot, self.robots)),
        )

    def words(self) -> list[str]:
        """Return them as words of a command line."""
        unit = [] if self.drive_unit is None else ["--drive-unit", self.drive_unit]
        settings = [word for text in self.settings or [] for word in ("--set", text)]
        robots = [word for path in self.robots for word in ("--robots", str(path))]
        return ["--dialect", self.dialect, *unit, *settings, *robots]


def _read_robot(path: Path) -> RobotModel:
    """Read the file of a robot class."""
    from radarsim.errors import describe_os_error
    from radarsim.presets.robots import read_robot

    try:
        return read_robot(path)
    except OSError as error:
        text = f"{path}: {describe_os_error(error)}"
        raise typer.BadParameter(text, param_hint="--robots") from None
