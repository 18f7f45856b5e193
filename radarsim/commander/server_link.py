"""The connection to the server that sees robots of all clients, and is opened anew."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

from radarsim.client import AsyncClient, ClientError, ClientTimeout
from radarsim.geometry import Pose3

RETRY: Final = 1.0  # s between two attempts to connect
ANSWER: Final = 5.0  # s that the server has to answer


@dataclass(slots=True)
class ServerState:
    """What is known of the server.

    Attributes:
        level: Name of its map.
        starts: Start poses by name.
        watches: Whether it tells of robots of other clients.
        problem: Why there is no connection; empty while there is one.
    """

    level: str = ""
    starts: dict[str, Pose3] = field(default_factory=dict)
    watches: bool = False
    problem: str = "not connected yet"


class ServerLink:
    """Connects, and again when the connection is lost."""

    def __init__(self, address: tuple[str, int], on_change: Callable[[], None]) -> None:
        """Describe a link that is not open yet.

        Args:
            address: Host and port of the server.
            on_change: Called when the connection is there, and when it is lost.
        """
        self.state = ServerState()
        self._address = address
        self._on_change = on_change

    async def run(self) -> None:
        """Keep the connection open for ever."""
        while True:
            try:
                await self._connect()
            except ClientError as error:
                if self.state.problem != str(error):
                    self.state.problem = str(error)
                    self._on_change()
            await asyncio.sleep(RETRY)

    async def _connect(self) -> None:
        """Ask for what is needed, and listen until the connection is lost.

        Raises:
            ClientError: When it is lost, or cannot be opened.
        """
        async with await AsyncClient.connect(*self._address, timeout=ANSWER) as client:
            level = (await client.greeting()).level
            try:
                starts = await client.start_poses()
            except ClientTimeout:  # not every server knows any
                starts = {}
            self.state = ServerState(level, starts, problem="")
            self._on_change()
            while True:
                try:
                    await client.read(3600.0)
                except ClientTimeout:
                    continue
