"""A client of radarsim that watches a robot, and passes on what it reports.

It stands where a proxy stands for other servers: an observer gets the lines that the
robot's own client is sent, and nobody is in between.
"""

import asyncio
from collections.abc import Callable
from typing import Any, Final

from radarsim.autonomy.proxy.tcp_proxy import DataCallback
from radarsim.client import session as questions
from radarsim.client.session import RANGE_SCANNER, ROBOT, Question, Session
from radarsim.client.transport import CHUNK, lost, no_server
from radarsim.errors import ClientError
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.reports import CommandError, Report, WatchedLine, Watching
from radarsim.server.lifecycle import exit_code_of_signal

PATIENCE: Final = 2.0  # s without a line, after which the robot may have left
NUMBER: Final = 1  # of the only connection
_ECHOES: Final = questions.set_item(RANGE_SCANNER, None, "ECHOES", "true")


class RobotWatcher:
    """Watches one robot until it leaves.

    Attributes:
        on_wait: Called once if the robot is not there yet.
        robot: Name of the robot.
    """

    def __init__(
        self,
        server: tuple[str, int],
        robot: str,
        on_data: DataCallback,
        *,
        echoes: bool = True,
        patience: float = PATIENCE,
    ) -> None:
        """Create a watcher that is not connected.

        Args:
            server: Host and port of the server.
            robot: Name of the robot, in any case; of several, the first that reports.
            on_data: Called with the lines of the robot as with those of a server, and
                with what its client would have sent; must not raise or block.
            echoes: Whether its scanners shall list their echoes.
            patience: Time without a line after which the server is asked whether the
                robot is there, s.

        Raises:
            ValueError: If the name cannot be sent.
        """
        self.on_wait: Callable[[], None] = lambda: None
        self.robot = robot
        self._server = server
        self._command = questions.watch(robot, echoes)
        self._on_data = on_data
        self._echoes = echoes
        self._patience = patience
        self._session = Session()
        self._is_watching = self._has_seen = self._has_waited = False

    async def run(self) -> None:
        """Watch until the robot leaves, if it has been there.

        Raises:
            ClientError: If the server is not there, does not let robots be watched, or
                closes the connection.
        """
        try:
            reader, writer = await asyncio.open_connection(*self._server)
        except (OSError, UnicodeError) as error:
            raise no_server(*self._server, error) from None
        try:
            writer.write(self._command)
            while not self._has_left(await self._reports(reader), writer):
                pass
        finally:
            writer.close()

    async def _reports(self, reader: asyncio.StreamReader) -> list[Report] | None:
        """Return the next reports; None if nothing has come for a while."""
        try:
            async with asyncio.timeout(self._patience):
                data = await reader.read(CHUNK)
        except TimeoutError:
            return None
        except OSError as error:
            raise ClientError(str(lost(error))) from None
        if not data:
            raise ClientError("the server closed the connection")
        return self._session.receive(data)

    def _has_left(
        self, reports: list[Report] | None, writer: asyncio.StreamWriter
    ) -> bool:
        """Process reports, and return whether the robot has left."""
        if reports is None:
            if not self._is_watching:
                raise ClientError("no answer to WATCH, expected a server of radarsim")
            writer.write(self._question(questions.geometry, ROBOT))
        for report in reports or ():
            match report:
                case Watching():
                    self._is_watching = True
                    writer.write(self._question(questions.geometry, ROBOT))
                case CommandError(text):
                    if self._has_seen:
                        return True
                    self._wait(text)
                case WatchedLine():
                    self._pass_on(report, writer)
                case _:
                    pass
        return False

    def _wait(self, text: str) -> None:
        if not self._is_watching:
            raise ClientError(text)
        if not self._has_waited:
            self._has_waited = True
            self.on_wait()

    def _pass_on(self, copy: WatchedLine, writer: asyncio.StreamWriter) -> None:
        if not self._has_seen:
            self._has_seen = True
            self.robot = copy.robot
            if self._echoes:
                self._on_data(NUMBER, "client", _ECHOES)
            for ask in (questions.geometry, questions.configuration):
                writer.write(self._question(ask, RANGE_SCANNER))
        if copy.robot == self.robot:
            self._on_data(NUMBER, "server", f"{copy.line}\r\n".encode("latin-1"))

    def _question(self, ask: Callable[..., Question], kind: str) -> bytes:
        return ask(kind, robot=printable_name(self.robot)).data


async def watch_until_signal(watcher: RobotWatcher) -> int:
    """Watch a robot until it leaves, or a signal comes.

    Returns:
        Exit code: 0 if the robot has left, or after a request to terminate; 130 after
        an interrupt.

    Raises:
        ClientError: If the robot cannot be watched.
    """
    with exit_code_of_signal() as exit_code:
        watching = asyncio.ensure_future(watcher.run())
        both: set[asyncio.Future[Any]] = {watching, exit_code}
        await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
        if exit_code.done():
            watching.cancel()
            await asyncio.wait({watching})
            return exit_code.result()
        watching.result()  # raises its error
        return 0
