"""``radarsim serve``: serve a map to USARSim clients."""

from __future__ import annotations

import asyncio
import logging
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any, Final

import click
import typer

from radarsim.cli.compile_progress import compile_progress
from radarsim.cli.legacy_config_file import ConfigOption
from radarsim.cli.options import (
    DEFAULT_MAX_CLIENTS,
    DEFAULT_PORT,
    DriveUnit,
    MapArgument,
    SeedOption,
)
from radarsim.cli.output import print_now, program_name, start_log
from radarsim.cli.serve_extension import (
    ExtensionOptions,
    ServedMap,
    ServeExtension,
    with_extensions,
)
from radarsim.cli.server_options import (
    CommandUnitOption,
    DialectName,
    DialectOption,
    ImagePortOption,
    ItemSettingsOption,
    ListenHostOption,
    ListenPortOption,
    LogFormat,
    LogFormatOption,
    LogLevel,
    LogLevelOption,
    MaxClientsOption,
    RobotsOption,
    ServerOptions,
    SpeedOption,
    VerboseOption,
)
from radarsim.errors import PortUnavailable, PresetError, ServerError
from radarsim.processes import exit_immediately, set_exit_code_of_sigterm

if TYPE_CHECKING:
    from radarsim.server.host import Host, HostObserver
    from radarsim.server.image_server import ImageServer
    from radarsim.server.tcp_server import Companion
    from radarsim.simulation.config import SimulationConfig

log = logging.getLogger("radarsim.server")

OTHER_FILES: Final = 128  # that the server opens besides those of its clients


@with_extensions
def serve(
    map_: MapArgument,
    *,
    host: ListenHostOption = "127.0.0.1",
    port: ListenPortOption = DEFAULT_PORT,
    image_port: ImagePortOption = None,
    seed: SeedOption = 0,
    speed: SpeedOption = 1.0,
    dialect: DialectOption = DialectName.COMPAT,
    drive_unit: CommandUnitOption = None,
    settings: ItemSettingsOption = None,
    robots: RobotsOption = None,
    max_clients: MaxClientsOption = DEFAULT_MAX_CLIENTS,
    verbose: VerboseOption = False,
    log_level: LogLevelOption = None,
    log_format: LogFormatOption = LogFormat.TEXT,
    config_file: ConfigOption = None,  # noqa: ARG001 - its callback reads it
    extensions: Sequence[ExtensionOptions] = (),
) -> None:
    """Serve a map to USARSim clients until interrupted."""
    options = ServerOptions(dialect, drive_unit, settings, robots or ())
    served = ServedMap(map_, options, seed)
    planned = [each.extension(served) for each in extensions]
    beside = [each for each in planned if each is not None]
    own_ports = {"--port": port, "--image-port": image_port or 0}
    _check_ports(host, own_ports, beside)  # before imports that take long
    with ExitStack() as until_end:
        for each in beside:
            until_end.callback(each.close)
            each.open()
        _start_server_log(log_level, log_format, verbose=verbose)
        config = options.config()
        with compile_progress():  # which maps with meshes do, while they are read
            simulated = load_host(map_, config, seed=seed, begins=False)
            for each in beside:
                each.attach(simulated)
        from radarsim.server.tcp_server import Server
        from radarsim.server.tcp_server import serve as serve_until_signal

        images = make_image_server(simulated, image_port)
        most = _permitted_clients(max_clients)
        server = Server(simulated, speed=speed, max_clients=most)

        def announce_all(address: tuple[str, int]) -> None:
            announce(address)
            if images is not None:
                print_now(
                    f"radarsim: images on {images.address[0]}:{images.address[1]}"
                )
            for each in beside:
                each.announce(address)

        companions: list[Companion] = [*beside]
        if images is not None:
            companions.insert(0, images)
        serving = serve_until_signal(server, host, port, announce_all, companions)
        ports = own_ports | {k: v for each in beside for k, v in each.ports.items()}
        with cure_of_port(ports), compile_progress():
            code = asyncio.run(serving)
    if server.is_loading:
        exit_immediately(code)
    raise typer.Exit(code)


def _start_server_log(
    level: LogLevel | None, log_format: LogFormat, *, verbose: bool
) -> None:
    """Write the log to stderr; ``--log-level`` counts before ``--verbose``."""
    level = level or (LogLevel.INFO if verbose else LogLevel.WARNING)
    start_log(
        logging.getLevelNamesMapping()[level.name],
        "%(asctime)s %(levelname)s %(message)s",
        as_json=log_format is LogFormat.JSON,
    )


def _check_ports(
    host: str, own: Mapping[str, int], beside: Iterable[ServeExtension]
) -> None:
    """Check that all ports differ, and are free.

    Args:
        host: Address to listen on.
        own: Ports there, by their options; 0 where any will do, or none is needed.
        beside: What else has ports.

    Raises:
        typer.BadParameter: If two ports are the same.
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
            raise typer.BadParameter(text, param_hint=option)
        taken[port] = option
    with cure_of_port({option: port for option, _, port in places}):
        for _, address, port in places:
            check_port(address, port)


def _permitted_clients(wanted: int) -> int:
    """Return the number of clients for which the system permits enough sockets."""
    from radarsim.server.open_files import raise_file_limit

    expected = wanted + OTHER_FILES
    files = raise_file_limit(expected)
    if files == expected:
        return wanted
    most = max(1, files - OTHER_FILES)
    log.warning(
        "at most %d clients: the system permits %d open files, expected %d for"
        " --max-clients %d; 'ulimit -n' tells the limit",
        most,
        files,
        expected,
        wanted,
    )
    return most


@contextmanager
def cure_of_port(options: Mapping[str, int | None]) -> Iterator[None]:
    """Say in the error of a port which option takes a free one.

    Args:
        options: Ports by their options; any other is that of ``--port``.

    Raises:
        ServerError: If a port is in use, or reserved.
    """
    try:
        yield
    except PortUnavailable as error:
        named = (name for name, port in options.items() if port == error.port)
        option = next(named, "--port")
        raise ServerError(f"{error}; {option} 0 takes a free one") from None


def load_host(
    map_: str,
    config: SimulationConfig,
    *,
    seed: int,
    begins: bool = True,
    observers: Iterable[HostObserver] = (),
) -> Host:
    """Load a map and create the server's host.

    Args:
        map_: Name of a map, or path of a map file.
        config: Dialect and settings of items.
        seed: Seed of the simulation.
        begins: Whether the simulation begins at once.
        observers: Told what is done to the host.

    Raises:
        MapError: If the map is wrong.
        typer.BadParameter: If a setting of an item does not fit.
    """
    from radarsim.scene.map_file import load_map
    from radarsim.server.host import Host

    check_item_settings(config)
    scene = load_map(map_)
    return Host(scene, config=config, seed=seed, begins=begins, observers=observers)


def check_item_settings(config: SimulationConfig) -> None:
    """Check the settings of ``--set``.

    Raises:
        click.BadParameter: If one does not fit.
    """
    try:
        config.check()
    except PresetError as error:
        raise click.BadParameter(str(error), param_hint="--set") from None


def make_image_server(host: Host, port: int | None) -> ImageServer | None:
    """Create the server of pictures.

    Args:
        host: The host whose simulation is seen.
        port: Port to listen on; 0 for a free one, None for no pictures.
    """
    if port is None:
        return None
    from radarsim.server.camera.picture_process import PictureProcess
    from radarsim.server.image_server import ImageServer

    pictures = PictureProcess(host.scene, host.config.dialect.image_type)
    return ImageServer(pictures, port=port)


def load_served_host(
    map_: str | None,
    *,
    seed: int | None,
    settings: Mapping[str, Mapping[str, Any]],
    drive_unit: DriveUnit,
    observers: Iterable[HostObserver] = (),
) -> Host | None:
    """Create the host of the map that another command is given, if it is.

    ``observers`` are as in ``load_host``.

    Raises:
        MapError: If the map is wrong.
        typer.BadParameter: If a setting of an item is wrong.
    """
    from radarsim.simulation.config import SimulationConfig

    if map_ is None:
        return None
    config = SimulationConfig(drive_unit=drive_unit.value, item_settings=settings)
    return load_host(map_, config, seed=seed or 0, observers=observers)


def announce(address: tuple[str, int]) -> None:
    """Tell programs on stdout that clients can connect, and a person what is next."""
    set_exit_code_of_sigterm(0)  # it runs, and has no end of its own
    print_now(f"radarsim: listening on {address[0]}:{address[1]}")
    if sys.stderr.isatty():  # a person reads it; logs of services stay as they are
        typer.echo(
            f"to drive a robot, in another terminal: {_drive_command(address)}"
            "; Ctrl-C ends the server",
            err=True,
        )


def _drive_command(address: tuple[str, int]) -> str:
    """Return the command that drives on this server, with the options it needs."""
    host, port = address
    command = f"{program_name()} drive"
    if host not in ("127.0.0.1", "0.0.0.0"):
        command += f" --host {host}"
    return command if port == DEFAULT_PORT else f"{command} --port {port}"
