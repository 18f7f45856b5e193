"""Watches all robots of a server, and controls the speed of the simulation.

The connection is opened again when it is lost. The server is asked only for reports
that a page shows, as copying the lines of robots costs the server time, and computing
echoes far more. While no page is visible and no map is being made, the server sends
nothing.
"""

import asyncio
import logging
import math
import sys
import threading
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final

from radarsim.addons.web.requests import BadRequest, Pace, Seek
from radarsim.client import AsyncClient, ClientError, ClientTimeout
from radarsim.client import session as questions
from radarsim.geometry import Pose3
from radarsim.protocol.reports import CommandError, Report, Watching

log = logging.getLogger("radarsim.commander")

UNCONNECTED: Final = "not connected yet"
RETRY: Final = 1.0  # s between two attempts to connect
ASK_AGAIN: Final = 5.0  # s before the next request, if the server refuses to be watched
ANSWER: Final = 5.0  # s; timeout for an answer of the server
FOREIGN: Final = (
    "this page did not start the server; the page of 'radarsim serve MAP --web PORT'"
    " can change it"
)


@dataclass(slots=True)
class ServerState:
    """The last known state of the server.

    Attributes:
        level: Name of the map that the server uses.
        starts: Start poses by name.
        watches: Whether the server reports robots of other clients. Not every server
            can.
        refusal: Why the server refuses to report them; empty if it does not refuse.
        problem: Why there is no connection; empty while connected.
    """

    level: str = ""
    starts: dict[str, Pose3] = field(default_factory=dict)
    watches: bool = False
    refusal: str = ""
    problem: str = UNCONNECTED


class Link:
    """A link to a server or a recording, which reports robots and controls time.

    Attributes:
        address: Host and port of the server; None if a recording is played.
        state: The state of the server.
        speed: Simulated seconds in one second of the wall clock.
        is_paused: Whether time passes only by steps.
        on_link: Called when the connection opens, when it is lost, and when the server
            begins or refuses to report robots.
        on_reports: Called with reports of all robots.
        on_time: Called when ``speed`` or ``is_paused`` has changed.
        on_damage: Called with a message if a part of the recording cannot be read.
    """

    refusal: str = FOREIGN  # why time cannot be controlled; empty if it can

    def __init__(self, address: tuple[str, int] | None, state: ServerState) -> None:
        """Create a link to a server whose time passes at speed 1."""
        self.address = address
        self.state = state
        self.speed = 1.0
        self.is_paused = False
        self.on_link: Callable[[], None] = lambda: None
        self.on_reports: Callable[[Sequence[Report]], None] = lambda _: None
        self.on_time: Callable[[], None] = lambda: None
        self.on_damage: Callable[[str], None] = lambda _: None

    @property
    def position(self) -> float | None:
        """The time that is shown, s; None for the time of the newest report."""
        return None

    def time_message(self) -> dict[str, Any]:
        """Return the message ``time``: speed, pause and position in time."""
        return {
            "op": "time",
            "refusal": self.refusal,
            "paused": self.is_paused,
            "speed": self.speed,
            "t": self.position,
            "end": None,  # only a recording has an end
        }

    def change_pace(self, request: Pace) -> None:  # noqa: ARG002 - subclasses use it
        """Pause, resume, step, or change the speed.

        Raises:
            BadRequest: If the time of this server cannot be controlled.
        """
        raise BadRequest(f"time cannot be changed: {self.refusal}")

    def seek(self, request: Seek) -> None:  # noqa: ARG002 - a recording uses it
        """Jump to another time.

        Raises:
            BadRequest: If this is no recording.
        """
        raise BadRequest("only a recording can jump to another time")

    def watch(self, echoes: Iterable[str] | None) -> None:
        """Watch all robots from now on, or stop watching.

        Args:
            echoes: Names of the robots whose echoes are sent as well; None to watch no
                robot.
        """

    async def run(self) -> None:
        """Call the callbacks with reports and changes until cancelled."""

    def _set_pace(self, speed: float, is_paused: bool) -> None:
        if (speed, is_paused) != (self.speed, self.is_paused):
            self.speed, self.is_paused = speed, is_paused
            self.on_time()


class ServerLink(Link):
    """Watches the robots of a server, and reconnects when the connection is lost."""

    def __init__(self, address: tuple[str, int]) -> None:
        """Create a link that is not connected yet."""
        super().__init__(address, ServerState())
        self._server = address
        self._client: AsyncClient | None = None
        self._echoes: frozenset[str] | None = None  # None while no robot is watched
        self._asking: asyncio.Task[None] | None = None  # the newest request

    async def run(self) -> None:
        """Keep the connection open until cancelled."""
        while True:
            try:
                await self._connect()
            except ClientError as error:
                self._client = None
                # Every attempt to connect fails in the same way, so browsers get only
                # one message.
                if self.state.problem == UNCONNECTED:
                    log.warning("waiting for a server: %s", error)
                if self.state.problem != str(error):
                    self.state = ServerState(self.state.level, problem=str(error))
                    self.on_link()
            await asyncio.sleep(RETRY)

    def watch(self, echoes: Iterable[str] | None) -> None:
        """See ``Link.watch``."""
        wanted = None
        if echoes is not None:  # the protocol separates names by commas
            wanted = frozenset(name for name in echoes if "," not in name)
        if wanted == self._echoes:
            return
        self._echoes = wanted
        if self._client is not None:
            # Replacing the task makes ``_ask_later`` drop the older request.
            self._asking = asyncio.ensure_future(self._ask(self._client))

    async def _connect(self) -> None:
        """Ask for the needed reports, and read until the connection is lost.

        Raises:
            ClientError: If the connection is lost, or cannot be opened.
        """
        async with await AsyncClient.connect(*self._server, timeout=ANSWER) as client:
            level = (await client.greeting()).level
            starts: dict[str, Pose3] = {}
            with suppress(ClientTimeout):  # not every server answers this
                starts = await client.start_poses()
            self.state = ServerState(level, starts, problem="")
            self._client = client
            self.on_link()
            # Send the last request, which may have been made before the connection was
            # open.
            await self._ask(client)
            while True:
                self._take(await client.read(math.inf))

    async def _ask(self, client: AsyncClient) -> None:
        with suppress(ClientError):  # the reading loop reports a lost connection
            if self._echoes is None:
                await client.send(questions.watch((), False))
            else:
                await client.send(questions.watch(None, sorted(self._echoes)))

    def _take(self, reports: Sequence[Report]) -> None:
        self.on_reports(reports)
        state = self.state
        for report in reports:
            if isinstance(report, Watching):
                refusal = ""
            elif isinstance(report, CommandError):  # there may be too many watchers
                assert self._client is not None
                self._asking = asyncio.ensure_future(self._ask_later(self._client))
                refusal = report.text
            else:
                continue
            if state.watches == bool(refusal) or state.refusal != refusal:
                state.watches, state.refusal = not refusal, refusal
                self.on_link()

    async def _ask_later(self, client: AsyncClient) -> None:
        await asyncio.sleep(ASK_AGAIN)
        # Meanwhile, the connection may have been lost, or a newer request may have been
        # made.
        if client is self._client and self._asking is asyncio.current_task():
            await self._ask(client)


class ParentLink(ServerLink):
    """A link to the server in the parent process, which controls the server's time.

    Each request is one line of JSON on stdout, which the parent reads. The parent
    writes each change of speed or pause as one line of JSON to stdin.
    """

    refusal = ""

    def change_pace(self, request: Pace) -> None:
        """See ``Link.change_pace``."""
        sys.stdout.write(f"{request.model_dump_json(exclude={'op'})}\n")
        sys.stdout.flush()

    def follow(self, exit_code: asyncio.Future[int]) -> None:
        """Read the speed from the parent, and set the exit code to 0 when it ends."""
        loop = asyncio.get_running_loop()

        def take(line: str) -> None:
            pace = Pace.model_validate_json(line)
            speed = self.speed if pace.speed is None else pace.speed
            self._set_pace(speed, bool(pace.paused))

        def end() -> None:
            if not exit_code.done():
                exit_code.set_result(0)

        def wait() -> None:
            with suppress(RuntimeError):  # the loop is closed
                for line in sys.stdin:
                    loop.call_soon_threadsafe(take, line)
                loop.call_soon_threadsafe(end)

        threading.Thread(target=wait, daemon=True).start()
