"""``radarsim serve``: serve a map to USARSim clients."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Final, Literal, TypeAlias

import click
from annotated_types import Ge, Gt

from radarsim.cli.command import PlansOf
from radarsim.cli.fields import MapName, Port, Seed
from radarsim.cli.output import print_now, start_log
from radarsim.cli.server_options import (
    EXTENSIONS,
    ExtensionOptions,
    Listener,
    ServedMap,
    ServeExtension,
    ServerOptions,
    announce,
    cure_of_port,
    load_host,
)
from radarsim.errors import join_address
from radarsim.plans import RARE, Option
from radarsim.processes import exit_immediately

if TYPE_CHECKING:
    from radarsim.server.host import Host
    from radarsim.server.image_server import ImageServer
    from radarsim.server.question_server import QuestionServer
    from radarsim.server.radio_server import RadioServer
    from radarsim.server.tcp_server import Companion, Server

    OwnServer: TypeAlias = ImageServer | QuestionServer | RadioServer

log = logging.getLogger("radarsim.server")

DEFAULT_MAX_CLIENTS: Final = 1024
OTHER_FILES: Final = 128  # that the server opens besides those of its clients
FEWEST_CLIENTS: Final = 32  # even if that leaves fewer for the rest


@dataclass(frozen=True, slots=True, kw_only=True)
class LogOptions:
    """The log on stderr.

    Attributes:
        verbose: As --log-level info.
        log_level: What is logged: connections as well, or errors alone; warnings by
            default.
        log_format: Form of the log on stderr.
    """

    option_group: ClassVar = "Log"

    verbose: Annotated[bool, Option(names=("-v", "--verbose"))] = False
    log_level: Annotated[Literal["info", "warning", "error"] | None, RARE] = None
    log_format: Annotated[Literal["text", "json"], RARE] = "text"

    def start(self) -> None:
        """Write the log to stderr; ``--log-level`` counts before ``--verbose``."""
        level = self.log_level or ("info" if self.verbose else "warning")
        start_log(
            logging.getLevelNamesMapping()[level.upper()],
            "%(asctime)s %(levelname)s %(message)s",
            as_json=self.log_format == "json",
        )


def serve(
    map_: MapName,
    listener: Listener,
    options: ServerOptions,
    *,
    seed: Seed = 0,
    speed: Annotated[float, Gt(0)] = 1.0,
    image_port: Annotated[Port | None, RARE] = None,
    truth_port: Annotated[Port | None, RARE] = None,
    wireless_port: Annotated[Port | None, RARE] = None,
    wss_port: Annotated[Port | None, RARE] = None,
    max_clients: Annotated[int, Ge(1), RARE] = DEFAULT_MAX_CLIENTS,
    config: Annotated[Path | None, Option(is_config_file=True)] = None,  # noqa: ARG001 - read while words are parsed
    log_options: LogOptions,
    extensions: Annotated[tuple[ExtensionOptions, ...], PlansOf(EXTENSIONS)] = (),
) -> int:
    """Serve a map to USARSim clients until interrupted.

    Args:
        map_: A map file, or the name of a shipped map; @VARIANT may follow.
        listener: Where to listen.
        options: How the server speaks.
        seed: Seed of all random numbers.
        speed: Simulated seconds per second of real time.
        image_port: Serve pictures of the first robot's camera on this port as well; the
            original's is 5003.
        truth_port: Tell where all robots are on this port as well (USARTruth); the
            original's is 3989.
        wireless_port: Answer a wireless server (WSS) on this port as well; the
            original's is 7435.
        wss_port: Be a wireless server (WSS) on this port as well, through which robots
            talk that hear each other; the original's is 50000.
        max_clients: Refuse clients when this many are connected.
        config: YAML file with values of options that are not given, and the map.
        log_options: The log.
        extensions: What is to run beside the server.

    Returns:
        The exit code.
    """
    own_ports = {
        "image": image_port,
        "truth": truth_port,
        "wireless": wireless_port,
        "wss": wss_port,
    }
    served = ServedMap(map_, options, seed)
    planned = [each.extension(served) for each in extensions]
    beside = [each for each in planned if each is not None]
    ports = {f"--{name}-port": port or 0 for name, port in own_ports.items()}
    ports = {"--port": listener.port, **ports}
    _check_ports(listener.addresses, ports, beside)  # before imports that take long
    for each in beside:
        ports |= each.ports
    with ExitStack() as until_end, cure_of_port(ports):
        for each in beside:
            # Before it opens, so that what it began is ended even if opening fails
            # half-way.
            until_end.callback(each.close)
            each.open()
        log_options.start()
        host = load_host(map_, options.config(), seed=seed, begins=False)
        for each in beside:
            each.attach(host)
        own = {
            name: make_own_server(name, host, port)
            for name, port in own_ports.items()
            if port is not None
        }
        server = make_server(host, speed, max_clients)
        for each in beside:
            each.follow_pace(server.pace)
        code = _serve(server, listener, own, beside)
    if server.is_loading:  # Python would crash while it shuts down around the thread
        exit_immediately(code)
    return code


def _serve(
    server: Server,
    listener: Listener,
    own: Mapping[str, OwnServer],
    beside: Sequence[ServeExtension],
) -> int:
    """Serve until a signal comes; return the exit code.

    Args:
        server: The server.
        listener: Where to listen.
        own: Servers of other protocols, by their names.
        beside: What else is to run.
    """
    from radarsim.server.tcp_server import serve as serve_until_signal

    def announce_all(address: tuple[str, int]) -> None:
        announce(address)
        for other in listener.host[1:]:
            print_now(f"radarsim: listening on {join_address(other, address[1])}")
        for name, each in own.items():
            first, port = each.address
            word = "images" if name == "image" else name
            for at in (first, *listener.host[1:]):
                print_now(f"radarsim: {word} on {join_address(at, port)}")
        for extension in beside:
            extension.announce(address)

    companions: list[Companion] = [*own.values(), *beside]
    places = listener.addresses, listener.port
    return asyncio.run(serve_until_signal(server, *places, announce_all, companions))


def _check_ports(
    host: str, own: Mapping[str, int], beside: Iterable[ServeExtension]
) -> None:
    """Check that all ports differ, and are free.

    Args:
        host: Address to listen on.
        own: Ports there, by their options; 0 where any will do, or none is needed.
        beside: What else has ports.

    Raises:
        click.BadParameter: If two ports are the same.
        ServerError: If a port is in use, or reserved.
    """
    from radarsim.listening import check_port

    places = [(option, host, port) for option, port in own.items()]
    for each in beside:
        places += [(o, each.address or host, port) for o, port in each.ports.items()]
    taken: dict[int, str] = {}
    for option, _, port in places:
        if port and port in taken:
            text = f"{port} is the port of {taken[port]}, expected another one"
            raise click.BadParameter(text, param_hint=option)
        taken[port] = option
    with cure_of_port({option: port for option, _, port in places}):
        for _, address, port in places:
            check_port(address, port)


def make_server(host: Host, speed: float, max_clients: int) -> Server:
    """Create the server of robots.

    Args:
        host: Its host.
        speed: Simulated seconds per second of real time.
        max_clients: The most clients; fewer if the system does not permit so many
            sockets.
    """
    from radarsim.listening import raise_file_limit
    from radarsim.server.tcp_server import Server

    expected = max_clients + OTHER_FILES
    files = raise_file_limit(expected)
    most = max_clients
    if files < expected:
        most = max(min(files // 2, FEWEST_CLIENTS), files - OTHER_FILES)
        log.warning(
            "at most %d clients: the system permits %d open files, expected %d for"
            " --max-clients %d; 'ulimit -n' tells the limit",
            most,
            files,
            expected,
            max_clients,
        )
    return Server(host, speed=speed, max_clients=most)


def make_own_server(name: str, host: Host, port: int) -> OwnServer:
    """Create a server of another protocol.

    Args:
        name: ``image`` for pictures, ``truth`` for true poses, ``wireless`` for
            questions to a wireless server, or ``wss`` for one through which robots
            talk.
        host: The host whose simulation it shows.
        port: Port to listen on; 0 for a free one.
    """
    dialect = host.config.dialect
    if name == "image":
        from radarsim.server.image_server import ImageServer, PictureProcess

        return ImageServer(PictureProcess(host.scene, dialect.image_type), port=port)
    if name == "wss":
        from radarsim.server.radio_server import RadioServer

        return RadioServer(port=port)
    from radarsim.server.question_server import QuestionServer
    from radarsim.server.questions import truth_answer, wireless_answer

    answer = truth_answer if name == "truth" else wireless_answer
    return QuestionServer(answer(dialect), port=port)
