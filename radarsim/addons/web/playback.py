"""Plays a recording to the commander, as a replacement for a server.

A bag has an index of its chunks, so that any second is read without the rest. Reports
are those of a watched server: robots that join and leave, and the lines that were sent
to their clients. After a jump back in time, all robots are reported to leave. The
robots of the new time then join, with the lines of the last second before that time.
"""

import asyncio
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, Final, NamedTuple, TypeAlias

from mcap.reader import SeekingReader

from radarsim.addons.recording.bag import (
    BROKEN,
    LARGEST_RECORD,
    decode_call,
)
from radarsim.addons.recording.bag_folder import RecordingInfo
from radarsim.addons.recording.call_converter import TICK, TO_CLIENT, TO_SERVER
from radarsim.addons.recording.recorders import (
    UNNAMED,
    EventType,
    RunEvent,
    spawned_robot,
)
from radarsim.addons.web.requests import BadRequest, Pace, Seek
from radarsim.addons.web.server_link import Link, ServerState
from radarsim.errors import MalformedMessage, RecordingError
from radarsim.protocol.message import LineBuffer
from radarsim.protocol.reports import (
    RobotJoined,
    RobotLeft,
    WatchedLine,
    Watching,
    decode_report,
)
from radarsim.protocol.watch import RobotChoice
from radarsim.simulation.clock import seconds

SECOND: Final = 1_000_000_000  # ns
INTERVAL: Final = 0.05  # s between two checks for lines that are due
BEFORE: Final = 1.0  # s; lines of this period before a jump's target restore the state
FIRST_LOOK: Final = 0.2  # s after the first spawn; the robot has scanned by then


# The time, s, at which a line was sent to the client of a robot, and the line.
TimedLine: TypeAlias = tuple[float, WatchedLine]


class RecordedRobot(NamedTuple):
    """A robot of a recording.

    Attributes:
        client: Number of its client.
        name: A unique name in the recording.
        class_name: Class name, as the client spelled it; empty if it was not recorded.
        joined: Time at which it was spawned, s.
        left: Time at which its client left, or spawned another robot, s.
    """

    client: int
    name: str
    class_name: str
    joined: float
    left: float


class RecordedLines:
    """The robots of an open recording, and the lines sent to their clients.

    Attributes:
        info: The conditions of the run.
        start: Start of the recording, s of simulated time.
        end: End of the recording, s of simulated time.
        robots: The robots, in the order in which they were spawned.
    """

    def __init__(self, file: IO[bytes], info: RecordingInfo) -> None:
        """Read the index, and find the robots.

        Args:
            file: The file of the bag.
            info: The conditions of the run.

        Raises:
            RecordingError: If the file has no index, or nothing was sent to a client.
        """
        self.info = info
        self._path = Path(file.name)
        self._reader = SeekingReader(
            file, validate_crcs=True, record_size_limit=LARGEST_RECORD
        )
        summary = None
        with suppress(*BROKEN):
            summary = self._reader.get_summary()
        if summary is None or summary.statistics is None or not summary.chunk_indexes:
            text = "is truncated"
            raise RecordingError(self._describe(text))
        self.end = summary.statistics.message_end_time // TICK / 100
        self.robots = _find_robots(self._calls(TO_SERVER, None, None), self.end)
        first = next(self._calls(TO_CLIENT, None, None), None)
        if first is None:
            text = f"{self._path}: nothing was sent to clients, expected data of robots"
            raise RecordingError(text)
        self.start = seconds(first.tick)

    def read(self, second: int) -> list[TimedLine]:
        """Return the lines of one second of simulated time, in order.

        Args:
            second: Start of the second, s.

        Raises:
            RecordingError: If that part of the file is damaged.
        """
        lines: list[TimedLine] = []
        buffers: dict[int, LineBuffer] = {}
        for call in self._calls(TO_CLIENT, second * SECOND, (second + 1) * SECOND):
            robot = self._robot_of(call)
            if robot is None or not call.data:
                continue
            buffer = buffers.setdefault(call.client, LineBuffer())
            for text in buffer.feed(call.data):
                with suppress(MalformedMessage):  # the second may begin within a line
                    line = WatchedLine(robot.name, text, decode_report(text))
                    lines.append((seconds(call.tick), line))
        return lines

    def _robot_of(self, call: RunEvent) -> RecordedRobot | None:
        """Return the robot that the client of a call had at the time of the call."""
        time = seconds(call.tick)
        for robot in reversed(self.robots):
            if robot.client == call.client and robot.joined <= time <= robot.left:
                return robot
        return None

    def _calls(
        self, topic: str, start: int | None, end: int | None
    ) -> Iterator[RunEvent]:
        """Yield the calls of a topic from ``start`` up to ``end``, ns."""
        found = self._reader.iter_messages(
            [topic], starting_at=start, ending_before=end
        )
        try:
            for schema, _, message in found:
                yield decode_call(schema.name if schema else "", message.data)
        except BROKEN as error:
            raise RecordingError(self._describe(f"is damaged: {error}")) from error

    def _describe(self, problem: str) -> str:
        command = f"radarsim recording repair {self._path.parent}"
        return f"{self._path} {problem}; {command!r} keeps its readable part"


def _find_robots(calls: Iterable[RunEvent], end: float) -> list[RecordedRobot]:
    """Find robots by the commands that spawned them; ``end`` is the run's end, s."""
    robots: list[RecordedRobot] = []
    current: dict[int, int] = {}  # index of a client's newest robot
    taken: set[str] = set()

    def leave(client: int, time: float) -> None:
        if (place := current.pop(client, None)) is not None:
            robots[place] = robots[place]._replace(left=time)

    for call in calls:
        time = seconds(call.tick)
        if call.type is EventType.DISCONNECT:
            leave(call.client, time)
        elif call.type is EventType.RECEIVE:
            lines = call.data.decode("latin-1").splitlines()
            for wanted, class_name in filter(None, map(spawned_robot, lines)):
                leave(call.client, time)
                name = _unique(wanted or class_name or UNNAMED, taken)
                current[call.client] = len(robots)
                robots.append(RecordedRobot(call.client, name, class_name, time, end))
    return robots


def _unique(name: str, taken: set[str]) -> str:
    """Return a name that is not in ``taken``, and add the name to ``taken``."""
    wanted, count = name, 1
    while name.casefold() in taken:
        count += 1
        name = f"{wanted}_{count}"
    taken.add(name.casefold())
    return name


class Playback(Link):
    """A link to a recording; browsers control the time that is shown."""

    refusal = ""

    def __init__(self, recording: RecordedLines) -> None:
        """Create a playback that is paused shortly after the first robot was spawned.

        Args:
            recording: The recording.
        """
        level = recording.info.level or recording.info.map  # old files have no level
        super().__init__(None, ServerState(level, watches=True, problem=""))
        self._recording = recording
        self.is_paused = True
        joined = [robot.joined for robot in recording.robots]
        first = min(joined, default=recording.start) + FIRST_LOOK
        self._time = recording.start
        self._wanted: float | None = min(first, recording.end)  # time to jump to
        self._present: set[str] = set()
        self._seconds: dict[int, list[TimedLine]] = {}
        self._changed = asyncio.Event()

    @property
    def position(self) -> float | None:
        """The time that the page shows, s."""
        return self._time

    @property
    def _target(self) -> float:
        """The requested time, s, or the shown time if no jump is requested."""
        return self._time if self._wanted is None else self._wanted

    def time_message(self) -> dict[str, Any]:
        """See ``Link.time_message``; the times are those of the recorded run."""
        recording = self._recording
        times = {"t": self._target, "start": recording.start, "end": recording.end}
        return {**super().time_message(), **times}

    def change_pace(self, request: Pace) -> None:
        """See ``Link.change_pace``; a recording that has ended starts again."""
        paused = self.is_paused if request.paused is None else request.paused
        if request.step is not None:
            paused = True
            self._go(min(self._target + request.step, self._recording.end))
        elif not paused and self._time >= self._recording.end:
            self._go(self._recording.start)
        self._set_pace(request.speed or self.speed, paused)
        self._changed.set()

    def seek(self, request: Seek) -> None:
        """See ``Link.seek``."""
        start, end = self._recording.start, self._recording.end
        if not start <= request.t <= end:
            raise BadRequest(f"time {request.t} s, expected {start:g} to {end:g} s")
        self._go(request.t)
        self.on_time()

    async def run(self) -> None:
        """Play until cancelled; pause at the end of the recording."""
        self.on_link()
        self.on_reports([Watching(RobotChoice(None))])
        clock = asyncio.get_running_loop().time
        last = clock()
        while True:
            if self.is_paused and self._wanted is None:
                await self._changed.wait()
                last = clock()
            self._changed.clear()
            await asyncio.sleep(INTERVAL)
            last, passed = clock(), clock() - last
            wanted, self._wanted = self._wanted, None
            if wanted is not None:
                await self._show(wanted)
            elif not self.is_paused:
                end = self._recording.end
                time = min(self._time + passed * self.speed, end)
                await self._show(time)
                if time >= end and self._wanted is None:
                    self._set_pace(self.speed, True)

    def _go(self, time: float) -> None:
        # A newer request replaces a request that has not been executed yet.
        self._wanted = time
        self._changed.set()

    async def _show(self, time: float) -> None:
        """Report the lines from the shown time to ``time``, or only the last second."""
        since = self._time
        if time < since:
            self.on_reports([RobotLeft(name) for name in sorted(self._present)])
            self._present.clear()
        if not 0 <= time - since <= max(BEFORE, 2 * INTERVAL * self.speed):
            since = time - BEFORE  # earlier lines would be replaced at once
        lines = await self._read(since, time)
        if self._wanted is not None:  # another time was requested meanwhile
            return
        self._time = time
        self._report_robots(time)
        self.on_reports([line for line in lines if line.robot in self._present])

    def _report_robots(self, time: float) -> None:
        """Report the robots that have joined and left since the last call."""
        robots = self._recording.robots
        there = {r.name: r for r in robots if r.joined <= time <= r.left}
        gone = sorted(self._present - there.keys())
        new = [robot for name, robot in there.items() if name not in self._present]
        self._present = {*there}
        self.on_reports([RobotLeft(name) for name in gone])
        self.on_reports([RobotJoined(each.name, each.class_name) for each in new])

    async def _read(self, since: float, time: float) -> list[WatchedLine]:
        """Return the lines after ``since`` up to ``time``, s."""
        before, self._seconds = self._seconds, {}
        for second in range(int(max(since, 0.0)), int(time) + 1):
            try:
                lines = before.get(second)
                if lines is None:
                    lines = await asyncio.to_thread(self._recording.read, second)
            except RecordingError as error:  # the rest of the file may be undamaged
                self.on_damage(str(error))
                lines = []
            self._seconds[second] = lines  # the next call may need the same second
        found = (line for lines in self._seconds.values() for line in lines)
        return [line for sent, line in found if since < sent <= time]
