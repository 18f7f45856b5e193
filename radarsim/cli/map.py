"""``radarsim map``."""

import sys
from typing import Final

import typer

from radarsim.cli.map_options import MapWish
from radarsim.cli.map_progress import progress
from radarsim.cli.map_report import MapFiles, as_text, keep
from radarsim.cli.navigate_options import ServerWish
from radarsim.cli.signals import exit_immediately_on_signals
from radarsim.evaluation.mapping_run import MappingResult, MappingRun
from radarsim.exploration.exploration import warm_up
from radarsim.mapping.export import NavMode
from radarsim.proxy.traffic_mapper import TrafficMapper

LISTEN: Final = "127.0.0.1"
UNTOLD: Final = (
    "nobody has asked where {!r} is on the robot, and how far it sees; these are"
    " guessed, --mount and --max-range tell them"
)


def run_survey(
    out: str, mode: NavMode, wish: MapWish, server: ServerWish, *, told_as_json: bool
) -> int:
    """Make a map, write it, print how that went, and give the exit code.

    Args:
        out: Where it is to be.
        mode: Of the map for nav2.
        wish: What to map.
        server: Where.
        told_as_json: For programs.

    Raises:
        ClientError: If the server does not say what is needed.
        MapError: If the map file is wrong.
        NavigationError: If the robot cannot do what is asked of it.
        typer.BadParameter: If an option is wrong.
    """
    server.check()
    wish.check()
    files = MapFiles(out, mode)
    wish.check_seed(served=server.map_ is not None)
    if wish.through is not None:
        return _overhear(wish, server, files, told_as_json=told_as_json)
    files.check(served=server.map_)
    host = server.open()
    with exit_immediately_on_signals():
        warm_up()
    plan = wish.read(None if host is None else host.simulation.scene)
    run = MappingRun(plan, host, seed=wish.seed or 0)
    try:
        with progress(run.exploration) as teller:
            run.run(server.address, lambda step: teller.tell(step.activity))
    finally:  # however it ends, what there is of the map is kept and told of
        keep(run.result, files)
        run.judge()
        _tell(run.result, told_as_json=told_as_json)
    return int(bool(run.result.error))


def _overhear(
    wish: MapWish, server: ServerWish, files: MapFiles, *, told_as_json: bool
) -> int:
    """Map what another client drives."""
    if server.map_ is not None:
        text = "expected no --serve with it"
        raise typer.BadParameter(text, param_hint="--through")
    port = wish.through or 0
    _check_ports(port, server)
    files.check()
    traffic = TrafficMapper(
        motion_source=wish.seed_from,
        resolution=wish.resolution,
        scanner=wish.scanner,
        defaults=wish.given(),
    )
    traffic.on_guess = lambda name: _warn(UNTOLD.format(name))
    with exit_immediately_on_signals():
        warm_up()
    result = MappingResult(None, wish.seed_from, trip=traffic.trip, outcome="overheard")
    with progress(traffic) as teller:
        traffic.on_scan = lambda: teller.tell("listening")
        code = traffic.run(server.address, (LISTEN, port), _announce)
    result.mapper = traffic.mapper
    keep(result, files)
    if not result.error and traffic.error:
        result.error = traffic.error
        _warn(traffic.error)
    _tell(result, told_as_json=told_as_json)
    return 1 if result.error else code


def _check_ports(port: int, server: ServerWish) -> None:
    """Refuse a proxy that would be its own server.

    Raises:
        typer.BadParameter: If it would.
    """
    host, number = server.address
    if port == number and host in (LISTEN, "localhost", "0.0.0.0", "::1"):
        text = f"{port}, expected another port than the server's, see --port"
        raise typer.BadParameter(text, param_hint="--through")


def _announce(address: tuple[str, int]) -> None:
    _warn(f"listening on {address[0]}:{address[1]}")


def _warn(text: str) -> None:
    sys.stderr.write(f"radarsim: {text}\n")
    sys.stderr.flush()


def _tell(result: MappingResult, *, told_as_json: bool) -> None:
    """Print how it was; a run that failed before its first scan has only JSON."""
    if told_as_json:
        typer.echo(result.to_json())
    elif result.trip.start is not None or not result.error:
        typer.echo("\n".join(as_text(result)))
