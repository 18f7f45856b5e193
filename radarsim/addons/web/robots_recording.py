"""A recording of all robots of a server, by a connection that watches them.

The connection is none of those that show robots: what is recorded does not depend on
who looks. Another process writes the files.
"""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

from radarsim import __version__
from radarsim.addons.recording.bag_folder import RecordingInfo, create_folder
from radarsim.addons.recording.recording_process import RecordingProcess
from radarsim.addons.recording.wire_recorder import WireRecorder
from radarsim.client import session as questions
from radarsim.client.session import RANGE_SCANNER, ROBOT
from radarsim.client.transport import CHUNK, lost, no_server
from radarsim.errors import ClientError, MalformedMessage, RecordingError
from radarsim.protocol.framing import LineBuffer
from radarsim.protocol.reports import (
    CommandError,
    Greeting,
    Report,
    RobotJoined,
    Watching,
    decode_report,
)
from radarsim.protocol.watch import is_seen, split_seen
from radarsim.simulation.config import SimulationConfig

ANSWER: Final = 5.0  # s that the server has to answer


class RobotsRecording:
    """One recording; each robot is in it as a client that was sent its lines.

    Attributes:
        folder: Folder of the recording.
    """

    def __init__(
        self, server: tuple[str, int], folder: Path, config: SimulationConfig
    ) -> None:
        """Plan a recording.

        Args:
            server: Host and port of the server.
            folder: Folder to create.
            config: How the server was started, as far as it is known.
        """
        self.folder = folder
        self._server = server
        self._config = config
        self._lines = LineBuffer()
        self._level = ""
        self._numbers: dict[str, int] = {}  # of robots

    async def run(self, on_begin: Callable[[], None]) -> None:
        """Record until the task is cancelled; the recording is complete then as well.

        Args:
            on_begin: Called when recording has begun.

        Raises:
            ClientError: If the server is not there, does not let robots be watched, or
                closes the connection.
            RecordingError: If the recording cannot be written.
        """
        try:
            reader, writer = await asyncio.open_connection(*self._server)
        except (OSError, UnicodeError) as error:
            raise no_server(*self._server, error) from None
        try:
            writer.write(questions.watch(None, echoes=True))
            lines = await self._await_permission(reader)
            process = await asyncio.to_thread(self._begin)
            recorder = WireRecorder(process.add)
            try:
                on_begin()
                while not process.has_ended:
                    for line in lines:
                        with suppress(MalformedMessage):
                            self._take(line, recorder, writer)
                    lines = await self._read(reader)
            finally:
                recorder.end()
                is_whole = await asyncio.to_thread(process.close)
        finally:
            writer.close()
        if not is_whole:
            text = f"{self.folder} ends early: is the disk full? radarsim's terminal"
            raise RecordingError(f"{text} tells why")

    async def _await_permission(self, reader: asyncio.StreamReader) -> list[str]:
        """Return the lines from the answer to ``WATCH`` on."""
        try:
            async with asyncio.timeout(ANSWER):
                while True:
                    lines = await self._read(reader)
                    for i, line in enumerate(lines):
                        if self._permits(_decode(line)):
                            return lines[i:]
        except TimeoutError:
            text = "this server does not tell of robots, expected one of radarsim"
            raise ClientError(text) from None

    def _permits(self, report: Report | None) -> bool:
        if isinstance(report, Greeting):
            self._level = report.level
        elif isinstance(report, CommandError):
            raise ClientError(report.text)
        return isinstance(report, Watching)

    def _begin(self) -> RecordingProcess:
        """Create the folder, and start the process that writes into it."""
        config = self._config
        info = RecordingInfo.model_validate(
            {
                "version": __version__,
                "level": self._level,
                "dialect": config.dialect.name,
                "drive_unit": config.drive_unit or config.dialect.drive_unit,
            }
        )
        create_folder(self.folder)
        return RecordingProcess(self.folder, info)

    async def _read(self, reader: asyncio.StreamReader) -> list[str]:
        """Return the next lines."""
        try:
            data = await reader.read(CHUNK)
        except OSError as error:
            raise ClientError(str(lost(error))) from None
        if not data:
            raise ClientError("the server closed the connection")
        return self._lines.feed(data)

    def _take(
        self, line: str, recorder: WireRecorder, writer: asyncio.StreamWriter
    ) -> None:
        """Record a line of a robot; ask about a robot that is new."""
        if is_seen(line):
            robot, own = split_seen(line)
            if robot not in self._numbers:
                self._numbers[robot] = len(self._numbers) + 1
                recorder.begin(self._numbers[robot], robot)
            recorder.received(self._numbers[robot], f"{own}\r\n".encode("latin-1"))
        elif isinstance(report := _decode(line), RobotJoined):
            for kind in (ROBOT, RANGE_SCANNER):
                for ask in (questions.geometry, questions.configuration):
                    writer.write(ask(kind, robot=report.robot).data)


def _decode(line: str) -> Report | None:
    with suppress(MalformedMessage):
        return decode_report(line)
    return None
