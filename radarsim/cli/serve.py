"""``radarsim serve``: serve a map to USARSim clients."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Final, Literal

import click
from annotated_types import Ge, Gt

from radarsim.cli.command import PlansOf
from radarsim.cli.fields import MapName, Seed
from radarsim.cli.output import print_now, start_log
from radarsim.cli.server_options import (
    EXTENSIONS,
    ExtensionOptions,
    Listener,
    ServedMap,
    ServeExtension,
    ServerOptions,
    announce,
    hint_of_port,
    load_host,
)
from radarsim.errors import join_address
from radarsim.plans import RARE, Option

log = logging.getLogger("radarsim.server")

DEFAULT_MAX_CLIENTS: Final = 1024
OTHER_FILES: Final = 128  # open files that the server needs in addition to sockets
FEWEST_CLIENTS: Final = 32  # least limit of clients, even if the system permits fewer


@dataclass(frozen=True, slots=True, kw_only=True)
class LogOptions:
    """The log on stderr.

    Attributes:
        verbose: Also log connections; the same as --log-level info.
        log_level: Lowest level to log, by default warning; info includes connections.
        log_format: Format of the log on stderr.
    """

    option_group: ClassVar = "Log"

    verbose: Annotated[bool, Option(names=("-v", "--verbose"))] = False
    log_level: Annotated[Literal["info", "warning", "error"] | None, RARE] = None
    log_format: Annotated[Literal["text", "json"], RARE] = "text"

    def start(self) -> None:
        """Write the log to stderr; ``--log-level`` takes precedence over -v."""
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
    max_clients: Annotated[int, Ge(1), RARE] = DEFAULT_MAX_CLIENTS,
    config: Annotated[Path | None, Option(is_config_file=True)] = None,  # noqa: ARG001 - read while words are parsed
    log_options: LogOptions,
    extensions: Annotated[tuple[ExtensionOptions, ...], PlansOf(EXTENSIONS)] = (),
) -> int:
    """Serve a map to USARSim clients until interrupted.

    Args:
        map_: A map file or the name of a shipped map; MAP@VARIANT selects a variant.
        listener: Addresses and port to listen on.
        options: Protocol and settings of the robots' items.
        seed: Seed of all random numbers.
        speed: Simulated seconds per second of real time.
        max_clients: Maximum number of connected clients; others are refused.
        config: YAML file with the map, and values of options that are not given.
        log_options: Level and format of the log.
        extensions: Options of extensions of the server.

    Returns:
        The exit code.
    """
    host, port = listener.addresses, listener.port
    served = ServedMap(map_, options, seed)
    planned = [each.extension(served) for each in extensions]
    others = [each for each in planned if each is not None]
    _check_ports(host, port, others)  # before the slow imports
    with ExitStack() as until_end:
        for each in others:
            # ``close`` is registered before ``open``, so it also runs if ``open``
            # fails.
            until_end.callback(each.close)
            each.open()
        log_options.start()
        simulated = load_host(map_, options.config(), seed=seed)
        for each in others:
            each.attach(simulated)
        from radarsim.server.tcp_server import Server
        from radarsim.server.tcp_server import serve as serve_until_signal

        most = _permitted_clients(max_clients)
        server = Server(simulated, speed=speed, max_clients=most)
        for each in others:
            each.follow_pace(server.pace)

        def announce_all(address: tuple[str, int]) -> None:
            announce(address)
            for other in listener.host[1:]:
                print_now(f"radarsim: listening on {join_address(other, address[1])}")
            for extension in others:
                extension.announce(address)

        serving = serve_until_signal(server, host, port, announce_all, others)
        with hint_of_port({k: v for each in others for k, v in each.ports.items()}):
            return asyncio.run(serving)


def _check_ports(host: str, port: int, others: Iterable[ServeExtension]) -> None:
    """Check that all ports differ and are free.

    Args:
        host: Address to listen on.
        port: Port of the robots; 0 for any free port.
        others: Extensions, which may listen on further ports.

    Raises:
        click.BadParameter: If two ports are the same.
        ServerError: If a port is in use or reserved.
    """
    from radarsim.listening import check_port

    places = [("--port", host, port)]
    for each in others:
        places += [(o, each.address or host, at) for o, at in each.ports.items()]
    taken: dict[int, str] = {}
    for option, _, number in places:
        if number and number in taken:
            text = f"{number} is the port of {taken[number]}, expected another one"
            raise click.BadParameter(text, param_hint=option)
        taken[number] = option
    with hint_of_port({option: number for option, _, number in places}):
        for _, address, number in places:
            check_port(address, number)


def _permitted_clients(wanted: int) -> int:
    """Return the maximum number of clients, reduced if few files may be open."""
    from radarsim.listening import raise_file_limit

    expected = wanted + OTHER_FILES
    files = raise_file_limit(expected)
    if files == expected:
        return wanted
    most = max(min(files // 2, FEWEST_CLIENTS), files - OTHER_FILES)
    log.warning(
        "at most %d clients: the system permits %d open files, expected %d for"
        " --max-clients %d; 'ulimit -n' shows the limit",
        most,
        files,
        expected,
        wanted,
    )
    return most
