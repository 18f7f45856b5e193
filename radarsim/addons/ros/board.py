"""Topics for clients of WebSockets, without I/O: what the protocols have in common.

A board has the topics for all clients. Each protocol is a class of clients, which ask
for topics and send velocity commands.
"""

import json
import struct
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final, TypeAlias

from radarsim.addons.recording.messages import CLOCK, Fields, TopicMessage
from radarsim.addons.ros.bridge import DriveCallback
from radarsim.errors import expected_one_of

Json: TypeAlias = dict[str, Any]  # an object of a client

MOST_WAITING: Final = 20  # messages of a topic for a client; beyond it the oldest go
MOST_ENTRIES: Final = 1000  # subscriptions, or topics, of a client
LONGEST_NAME: Final = 256  # characters
# Thousands of brackets in each other are a RecursionError.
WRONG: Final = (
    *(KeyError, ValueError, TypeError, OverflowError, RecursionError),
    struct.error,
)


class Board:
    """The topics there are.

    Attributes:
        protocol: Class of its clients.
        types: Types of topics, by name.
        drivers: Where velocity commands go, by topic.
        now: Simulated time, in the fields of ROS 2; 0 before ``/clock``.
    """

    def __init__(self, protocol: "type[BoardClient]") -> None:
        """Begin without topics."""
        self.protocol = protocol
        self.types: dict[str, str] = {}
        self.drivers: dict[str, DriveCallback] = {}
        self.now = Fields(sec=0, nanosec=0)
        self._latched: dict[str, TopicMessage] = {}
        self._encoded: dict[str, Any] = {}  # latched messages, once they are wanted

    def add(self, message: TopicMessage, wanted: bool) -> Any:
        """Note a message; return it encoded if somebody wants it."""
        topic = message.topic
        self.types[topic] = message.type
        if topic == CLOCK:
            self.now = message.fields.clock
        if message.latched:
            self._latched[topic] = message
            self._encoded.pop(topic, None)
        # Once for all clients, as arrays of scans take long to write.
        return self.protocol.encode(message) if wanted else None

    def latched(self, topic: str) -> Any:
        """Return the last message of a latched topic, encoded; None without one."""
        if topic in self._latched and topic not in self._encoded:
            self._encoded[topic] = self.protocol.encode(self._latched[topic])
        return self._encoded.get(topic)

    def driver(self, topic: str) -> DriveCallback:
        """Return what follows the velocity commands on a topic.

        Raises:
            ValueError: If nothing does.
        """
        if topic not in self.drivers:
            known = ", ".join(self.drivers) or "none, see --robot"
            raise ValueError(f"{topic[:80]!r}, expected a topic of: {known}")
        return self.drivers[topic]


class BoardClient:
    """One client: its subscriptions, and the messages that wait for it.

    Attributes:
        name: Name of the protocol, for people.
        subprotocols: Names of WebSocket subprotocols; clients ask for one of them.
        waiting: Texts or bytes to send, oldest first.
        handlers: Functions that execute messages of the client, by ``op``.
    """

    name: str
    subprotocols: tuple[str, ...] = ()

    def __init__(self, board: Board) -> None:
        """Begin without subscriptions."""
        self.waiting: deque[Any] = deque()
        self.handlers: Mapping[str, Callable[[Json], object]] = {}
        self._board = board
        # Shortest intervals, s, by topic and by what the client calls a subscription.
        self._subscriptions: dict[str, dict[str | int, float]] = {}

    @staticmethod
    def encode(message: TopicMessage) -> Any:
        """Return a message as clients are sent it."""
        raise NotImplementedError

    @classmethod
    def trusts(cls, origin: str) -> bool:  # noqa: ARG003
        """Return whether a program of this origin may connect, in lower case."""
        return False

    def wants(self, topic: str) -> bool:
        """Return whether it is to be offered the messages of a topic."""
        return topic in self._subscriptions

    def offer(self, topic: str, data: Any, now: float) -> None:
        """Queue a message of a topic that it wants; the oldest go if too many wait.

        Args:
            topic: Name of the topic.
            data: The message as the board has encoded it.
            now: Time of the loop, s.
        """
        raise NotImplementedError

    def announce(self, topic: str) -> None:
        """Queue the news that there is a topic."""

    def receive(self, data: str | bytes) -> None:
        """Execute a message; errors are answered by a status."""
        try:
            self._take(data)
        except WRONG as error:
            reason = f"nothing for {error}" if isinstance(error, KeyError) else error
            self.complain(f"{data[:80]!r} is not understood: {reason}")

    def complain(self, text: str) -> None:
        """Queue a status with an error."""
        raise NotImplementedError

    def _add_subscription(self, topic: str, key: str | int, interval: float) -> Any:
        """Subscribe, and return the last message of a latched topic, encoded."""
        # All that a client can make this keep is limited.
        if sum(map(len, self._subscriptions.values())) >= MOST_ENTRIES:
            raise ValueError(f"expected at most {MOST_ENTRIES} subscriptions")
        self._subscriptions.setdefault(topic, {})[key] = interval
        return self._board.latched(topic)

    def _take(self, data: str | bytes) -> None:
        message = json.loads(data)
        handler = self.handlers.get(message["op"])
        if handler is None:
            raise ValueError(f"op {expected_one_of(message['op'], self.handlers)}")
        handler(message)


def full_name(name: str) -> str:
    """Return the name of a type as ROS 2 has it.

    >>> full_name("std_msgs/Header"), full_name("std_msgs/msg/Header")
    ('std_msgs/msg/Header', 'std_msgs/msg/Header')
    """
    package, _, rest = name.partition("/")
    return name if rest.startswith("msg/") or not rest else f"{package}/msg/{rest}"


def velocity_of(message: object) -> tuple[float, float]:
    """Return forward speed, m/s, and turn rate, rad/s, of a Twist or TwistStamped.

    Raises:
        ValueError: If it is neither.
    """
    try:
        twist: Any = message
        twist = twist.get("twist", twist)
        linear, angular = twist.get("linear", {}), twist.get("angular", {})
        return float(linear.get("x", 0.0)), float(angular.get("z", 0.0))
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(f"{error}, expected a Twist") from error
