"""The connection that sees the robots of all clients; opened anew when it is lost."""

import asyncio
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from radarsim.client import AsyncClient, ClientError, ClientTimeout
from radarsim.geometry import Pose3
from radarsim.protocol.reports import CommandError, Report, Watching

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
        watches: Whether it tells of robots of other clients, as not every server does.
        refusal: Why it does not at present; empty if it has not said so.
        problem: Why there is no connection; empty while there is one.
    """

    level: str = ""
    starts: dict[str, Pose3] = field(default_factory=dict)
    watches: bool = False
    refusal: str = ""
    problem: str = "not connected yet"


class ServerLink:
    """Connects, watches all robots, and connects again when the connection is lost.

    Attributes:
        state: What is known of the server.
        on_change: Called when the connection is there, when it is lost, and when the
            server turns out to tell of robots, or refuses to.
        on_reports: Called with reports of all robots.
    """

    def __init__(self, address: tuple[str, int]) -> None:
        """Describe a link that is not open yet.

        Args:
            address: Host and port of the server.
        """
        self.state = ServerState()
        self.on_change: Callable[[], None] = lambda: None
        self.on_reports: Callable[[Sequence[Report]], None] = lambda _: None
        self._address = address
        self._client: AsyncClient | None = None
        self._echoes: frozenset[str] = frozenset()
        self._asking: asyncio.Task[None] | None = None

    async def run(self) -> None:
        """Keep the connection open for ever."""
        while True:
            try:
                await self._connect()
            except ClientError as error:
                self._client = None
                if self.state.problem != str(error):
                    self.state = ServerState(self.state.level, problem=str(error))
                    self.on_change()
            await asyncio.sleep(RETRY)

    def ask_for_echoes(self, robots: Iterable[str]) -> None:
        """Ask for the echoes of some robots, and of no others any more.

        Args:
            robots: Names of the robots.
        """
        wanted = frozenset(name for name in robots if "," not in name)
        if wanted == self._echoes:
            return
        self._echoes = wanted
        if self._client is not None and self.state.watches:
            self._asking = asyncio.ensure_future(self._ask(self._client))

    async def _connect(self) -> None:
        """Ask for what is needed, and listen until the connection is lost.

        Raises:
            ClientError: When it is lost, or cannot be opened.
        """
        async with await AsyncClient.connect(*self._address, timeout=ANSWER) as client:
            level = (await client.greeting()).level
            starts: dict[str, Pose3] = {}
            with suppress(ClientTimeout):  # not every server knows any
                starts = await client.start_poses()
            self.state = ServerState(level, starts, problem="")
            self._client = client
            self.on_change()
            await self._ask(client)
            while True:
                with suppress(ClientTimeout):
                    self._take(await client.read(SILENCE))

    async def _ask(self, client: AsyncClient) -> None:
        with suppress(ClientError):  # who reads notices that it is lost
            await client.watch(echoes=sorted(self._echoes))

    def _take(self, reports: Sequence[Report]) -> None:
        if not self.state.watches and any(
            isinstance(report, Watching) for report in reports
        ):
            self.state.watches, self.state.refusal = True, ""
            self.on_change()
        self.on_reports(reports)
        for report in reports:
            if isinstance(report, CommandError) and not self.state.watches:
                self._take_refusal(report.text)

    def _take_refusal(self, text: str) -> None:
        """Ask again later: the server may have had too many watchers."""
        if self._client is not None:
            self._asking = asyncio.ensure_future(self._ask_later(self._client))
        if self.state.refusal != text:
            self.state.refusal = text
            self.on_change()

    async def _ask_later(self, client: AsyncClient) -> None:
        await asyncio.sleep(ASK_AGAIN)
        if client is self._client:
            await self._ask(client)
