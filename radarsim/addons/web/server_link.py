"""The connection that watches the robots of all clients, and the pace of their time.

The connection is opened again when it is lost. The server is asked only for reports
that a page shows. Copies of the robots' lines take time of the
server, echoes far more. Without a page on a screen, and without a map that is being
made, the server sends nothing.
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
ASK_AGAIN: Final = 5.0  # s after the server has refused to be watched
ANSWER: Final = 5.0  # s that the server has to answer
FOREIGN: Final = (
    "this page has not started the server; 'radarsim serve MAP --web PORT' has a page"
    " that can"
)


@dataclass(slots=True)
class ServerState:
    """The state of the server.

    Attributes:
        level: Name of its map.
        starts: Start poses by name.
        watches: Whether it reports robots of other clients on request, as not every
            server does.
        refusal: Why it does not at present; empty if it has not said so.
        problem: Why there is no connection; empty while there is one.
    """

    level: str = ""
    starts: dict[str, Pose3] = field(default_factory=dict)
    watches: bool = False
    refusal: str = ""
    problem: str = UNCONNECTED


class Link:
    """Where robots are: a server or a recording, and how time passes there.

    Attributes:
        address: Host and port of the server; None if a recording is played.
        state: The state of the server.
        speed: Simulated seconds in one second of the wall clock.
        is_paused: Whether time passes only by steps.
        on_link: Called when the connection is there, when it is lost, and when the
            server turns out to report robots, or refuses to.
        on_reports: Called with reports of all robots.
        on_time: Called when speed or pause have changed.
        on_damage: Called with a text on a part that cannot be read.
    """

    refusal: str = FOREIGN  # why time cannot be controlled; empty if it can

    def __init__(self, address: tuple[str, int] | None, state: ServerState) -> None:
        """Let time pass by itself, which is all that is known of other servers."""
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
        """The time that is shown, s; None for that of the newest reports."""
        return None

    def time_message(self) -> dict[str, Any]:
        """Return what browsers have to know of time."""
        return {
            "op": "time",
            "refusal": self.refusal,
            "paused": self.is_paused,
            "speed": self.speed,
            "t": self.position,
            "end": None,  # only that of a recording is known
        }

    def change_pace(self, request: Pace) -> None:  # noqa: ARG002 - of those that can
        """Pause, go on, step, or change the speed.

        Raises:
            BadRequest: If that is not possible.
        """
        raise BadRequest(f"time cannot be changed: {self.refusal}")

    def seek(self, request: Seek) -> None:  # noqa: ARG002 - of recordings
        """Show another time.

        Raises:
            BadRequest: If that is not possible.
        """
        raise BadRequest("only a recording can be played from another time")

    def watch(self, echoes: Iterable[str] | None) -> None:
        """Watch all robots from now on, or none.

        Args:
            echoes: Names of the robots whose echoes are sent as well; None to watch no
                robot.
        """

    async def run(self) -> None:
        """Report what happens, for ever."""

    def _set_pace(self, speed: float, is_paused: bool) -> None:
        if (speed, is_paused) != (self.speed, self.is_paused):
            self.speed, self.is_paused = speed, is_paused
            self.on_time()


class ServerLink(Link):
    """Connects, watches robots, and connects again when the connection is lost."""

    def __init__(self, address: tuple[str, int]) -> None:
        """Describe a link that is not open yet."""
        super().__init__(address, ServerState())
        self._server = address
        self._client: AsyncClient | None = None
        self._echoes: frozenset[str] | None = None  # None while no robot is watched
        self._asking: asyncio.Task[None] | None = None  # the newest one

    async def run(self) -> None:
        """Keep the connection open for ever."""
        while True:
            try:
                await self._connect()
            except ClientError as error:
                self._client = None
                # Each attempt fails alike; browsers get it once.
                if self.state.problem == UNCONNECTED:
                    log.warning("waiting for a server: %s", error)
                if self.state.problem != str(error):
                    self.state = ServerState(self.state.level, problem=str(error))
                    self.on_link()
            await asyncio.sleep(RETRY)

    def watch(self, echoes: Iterable[str] | None) -> None:
        """See ``Link.watch``."""
        wanted = None
        if echoes is not None:  # commas part the names on a line
            wanted = frozenset(name for name in echoes if "," not in name)
        if wanted == self._echoes:
            return
        self._echoes = wanted
        if self._client is not None:
            # Only the newest one counts, see ``_ask_later``.
            self._asking = asyncio.ensure_future(self._ask(self._client))

    async def _connect(self) -> None:
        """Ask for the needed reports, and read until the connection is lost.

        Raises:
            ClientError: When it is lost, or cannot be opened.
        """
        async with await AsyncClient.connect(*self._server, timeout=ANSWER) as client:
            level = (await client.greeting()).level
            starts: dict[str, Pose3] = {}
            with suppress(ClientTimeout):  # not every server knows any
                starts = await client.start_poses()
            self.state = ServerState(level, starts, problem="")
            self._client = client
            self.on_link()
            # Requests from before this connection.
            await self._ask(client)
            while True:
                self._take(await client.read(math.inf))

    async def _ask(self, client: AsyncClient) -> None:
        with suppress(ClientError):  # who reads notices that it is lost
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
            elif isinstance(report, CommandError):  # it may have had too many watchers
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
        # Unless it was lost, or asked for something else, meanwhile.
        if client is self._client and self._asking is asyncio.current_task():
            await self._ask(client)


class ParentLink(ServerLink):
    """A link to the server that runs in the parent process, whose time it controls.

    Requests go to the parent on stdout, a line of JSON each; the parent writes the
    state to stdin, likewise.
    """

    refusal = ""

    def change_pace(self, request: Pace) -> None:
        """See ``Link.change_pace``."""
        sys.stdout.write(f"{request.model_dump_json(exclude={'op'})}\n")
        sys.stdout.flush()

    def follow(self, exit_code: asyncio.Future[int]) -> None:
        """Read the pace from the parent; an exit code of 0 at its end."""
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
