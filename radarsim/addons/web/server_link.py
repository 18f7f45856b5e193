"""The connection that sees the robots of all clients; opened anew when it is lost.

The server is asked to tell what somebody looks at, and nothing else. Copies of the
robots' lines take time of the server, echoes far more. Without a page on a screen, and
without a map that is being made, the server tells nothing.
"""

import asyncio
import logging
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from radarsim.client import AsyncClient, ClientError, ClientTimeout
from radarsim.client import session as questions
from radarsim.geometry import Pose3
from radarsim.protocol.reports import CommandError, Report, Watching

log = logging.getLogger("radarsim.commander")

UNCONNECTED: Final = "not connected yet"
RETRY: Final = 1.0  # s between two attempts to connect
ASK_AGAIN: Final = 5.0  # s after the server has refused to tell of all robots
ANSWER: Final = 5.0  # s that the server has to answer
SILENCE: Final = 60.0  # s that one call waits for reports


@dataclass(slots=True)
class ServerState:
    """What is known of the server.

    Attributes:
        level: Name of its map.
        starts: Start poses by name.
        watches: Whether it tells of robots of other clients when it is asked to, as not
            every server does.
        refusal: Why it does not at present; empty if it has not said so.
        problem: Why there is no connection; empty while there is one.
    """

    level: str = ""
    starts: dict[str, Pose3] = field(default_factory=dict)
    watches: bool = False
    refusal: str = ""
    problem: str = UNCONNECTED


class ServerLink:
    """Connects, watches robots, and connects again when the connection is lost.

    Attributes:
        address: Host and port of the server.
        state: What is known of the server.
        on_link: Called when the connection is there, when it is lost, and when the
            server turns out to tell of robots, or refuses to.
        on_reports: Called with reports of all robots.
    """

    def __init__(self, address: tuple[str, int]) -> None:
        """Describe a link that is not open yet."""
        self.address = address
        self.state = ServerState()
        self.on_link: Callable[[], None] = lambda: None
        self.on_reports: Callable[[Sequence[Report]], None] = lambda _: None
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
                # Each attempt fails alike; browsers are told once.
                if self.state.problem == UNCONNECTED:
                    log.warning("waiting for a server: %s", error)
                if self.state.problem != str(error):
                    self.state = ServerState(self.state.level, problem=str(error))
                    self.on_link()
            await asyncio.sleep(RETRY)

    def watch(self, echoes: Iterable[str] | None) -> None:
        """Watch all robots from now on, or none.

        Args:
            echoes: Names of the robots of which echoes are told as well; None to watch
                no robot.
        """
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
        """Ask for what is needed, and listen until the connection is lost.

        Raises:
            ClientError: When it is lost, or cannot be opened.
        """
        async with await AsyncClient.connect(*self.address, timeout=ANSWER) as client:
            level = (await client.greeting()).level
            starts: dict[str, Pose3] = {}
            with suppress(ClientTimeout):  # not every server knows any
                starts = await client.start_poses()
            self.state = ServerState(level, starts, problem="")
            self._client = client
            self.on_link()
            # What was asked for before there was this connection.
            await self._ask(client)
            while True:
                with suppress(ClientTimeout):
                    self._take(await client.read(SILENCE))

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
