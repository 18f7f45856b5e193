"""Recordings of all robots of a server, which the page begins and ends, one at a time.

A recording has a connection of its own that watches the robots, and is none of those
that show them: what is recorded does not depend on who looks. Another process writes
the files.
"""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from radarsim.addons.recording.bag_folder import (
    RecordingInfo,
    check_installed,
    create_folder,
)
from radarsim.addons.web.requests import BadRequest
from radarsim.addons.web.viewers import Viewers
from radarsim.client import session as questions
from radarsim.client.session import RANGE_SCANNER, ROBOT
from radarsim.client.transport import CHUNK, lost, no_server
from radarsim.errors import (
    ClientError,
    MalformedMessage,
    RadarsimError,
    RecordingError,
)
from radarsim.protocol.message import LineBuffer
from radarsim.protocol.reports import (
    CommandError,
    Greeting,
    Report,
    RobotJoined,
    RobotLeft,
    Watching,
    decode_report,
)
from radarsim.protocol.watch import is_seen, split_seen
from radarsim.simulation.config import SimulationConfig

if TYPE_CHECKING:
    from radarsim.addons.recording.recording_process import RecordingProcess
    from radarsim.addons.recording.wire_recorder import WireRecorder

ANSWER: Final = 5.0  # s that the server has to answer


class RecordingSwitch:
    """Records all robots into new folders, all below the same one."""

    def __init__(
        self,
        server: tuple[str, int] | None,
        config: SimulationConfig,
        folder: Path,
        viewers: Viewers,
        *,
        map_: str | None = None,
    ) -> None:
        """Record nothing yet.

        Args:
            server: Host and port of the server; None if a recording is played.
            config: How the server was started, as far as it is known.
            folder: Folder in which each recording gets one of its own.
            viewers: Who is told.
            map_: The map that is shown.
        """
        self._server = server
        self._config = config
        self._folder = folder
        self._map = map_
        self._viewers = viewers
        self._task: asyncio.Task[None] | None = None
        self._state: dict[str, Any] = {"op": "recording", "on": False, "text": ""}

    def message(self) -> dict[str, Any]:
        """Return what a new browser has to know."""
        return self._state

    def switch(self, on: bool) -> None:
        """Begin to record, or end it; what is so already stays so.

        Raises:
            BadRequest: If the recording before is still being completed.
            RecordingError: If something is missing that recordings need.
        """
        if not on:
            if self._state["on"] and self._task is not None:
                self._task.cancel()
        elif self._server is None:
            raise BadRequest("a recording is played, expected a server to record")
        elif self._task is None:
            check_installed()
            self._task = asyncio.ensure_future(self._record())
        elif self._task.cancelling():
            raise BadRequest("the recording before is not complete yet")

    async def close(self) -> None:
        """End a recording, and wait until it is complete."""
        if self._task is not None:
            # Cancelled twice, it would not wait for its files.
            if not self._task.cancelling():
                self._task.cancel()
            await asyncio.wait({self._task})

    async def _record(self) -> None:
        name = f"recording_{datetime.now().astimezone():%Y%m%d_%H%M%S}"
        folder = self._folder.resolve() / name
        assert self._server is not None  # ``switch`` has refused
        recording = _Recording(folder, self._info)
        begun = f"Records to {folder}"
        try:
            await recording.run(self._server, lambda: self._tell(True, begun))
        except asyncio.CancelledError:
            self._tell(False, f"Recorded in {folder}")
        except RadarsimError as error:
            # What was recorded until a connection was lost is complete.
            is_cut = isinstance(error, RecordingError)
            text = f"{folder} is not complete" if is_cut else f"Recorded in {folder}"
            self._tell(False, text if self._state["on"] else "")
            self._viewers.broadcast({"op": "error", "text": f"recording: {error}"})
        finally:
            self._task = None

    def _info(self, level: str) -> RecordingInfo:
        """Return what a recording of a map says of its run."""
        drawn = _lasting_name(self._map)
        return RecordingInfo.of_config(self._config, level=level, drawn_map=drawn)

    def _tell(self, on: bool, text: str) -> None:
        self._state = {"op": "recording", "on": on, "text": text}
        self._viewers.broadcast(self._state, "recording")


class _Recording:
    """One recording; each robot is in it as a client that was sent its lines."""

    def __init__(self, folder: Path, describe: Callable[[str], RecordingInfo]) -> None:
        self._folder, self._describe = folder, describe
        self._lines = LineBuffer()
        self._level = ""
        self._numbers: dict[str, int] = {}  # of robots that are there
        self._count = 0  # of robots so far

    async def run(self, server: tuple[str, int], on_begin: Callable[[], None]) -> None:
        """Record until the task is cancelled; the recording is complete then as well.

        Args:
            server: Host and port of the server.
            on_begin: Called when recording has begun.

        Raises:
            ClientError: If the server is not there, does not let robots be watched, or
                closes the connection.
            RecordingError: If the recording cannot be written.
        """
        # Before the server sends anything, as this takes seconds.
        for name in ("recording_process", "wire_recorder"):
            module = f"radarsim.addons.recording.{name}"
            await asyncio.to_thread(import_module, module)
        from radarsim.addons.recording.wire_recorder import WireRecorder  # noqa: PLC0415

        try:
            reader, writer = await asyncio.open_connection(*server)
        except (OSError, UnicodeError) as error:
            raise no_server(*server, error) from None
        try:
            # All robots with all echoes, whatever the pages look at.
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
                if not await asyncio.to_thread(process.close):
                    text = f"{self._folder} is not complete: is the disk full?"
                    # also if it was cancelled, which would say that all is well
                    raise RecordingError(f"{text} radarsim's terminal tells why")
        finally:
            writer.close()

    async def _await_permission(self, reader: asyncio.StreamReader) -> list[str]:
        """Return the lines from the answer to ``WATCH`` on."""
        try:
            async with asyncio.timeout(ANSWER):
                while True:
                    lines = await self._read(reader)
                    for i, line in enumerate(lines):
                        report = _decode(line)
                        if isinstance(report, Greeting):
                            self._level = report.level
                        elif isinstance(report, CommandError):
                            raise ClientError(report.text)
                        elif isinstance(report, Watching):
                            return lines[i:]
        except TimeoutError:
            text = "this server does not tell of robots, expected one of radarsim"
            raise ClientError(text) from None

    def _begin(self) -> "RecordingProcess":
        """Create the folder, and start the process that writes into it."""
        from radarsim.addons.recording.recording_process import (  # noqa: PLC0415
            RecordingProcess,
        )

        create_folder(self._folder)
        return RecordingProcess(self._folder, self._describe(self._level))

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
        self, line: str, recorder: "WireRecorder", writer: asyncio.StreamWriter
    ) -> None:
        """Record a line of a robot; ask about a robot that is new."""
        if is_seen(line):
            robot, own = split_seen(line)
            if robot not in self._numbers:
                self._begin_robot(robot, recorder)
            recorder.received(self._numbers[robot], f"{own}\r\n".encode("latin-1"))
            return
        report = _decode(line)
        if isinstance(report, RobotLeft) and report.robot in self._numbers:
            recorder.end_one(self._numbers.pop(report.robot))
        elif isinstance(report, RobotJoined):
            self._begin_robot(report.robot, recorder)
            # Of which class it is, is told nowhere else.
            spawn = questions.spawn(report.class_name, name=report.robot)
            recorder.sent(self._numbers[report.robot], spawn.data)
            # No client of the robot has to ask: a recording cannot be read without.
            for kind in (ROBOT, RANGE_SCANNER):
                for ask in (questions.geometry, questions.configuration):
                    writer.write(ask(kind, robot=report.robot).data)

    def _begin_robot(self, robot: str, recorder: "WireRecorder") -> None:
        self._count += 1
        self._numbers[robot] = self._count
        recorder.begin(self._count, robot)


def _lasting_name(map_: str | None) -> str:
    """Return the name of a map as it holds in other folders as well."""
    if map_ is None or not Path(map_.partition("@")[0]).exists():
        return map_ or ""
    return str(Path(map_).resolve())


def _decode(line: str) -> Report | None:
    with suppress(MalformedMessage):
        return decode_report(line)
    return None
