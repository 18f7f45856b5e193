"""From what a watcher of robots is sent to topics of ROS 2."""

from collections.abc import Callable, Iterable
from typing import Final, TypeAlias

from radarsim.addons.recording.call_converter import TO_CLIENT, TO_SERVER, CallConverter
from radarsim.addons.recording.host_recorder import RunEvent
from radarsim.addons.recording.messages import TopicMessage
from radarsim.addons.recording.wire_recorder import WireRecorder
from radarsim.client import session as questions
from radarsim.protocol.dialect import COMPAT, DriveUnit
from radarsim.protocol.line_template import printable_name
from radarsim.protocol.reports import Report, RobotJoined, RobotLeft, WatchedLine

DESCRIBED: Final = ("Robot", "RangeScanner")
TWIST: Final = "geometry_msgs/msg/Twist"  # of ``cmd_vel``
WIRE: Final = frozenset({TO_CLIENT, TO_SERVER})

# Called with a forward speed, m/s, and a turn rate, rad/s.
DriveCallback: TypeAlias = Callable[[float, float], None]


class LiveTopics:
    """The topics of all robots of a server, the same as those of a recording."""

    def __init__(
        self, publish: Callable[[TopicMessage], None], drive_unit: DriveUnit
    ) -> None:
        """Begin with no robots.

        Args:
            publish: Called with each message.
            drive_unit: Unit of the commands to drive.
        """
        self._publish = publish
        self._converter = CallConverter(COMPAT, drive_unit)
        self._wire = WireRecorder(self._convert)
        self._numbers: dict[str, int] = {}  # of robots, by their names
        self._last_number = 0

    def take(self, reports: Iterable[Report]) -> bytes:
        """Publish what reports of a watcher tell; return what is to be asked."""
        asked = []
        for report in reports:
            match report:
                case RobotJoined(robot=robot):
                    asked += self._join(robot)
                case RobotLeft(robot=robot):
                    self._leave(robot)
                case WatchedLine(robot=robot, line=line):
                    if robot not in self._numbers:  # not every news has come
                        asked += self._join(robot)
                    data = f"{line}\r\n".encode("latin-1", "replace")
                    self._wire.received(self._numbers[robot], data)
                case _:
                    pass
        return b"".join(asked)

    def _join(self, robot: str) -> list[bytes]:
        self._leave(robot)  # one of the same name, whose leaving was not told
        self._last_number += 1
        self._numbers[robot] = self._last_number
        self._wire.begin(self._last_number, robot)
        name = printable_name(robot)
        return [
            ask(kind, robot=name).data
            for ask in (questions.geometry, questions.configuration)
            for kind in DESCRIBED
        ]

    def _leave(self, robot: str) -> None:
        number = self._numbers.pop(robot, None)
        if number is not None:
            self._wire.end_one(number)

    def _convert(self, event: RunEvent) -> None:
        for _, message in self._converter.convert(event):
            # The bytes of the wire are for recordings: nobody else can repeat a run.
            if message.topic not in WIRE:
                self._publish(message)
