"""Types of fields that several commands have."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, NamedTuple, Self

from annotated_types import Ge, Gt

from radarsim.errors import PresetError
from radarsim.plans import RARE, Form, Option, Sets

DEFAULT_PORT: Final = 3000  # of USARSim


def read_setting(text: str) -> tuple[str, Any]:
    """Read ``KEY=VALUE`` into the key and the value.

    Raises:
        ValueError: If it has another form.
    """
    from radarsim.presets.sensors import parse_setting

    try:
        return parse_setting(text)
    except PresetError as error:
        raise ValueError(str(error)) from None


def read_item_setting(text: str) -> tuple[str, str, Any]:
    """Read ``ITEM.KEY=VALUE`` into the item, the key and the value.

    Raises:
        ValueError: If it has another form.
    """
    path, value = read_setting(text)
    item, _, key = path.partition(".")
    if not item or not key:
        raise ValueError(f"{path!r}, expected ITEM.KEY")
    return item, key, value


class ServerAddress(NamedTuple):
    """Host and port of a server."""

    host: str = "127.0.0.1"
    port: int = DEFAULT_PORT

    @classmethod
    def read(cls, text: str) -> Self:
        """Read ``HOST:PORT``; a host of numbers with colons is in brackets.

        Raises:
            ValueError: If it has another form.
        """
        host, _, port = text.rpartition(":")
        address = cls(host.strip("[]"), int(port))
        if not host or not 0 < address.port < 65536:
            raise ValueError(f"{text!r}, expected HOST:PORT")
        return address

    def __str__(self) -> str:
        return f"{self.host}:{self.port}"


LOCAL_SERVER: Final = ServerAddress()
MapName = Annotated[str, Option(is_argument=True, metavar="MAP", words="maps")]
SensorName = Annotated[str, Option(words="sensors")]
RobotName = Annotated[str, Option(words="robots")]
Seed = Annotated[int, Ge(0)]
Setting = Annotated[tuple[str, Any], Form("KEY=VALUE", read_setting)]
ItemSetting = Annotated[tuple[str, str, Any], Form("ITEM.KEY=VALUE", read_item_setting)]
Address = Annotated[ServerAddress, Form("HOST:PORT", ServerAddress.read)]
OutputFile = Annotated[Path | None, Option(names=("-o", "--output"))]
Json = Annotated[bool, Option(names=("--json",))]


@dataclass(frozen=True, slots=True, kw_only=True)
class Server:
    """A server that runs already.

    Attributes:
        connect: The server to connect to.
    """

    connect: Address = LOCAL_SERVER


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """Where a robot drives: in a simulation in this process, or on a server.

    Attributes:
        map: A map to simulate here, as fast as possible: its file, or the name of a
            shipped map; @VARIANT may follow.
        connect: Drive on this server instead.
        seed: Seed of the simulation.
        settings: Change a setting of an item of the simulated robot.
    """

    option_group: ClassVar = "Simulation"
    one_required: ClassVar[Sets] = (("map", "connect"),)

    map: MapName | None = None
    connect: Address | None = None
    seed: Annotated[Seed, Option(needs=("map",))] = 0
    settings: Annotated[
        tuple[ItemSetting, ...], Option(names=("--set",), needs=("map",))
    ] = ()

    def item_settings(self) -> dict[str, dict[str, Any]]:
        """Return the settings by items."""
        found: dict[str, dict[str, Any]] = {}
        for item, key, value in self.settings:
            found.setdefault(item, {})[key] = value
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class RunFiles:
    """Files that a run is written into.

    Attributes:
        record: Record the run in a new folder, as a bag of ROS 2 that 'radarsim replay'
            repeats. Needs the extra 'record'.
        film: Film the run into a .gif, or an .mp4 with the extra 'film'; an interrupted
            run leaves the film so far.
        film_speed: Seconds of the run in a second of its film.
    """

    option_group: ClassVar = "Files"

    record: Annotated[Path | None, Option(metavar="DIR")] = None
    film: Path | None = None
    film_speed: Annotated[float, Gt(0), RARE] = 6.0
