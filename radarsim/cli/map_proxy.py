"""``radarsim map --through``: a map of what another client drives."""

import asyncio
import sys
import time

import typer

from radarsim.cli.map_options import MapWish
from radarsim.cli.map_progress import Teller, progress
from radarsim.cli.map_report import MapFiles, MapRun, keep
from radarsim.cli.navigate_options import ServerWish
from radarsim.cli.signals import ending_at_once
from radarsim.exploration.exploration import NOISE, warm_up
from radarsim.mapping.mapper import Mapper
from radarsim.navigation.runner import TripMeter
from radarsim.protocol.reports import Report
from radarsim.proxy import (
    Choice,
    ConnectionState,
    Listener,
    TcpProxy,
    forward_until_signal,
)
from radarsim.proxy.connection_state import NOTHING_GIVEN

LISTEN = "127.0.0.1"
UNTOLD = (
    "nobody has asked where {!r} is on the robot, and how far it sees; these are"
    " guessed, --mount and --max-range tell them"
)


class Making:
    """A map that is made of what passes.

    Attributes:
        mapper: Has the map; None before a robot was heard of.
        course: How far the robot has come.
        teller: Told of every scan.
    """

    def __init__(self, wish: MapWish) -> None:
        self._given = wish.given()
        self.mapper: Mapper | None = None
        self.trip = TripMeter(noise=NOISE)
        self.teller: Teller | None = None
        self._wish = wish

    def begin(self, overheard: ConnectionState, scanner: str) -> "Making":
        """Begin with the scans of one scanner."""
        facts = overheard.scanner(scanner, self._given)
        assert facts is not None  # this comes after its first scan
        if not overheard.is_described(scanner) and self._given == NOTHING_GIVEN:
            sys.stderr.write(f"radarsim: {UNTOLD.format(scanner)}\n")
        echoes = overheard.asks_for_echoes(scanner)
        settings = self._wish.overhearing(echoes=echoes)
        self.mapper = Mapper(facts, settings, clock=time.monotonic)
        return self

    def take(self, report: Report) -> None:
        """Take in what the server says."""
        assert self.mapper is not None
        observation = self.mapper.take(report)
        if observation is not None:
            self.trip.add(observation)
            if self.teller is not None:
                self.teller.tell("listening")


def overhear(wish: MapWish, server: ServerWish, files: MapFiles) -> tuple[MapRun, int]:
    """Forward between clients and a server until a signal comes; map what passes.

    Args:
        wish: What to map.
        server: Where the server is.
        files: What to write.

    Returns:
        What came of it, and the exit code of the signal, or 1 if nothing did.

    Raises:
        ServerError: If the port is taken.
        typer.BadParameter: If the folder is not there.
    """
    _check_ports(wish.through or 0, server)
    files.check()
    making = Making(wish)
    with ending_at_once():
        warm_up()
    listener = Listener(Choice(making.begin, scanner=wish.scanner))
    tap = TcpProxy(server.address, listener.hear)
    run = MapRun(None, wish.seed_from, trip=making.trip, outcome="overheard")
    with progress(making) as making.teller:
        listener.start()
        try:
            port = wish.through or 0
            code = asyncio.run(forward_until_signal(tap, LISTEN, port, _announce))
        finally:
            finished = listener.finish()
    run.mapper = making.mapper if finished else None
    keep(run, files)
    if not run.error:
        run.error = _fault(listener, finished=finished, is_written=bool(run.files))
        sys.stderr.write(f"radarsim: {run.error}\n" if run.error else "")
    return run, 1 if run.error else code


def _check_ports(port: int, server: ServerWish) -> None:
    """Refuse a tap that would be its own server.

    Raises:
        typer.BadParameter: If it would.
    """
    host, number = server.address
    if port == number and host in (LISTEN, "localhost", "0.0.0.0", "::1"):
        text = f"{port}, expected another port than the server's, see --port"
        raise typer.BadParameter(text, param_hint="--through")


def _fault(listener: Listener, *, finished: bool, is_written: bool) -> str:
    """Say why there is no map, or not all of one; empty if there is."""
    if listener.error is not None:
        return f"the map ends early: {listener.error}"
    if not finished:
        return "no map: what had passed was still being read after 30 s"
    return "" if is_written else "no map: no scan has passed"


def _announce(address: tuple[str, int]) -> None:
    sys.stderr.write(f"radarsim: listening on {address[0]}:{address[1]}\n")
    sys.stderr.flush()
