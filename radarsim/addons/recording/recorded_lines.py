"""The lines of a recording by their times, read where they are needed.

A bag has an index of its chunks, so that any second of it is read without the others.
"""

from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import IO, Final, NamedTuple, Self

from mcap.reader import SeekingReader

from radarsim.addons.recording.bag import (
    BROKEN,
    LARGEST_RECORD,
    BagReader,
    decode_call,
)
from radarsim.addons.recording.bag_folder import RecordingInfo
from radarsim.addons.recording.call_converter import TICK, TO_CLIENT, TO_SERVER
from radarsim.addons.recording.host_recorder import EventType, RunEvent
from radarsim.addons.recording.wire_recorder import UNNAMED, spawned_robot
from radarsim.errors import MalformedMessage, RecordingError, describe_os_error
from radarsim.protocol.message import LineBuffer
from radarsim.protocol.reports import WatchedLine, decode_report
from radarsim.simulation.clock import seconds

SECOND: Final = 1_000_000_000  # ns


class RecordedRobot(NamedTuple):
    """A robot of a recording.

    Attributes:
        client: Number of its client.
        name: Name that no other robot of the recording has.
        class_name: Its class, as its client spelled it; empty if that was not recorded.
        joined: When it was spawned, s.
        left: When its client left, or spawned another one, s.
    """

    client: int
    name: str
    class_name: str
    joined: float
    left: float


class TimedLine(NamedTuple):
    """A line that the client of a robot was sent.

    Attributes:
        time: When it was sent, s.
        client: Number of the client.
        line: The line, under the name of its robot.
    """

    time: float
    client: int
    line: WatchedLine


class RecordedLines:
    """A recording that is open.

    Attributes:
        info: The conditions of the run.
        start: Time of its beginning, s of the simulation.
        end: Time of its end, s.
        robots: The robots, in the order in which they were spawned.
    """

    def __init__(self, file: IO[bytes], info: RecordingInfo) -> None:
        """Read which robots there are; ``open`` finds the file.

        Args:
            file: The file, which is closed by ``close``.
            info: The conditions of the run.

        Raises:
            RecordingError: If it has no index, or nothing in it.
        """
        self.info = info
        self._file = file
        self._reader = SeekingReader(
            file, validate_crcs=True, record_size_limit=LARGEST_RECORD
        )
        summary = None
        with suppress(*BROKEN):
            summary = self._reader.get_summary()
        if summary is None or summary.statistics is None or not summary.chunk_indexes:
            text = "breaks off, expected a whole recording"
            raise RecordingError(self._describe(text))
        self.end = summary.statistics.message_end_time // TICK / 100
        self.robots = _find_robots(self._calls(TO_SERVER, None, None), self.end)
        first = next(self._calls(TO_CLIENT, None, None), None)
        if first is None:
            text = f"nothing was sent in {file.name}, expected a robot at least"
            raise RecordingError(text)
        self.start = seconds(first.tick)

    @classmethod
    def open(cls, folder: Path) -> Self:
        """Open the recording in a folder.

        Raises:
            RecordingError: If there is none, or it cannot be read.
        """
        bag = BagReader(folder)
        try:
            file = bag.path.open("rb")
        except OSError as error:
            raise RecordingError(f"{bag.path}: {describe_os_error(error)}") from error
        try:
            return cls(file, bag.info)
        except BaseException:
            file.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def read(self, second: int) -> list[TimedLine]:
        """Return the lines from a second on up to the next one, in order.

        Raises:
            RecordingError: If the file is damaged there.
        """
        lines: list[TimedLine] = []
        buffers: dict[int, LineBuffer] = {}
        for call in self._calls(TO_CLIENT, second * SECOND, (second + 1) * SECOND):
            robot = self._robot_of(call)
            if robot is None or not call.data:
                continue
            buffer = buffers.setdefault(call.client, LineBuffer())
            for text in buffer.feed(call.data):
                with suppress(MalformedMessage):  # the rest of one that was cut
                    line = WatchedLine(robot.name, text, decode_report(text))
                    lines.append(TimedLine(seconds(call.tick), call.client, line))
        return lines

    def _robot_of(self, call: RunEvent) -> RecordedRobot | None:
        """Return the robot that a client has when it is sent something."""
        time = seconds(call.tick)
        for robot in reversed(self.robots):
            if robot.client == call.client and robot.joined <= time <= robot.left:
                return robot
        return None

    def _calls(
        self, topic: str, start: int | None, end: int | None
    ) -> Iterator[RunEvent]:
        """Yield the calls of a topic from a time on up to another one, ns."""
        found = self._reader.iter_messages(
            [topic], starting_at=start, ending_before=end
        )
        try:
            for schema, _, message in found:
                yield decode_call(schema.name if schema else "", message.data)
        except (*BROKEN, OSError) as error:
            raise RecordingError(self._describe(f"is damaged: {error}")) from error

    def _describe(self, problem: str) -> str:
        folder = Path(self._file.name).parent
        cure = f"'radarsim recording repair {folder}' keeps what can be read"
        return f"{self._file.name} {problem}; {cure}"


def _find_robots(calls: Iterable[RunEvent], end: float) -> list[RecordedRobot]:
    """Find robots by the commands that spawned them."""
    robots: list[RecordedRobot] = []
    current: dict[int, int] = {}  # place of a client's newest robot
    taken: set[str] = set()

    def leave(client: int, time: float) -> None:
        if (place := current.pop(client, None)) is not None:
            robots[place] = robots[place]._replace(left=time)

    for call in calls:
        time = seconds(call.tick)
        if call.type is EventType.DISCONNECT:
            leave(call.client, time)
        elif call.type is EventType.RECEIVE:
            for spawned in map(spawned_robot, call.data.decode("latin-1").splitlines()):
                if spawned is None:
                    continue
                leave(call.client, time)
                wanted, class_name = spawned
                name = _unique(wanted or class_name or UNNAMED, taken)
                current[call.client] = len(robots)
                robots.append(RecordedRobot(call.client, name, class_name, time, end))
    return robots


def _unique(name: str, taken: set[str]) -> str:
    """Return a name that no other robot has, and note it."""
    wanted, count = name, 1
    while name.casefold() in taken:
        count += 1
        name = f"{wanted}_{count}"
    taken.add(name.casefold())
    return name
