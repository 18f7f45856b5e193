"""Types of option values, and groups of options, that several commands share."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, NamedTuple, Self

import click
from annotated_types import Ge, Gt, Interval

from radarsim.errors import PresetError, did_you_mean, expected_one_of, join_address
from radarsim.plans import RARE, Form, Option, Sets

if TYPE_CHECKING:
    from radarsim.protocol.dialect import DriveUnit
    from radarsim.server.host import Host

DEFAULT_PORT: Final = 3000  # the port of USARSim


def read_setting(text: str) -> tuple[str, Any]:
    """Parse ``KEY=VALUE`` into the key and the value.

    Raises:
        ValueError: If the text has another form.
    """
    from radarsim.presets.sensors import parse_setting

    try:
        return parse_setting(text)
    except PresetError as error:
        raise ValueError(str(error)) from None


def read_item_setting(text: str) -> tuple[str, str, Any]:
    """Parse ``ITEM.KEY=VALUE`` into the item, the key and the value.

    Raises:
        ValueError: If the text has another form.
    """
    path, value = read_setting(text)
    item, _, key = path.partition(".")
    if not item or not key:
        raise ValueError(f"{path!r}, expected ITEM.KEY")
    return item, key, value


def group_settings(
    settings: Iterable[tuple[str, str, Any]],
) -> dict[str, dict[str, Any]]:
    """Group settings by item.

    >>> group_settings([("lms200", "max_range", 20), ("lms200", "fov_deg", 90)])
    {'lms200': {'max_range': 20, 'fov_deg': 90}}
    """
    found: dict[str, dict[str, Any]] = {}
    for item, key, value in settings:
        found.setdefault(item, {})[key] = value
    return found


class ServerAddress(NamedTuple):
    """Host and port of a server."""

    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT

    @classmethod
    def read(cls, text: str) -> Self:
        """Parse ``HOST:PORT``; an IPv6 address is in brackets.

        Raises:
            ValueError: If the text has another form.
        """
        host, _, port = text.rpartition(":")
        address = cls(host.strip("[]"), int(port))
        if not host or not 0 < address.port < 65536:
            raise ValueError(f"{text!r}, expected HOST:PORT")
        return address

    def __str__(self) -> str:
        return join_address(self.host, self.port)


LOCAL_SERVER: Final = ServerAddress()
MapName = Annotated[str, Option(is_argument=True, metavar="MAP", words="maps")]
SensorName = Annotated[str, Option(words="sensors")]
RobotName = Annotated[str, Option(words="robots")]
Seed = Annotated[int, Ge(0)]
Port = Annotated[int, Interval(ge=0, le=65535)]
Setting = Annotated[tuple[str, Any], Form("KEY=VALUE", read_setting)]
ItemSetting = Annotated[tuple[str, str, Any], Form("ITEM.KEY=VALUE", read_item_setting)]
Address = Annotated[ServerAddress, Form("HOST:PORT", ServerAddress.read)]
OutputFile = Annotated[Path | None, Option(names=("-o", "--output"))]
Json = Annotated[bool, Option(names=("--json",))]


@dataclass(frozen=True, slots=True, kw_only=True)
class Server:
    """The address of a server that is already running.

    Attributes:
        connect: Address of the server.
    """

    connect: Address = LOCAL_SERVER


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """The world of a robot: a simulation in this process, or a server.

    Attributes:
        map: Map to simulate as fast as possible: a map file or the name of a shipped
            map; MAP@VARIANT selects a variant.
        connect: Drive on a running server instead of simulating MAP.
        seed: Seed of the simulation.
        settings: Change a setting of a sensor or other robot item.
    """

    option_group: ClassVar = "Simulation"
    one_required: ClassVar[Sets] = (("map", "connect"),)

    map: MapName | None = None
    connect: Address | None = None
    seed: Annotated[Seed, Option(needs=("map",))] = 0
    settings: Annotated[
        tuple[ItemSetting, ...], Option(names=("--set",), needs=("map",))
    ] = ()

    def load_host(self, drive_unit: DriveUnit) -> Host | None:
        """Create the host of the map; None if no map is given.

        Args:
            drive_unit: Unit in which the robots accept wheel speeds.

        Raises:
            MapError: If the map is wrong.
            click.BadParameter: If a setting of an item is wrong.
        """
        from radarsim.cli.server_options import load_host
        from radarsim.simulation.config import SimulationConfig

        if self.map is None:
            return None
        config = SimulationConfig(
            drive_unit=drive_unit, item_settings=group_settings(self.settings)
        )
        return load_host(self.map, config, seed=self.seed)


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFiles:
    """Files to which a run is written.

    Attributes:
        record: Record the run in a new folder, as a ROS 2 bag that 'radarsim replay'
            can play. Needs the extra 'record'.
        film: Film the run as a .gif file, or as .mp4 with the extra 'film'; the film of
            an interrupted run ends there.
        film_speed: Seconds of the run per second of the film.
    """

    option_group: ClassVar = "Files"

    record: Annotated[Path | None, Option(metavar="DIR")] = None
    film: Path | None = None
    film_speed: Annotated[float, Gt(0), RARE] = 6.0


def check_robot(robot: str, served: object | None) -> None:
    """Check that a robot class exists.

    Args:
        robot: Name of the class; a package may precede it.
        served: The simulation in this process, which has only the shipped classes; None
            for a server, which may have others, so only probable typos in names without
            package are refused.

    Raises:
        click.BadParameter: If the class is unknown, or probably misspelt.
    """
    from radarsim.presets.robots import robot_names

    package, _, name = robot.rpartition(".")
    if name.casefold() in (known.casefold() for known in robot_names()):
        return
    text = expected_one_of(name, robot_names())
    if served is None:
        if package or not did_you_mean(name, robot_names()):
            return
        text += f"; for a class of another server, write USARBot.{name[:80]}"
    raise click.BadParameter(text, param_hint="--robot")
