"""Options of the commands that serve a map, and extensions of a server.

A part of the program can extend ``radarsim serve``: it registers a plan, a dataclass of
options, in the group ``radarsim.serve``; see ``radarsim.plugins``. The fields of the
plan become options of the command, and the plan creates the extension of the server.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Literal, Protocol

import click

from radarsim.cli.fields import DEFAULT_PORT, ItemSetting, Port, group_settings
from radarsim.cli.output import print_now, program_name
from radarsim.errors import (
    PortUnavailable,
    PresetError,
    ServerError,
    describe_os_error,
    join_address,
)
from radarsim.plans import RARE, Option
from radarsim.processes import set_exit_code_of_sigterm
from radarsim.protocol.dialect import DriveUnit

if TYPE_CHECKING:
    from radarsim.presets.robots import RobotModel
    from radarsim.server.host import Host
    from radarsim.server.image_server import ImageServer
    from radarsim.server.question_server import QuestionServer
    from radarsim.server.tcp_server import Pace
    from radarsim.simulation.config import SimulationConfig

EXTENSIONS: Final = "radarsim.serve"  # group of plugins
SERVED: Final = {  # names of the services in messages, by the options of their ports
    "--image-port": "images",
    "--truth-port": "truth",
    "--wireless-port": "wireless",
    "--wss-port": "wss",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Listener:
    """The addresses and the port on which a server listens.

    Attributes:
        host: Address to listen on; repeat it for several, such as IPv4 and IPv6.
        port: Port to listen on; 0 selects a free port.
    """

    option_group: ClassVar = "Address"

    host: tuple[str, ...] = ("127.0.0.1",)
    port: Port = DEFAULT_PORT

    @property
    def addresses(self) -> str:
        """All addresses, separated by commas, for ``listening.listen``."""
        return ",".join(self.host)


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerOptions:
    """The protocol of a server, and changed settings of its robots' items.

    Attributes:
        dialect: Format of lines: compat for current clients, udk as in USARSim for UDK.
        settings: Change a setting of the robots' items, such as lms200.max_range=20.
        drive_unit: Unit of wheel speeds in DRIVE commands; by default the dialect's.
        robots: File of another robot class to spawn; repeat the option for several.
    """

    option_group: ClassVar = "Protocol and robots"

    dialect: Literal["compat", "udk"] = "compat"
    settings: Annotated[tuple[ItemSetting, ...], Option(names=("--set",))] = ()
    drive_unit: Annotated[DriveUnit | None, RARE] = None
    robots: Annotated[tuple[Path, ...], RARE] = ()

    def config(self) -> SimulationConfig:
        """Return the options as the configuration of a simulation.

        Raises:
            click.BadParameter: If the file of a robot class cannot be read.
            PresetError: If the file of a robot class is wrong.
        """
        from radarsim.protocol.dialect import get_dialect
        from radarsim.simulation.config import SimulationConfig

        return SimulationConfig(
            get_dialect(self.dialect),
            self.drive_unit,
            group_settings(self.settings),
            tuple(map(_read_robot, self.robots)),
        )

    def words(self) -> list[str]:
        """Return the options as arguments of a command line."""
        words = ["--dialect", self.dialect]
        if self.drive_unit is not None:
            words += ["--drive-unit", self.drive_unit]
        for item, key, value in self.settings:
            # Settings are read as YAML, which includes JSON except for infinity.
            text = json.dumps(value).replace("Infinity", ".inf")
            words += ["--set", f"{item}.{key}={text}"]
        return [*words, *(word for p in self.robots for word in ("--robots", str(p)))]


def _read_robot(path: Path) -> RobotModel:
    from radarsim.presets.robots import read_robot

    try:
        return read_robot(path)
    except OSError as error:
        text = f"{path}: {describe_os_error(error)}"
        raise click.BadParameter(text, param_hint="--robots") from None


@dataclass(frozen=True, slots=True)
class ServedMap:
    """The map, the options and the seed of a server.

    Attributes:
        map: Name of the map or path of its file; MAP@VARIANT selects a variant.
        options: Protocol and settings of the robots' items.
        seed: Seed of all random numbers.
    """

    map: str
    options: ServerOptions
    seed: int


class ServeExtension:
    """An extension that runs together with a server.

    The server calls the methods in the order in which they are defined, and ``close``
    even after an error. A method does nothing unless a subclass overrides it.

    Attributes:
        ports: Ports that the extension listens on, by the options that set them.
        address: Address of these ports; None for the address of the server.
    """

    ports: Mapping[str, int] = {}
    address: str | None = None

    def open(self) -> None:
        """Prepare the extension before the map is loaded, which may take long."""

    def attach(self, host: Host) -> None:
        """Receive the host of the simulation, before simulated time advances."""

    def follow_pace(self, pace: Pace) -> None:
        """Receive the pace of simulated time; use it only in the event loop."""

    async def start(self, address: str) -> None:
        """Start to listen.

        Args:
            address: Address that the server listens on.

        Raises:
            ServerError: If the extension cannot listen.
        """

    def announce(self, address: tuple[str, int]) -> None:
        """Report that clients can connect to the server at this host and port."""

    async def stop(self) -> None:
        """Undo ``start``; raises no errors."""

    def close(self) -> None:
        """Undo ``open``."""


class ExtensionOptions(Protocol):
    """Interface of the options of an extension of ``radarsim serve``."""

    def extension(self, served: ServedMap) -> ServeExtension | None:
        """Create the extension of a server; None if the options ask for none.

        Raises:
            click.BadParameter: If the options are wrong.
        """


@dataclass(frozen=True, slots=True, kw_only=True)
class SidePorts:
    """Ports for pictures, true poses and wireless servers.

    Attributes:
        image_port: Also serve pictures of the first robot's camera on this port;
            USARSim uses port 5003.
        truth_port: Also serve the true poses of all robots on this port, as USARTruth
            does on port 3989.
        wireless_port: Also give robot positions to a wireless server (WSS) on this
            port; USARSim uses port 7435.
        wss_port: Also run a wireless server (WSS) on this port, which connects robots
            within radio range; USARSim's WSS uses port 50000.
    """

    option_group: ClassVar = "Additional services"

    image_port: Annotated[Port | None, RARE] = None
    truth_port: Annotated[Port | None, RARE] = None
    wireless_port: Annotated[Port | None, RARE] = None
    wss_port: Annotated[Port | None, RARE] = None

    def extension(self, _: ServedMap) -> SideServers:
        """See ``ExtensionOptions.extension``."""
        ports = zip(SERVED, asdict(self).values(), strict=True)
        return SideServers({key: port for key, port in ports if port is not None})


class SideServers(ServeExtension):
    """Runs the servers for pictures, true poses and wireless servers."""

    def __init__(self, ports: Mapping[str, int]) -> None:
        """Store the ports by their options in ``SidePorts``; no server starts yet."""
        self.ports = ports
        self._servers: dict[str, ImageServer | QuestionServer] = {}

    def attach(self, host: Host) -> None:
        """See ``ServeExtension.attach``."""
        simulation = host.simulation
        for option, port in self.ports.items():
            if option == "--image-port":
                from radarsim.server.image_server import ImageServer, PictureProcess

                image_type = host.config.dialect.image_type
                pictures = PictureProcess(host.scene, image_type)
                self._servers[option] = ImageServer(simulation, pictures, port=port)
            elif option == "--wss-port":
                from radarsim.server.wireless_server import WirelessServer

                self._servers[option] = WirelessServer(simulation, port=port)
            else:
                from radarsim.server.question_server import (
                    QuestionServer,
                    truth_answer,
                    wireless_answer,
                )

                is_truth = option == "--truth-port"
                answer = truth_answer if is_truth else wireless_answer
                ask = partial(answer, simulation)
                self._servers[option] = QuestionServer(ask, port=port)

    async def start(self, address: str) -> None:
        """See ``ServeExtension.start``."""
        for server in self._servers.values():
            await server.start(address)

    def announce(self, _: tuple[str, int]) -> None:
        """Print on stdout the address on which each server listens."""
        for option, server in self._servers.items():
            for host in server.addresses:
                place = join_address(host, server.address[1])
                print_now(f"radarsim: {SERVED[option]} on {place}")

    async def stop(self) -> None:
        """See ``ServeExtension.stop``."""
        for server in self._servers.values():
            await server.stop()


@contextmanager
def hint_of_port(options: Mapping[str, int | None]) -> Iterator[None]:
    """Add to the message of a port error the option that selects a free port.

    Args:
        options: Ports by their options; any other port belongs to ``--port``.

    Raises:
        ServerError: If a port is in use or reserved.
    """
    try:
        yield
    except PortUnavailable as error:
        named = (name for name, port in options.items() if port == error.port)
        option = next(named, "--port")
        raise ServerError(f"{error}; {option} 0 picks a free port") from None


def load_host(map_: str, config: SimulationConfig, *, seed: int) -> Host:
    """Load a map and create the server's host.

    Args:
        map_: Name of a map, or path of a map file.
        config: Dialect and settings of items.
        seed: Seed of the simulation.

    Raises:
        MapError: If the map is wrong.
        click.BadParameter: If a setting of an item is invalid.
    """
    from radarsim.scene.map_file import load_map
    from radarsim.server.host import Host

    # Settings are checked first, since they do not depend on the map and a large map
    # takes long to load.
    check_item_settings(config)
    scene = load_map(map_)
    return Host(scene, config=config, seed=seed)


def check_item_settings(config: SimulationConfig) -> None:
    """Check the settings of robots' items that ``--set`` changes.

    Raises:
        click.BadParameter: If a setting is invalid.
    """
    try:
        config.check()
    except PresetError as error:
        raise click.BadParameter(str(error), param_hint="--set") from None


def announce(address: tuple[str, int]) -> None:
    """Print on stdout that clients can connect; a terminal also shows a command."""
    set_exit_code_of_sigterm(0)  # a running server ends only when it is stopped
    host, port = address
    print_now(f"radarsim: listening on {join_address(host, port)}")
    if sys.stderr.isatty():  # logs of services do not get this line
        command = f"{program_name()} drive"
        # 0.0.0.0 means all addresses of this machine, but a client needs a single one.
        near = "127.0.0.1" if host == "0.0.0.0" else host
        if (near, port) != ("127.0.0.1", DEFAULT_PORT):
            command += f" --connect {near}:{port}"
        text = f"to drive a robot, in another terminal: {command}"
        click.echo(f"{text}; Ctrl-C ends the server", err=True)
