"""The common part of the rosbridge and Foxglove protocols, without I/O.

A ``Board`` holds the topics for all clients. Each protocol is a subclass of
``BoardClient``, whose objects subscribe to topics and receive velocity commands.
"""

import json
import struct
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, Final, TypeAlias

from radarsim.addons.recording.messages import CLOCK, Fields, TopicMessage
from radarsim.addons.ros.bridge import DriveCallback
from radarsim.errors import expected_one_of

Json: TypeAlias = dict[str, Any]  # a JSON object from a client

MOST_WAITING: Final = 20  # queued messages per topic; beyond it the oldest are dropped
MOST_ENTRIES: Final = 1000  # subscriptions of a client, or topics that it advertises
LONGEST_NAME: Final = 256  # characters
# Errors of malformed messages; deeply nested JSON raises RecursionError.
WRONG: Final = (
    *(KeyError, ValueError, TypeError, OverflowError, RecursionError),
    struct.error,
)


class Board:
    """All topics that a bridge publishes, and all velocity topics that it serves.

    Attributes:
        protocol: Class of the clients.
        types: Types of topics, by name.
        drivers: Functions that execute velocity commands, by topic.
        now: Simulated time, in the fields of ROS 2; 0 before the first ``/clock``.
    """

    def __init__(self, protocol: "type[BoardClient]") -> None:
        """Create a board that has no topics yet."""
        self.protocol = protocol
        self.types: dict[str, str] = {}
        self.drivers: dict[str, DriveCallback] = {}
        self.now = Fields(sec=0, nanosec=0)
        self._latched: dict[str, TopicMessage] = {}
        self._encoded: dict[str, Any] = {}  # latched messages, encoded on demand

    def add(self, message: TopicMessage, wanted: bool) -> Any:
        """Store a topic's message; return the encoded message if wanted, else None."""
        topic = message.topic
        self.types[topic] = message.type
        if topic == CLOCK:
            self.now = message.fields.clock
        if message.latched:
            self._latched[topic] = message
            self._encoded.pop(topic, None)
        # Encoding the arrays of scans is slow, so a message is encoded once for all
        # clients.
        return self.protocol.encode(message) if wanted else None

    def latched(self, topic: str) -> Any:
        """Return the last message of a latched topic, encoded, or None without one."""
        if topic in self._latched and topic not in self._encoded:
            self._encoded[topic] = self.protocol.encode(self._latched[topic])
        return self._encoded.get(topic)

    def driver(self, topic: str) -> DriveCallback:
        """Return the function that executes the velocity commands on a topic.

        Raises:
            ValueError: If no robot is driven by this topic.
        """
        if topic not in self.drivers:
            known = ", ".join(self.drivers) or "none, see --robot"
            raise ValueError(f"{topic[:80]!r}, expected a robot's topic: {known}")
        return self.drivers[topic]


class BoardClient:
    """A connected ROS client, with its subscriptions and the messages to send.

    Attributes:
        name: Name of the protocol, for display.
        subprotocols: WebSocket subprotocols of the protocol.
        waiting: Texts or bytes to send, oldest first.
        handlers: Functions that execute messages of the client, by ``op``.
    """

    name: str
    subprotocols: tuple[str, ...] = ()

    def __init__(self, board: Board) -> None:
        """Create a client that subscribes to no topic yet."""
        self.waiting: deque[Any] = deque()
        self.handlers: Mapping[str, Callable[[Json], object]] = {}
        self._board = board
        # Shortest time between messages to the client, s, by topic and subscription id.
        self._subscriptions: dict[str, dict[str | int, float]] = {}

    @staticmethod
    def encode(message: TopicMessage) -> Any:
        """Return a message in the encoding of the protocol."""
        raise NotImplementedError

    @classmethod
    def trusts(cls, origin: str) -> bool:  # noqa: ARG003
        """Return whether web pages of an origin, in lower case, may connect."""
        return False

    def wants(self, topic: str) -> bool:
        """Return whether the client subscribes to a topic."""
        return topic in self._subscriptions

    def offer(self, topic: str, data: Any, now: float) -> None:
        """Queue a message of a subscribed topic; drop the oldest if too many wait.

        Args:
            topic: Name of the topic.
            data: The message, encoded by the board.
            now: Time of the event loop, s.
        """
        raise NotImplementedError

    def announce(self, topic: str) -> None:
        """Queue a message that announces a new topic."""

    def receive(self, data: str | bytes) -> None:
        """Execute a message of the client; if it is wrong, queue an error status."""
        try:
            self._take(data)
        except WRONG as error:
            reason = f"no key {error}" if isinstance(error, KeyError) else error
            self.complain(f"{data[:80]!r} is not understood: {reason}")

    def complain(self, text: str) -> None:
        """Queue a status message that reports an error to the client."""
        raise NotImplementedError

    def _add_subscription(self, topic: str, key: str | int, interval: float) -> Any:
        """Subscribe to a topic; return its last message, encoded, if it is latched."""
        # The limit bounds the memory for clients that subscribe without end.
        if sum(map(len, self._subscriptions.values())) >= MOST_ENTRIES:
            raise ValueError(f"too many subscriptions, expected at most {MOST_ENTRIES}")
        self._subscriptions.setdefault(topic, {})[key] = interval
        return self._board.latched(topic)

    def _take(self, data: str | bytes) -> None:
        message = json.loads(data)
        handler = self.handlers.get(message["op"])
        if handler is None:
            raise ValueError(f"op {expected_one_of(message['op'], self.handlers)}")
        handler(message)


def full_name(name: str) -> str:
    """Return the ROS 2 name of a message type, with ``msg`` in the middle.

    >>> full_name("std_msgs/Header"), full_name("std_msgs/msg/Header")
    ('std_msgs/msg/Header', 'std_msgs/msg/Header')
    """
    package, _, rest = name.partition("/")
    return name if rest.startswith("msg/") or not rest else f"{package}/msg/{rest}"


def velocity_of(message: object) -> tuple[float, float]:
    """Return the forward speed, m/s, and turn rate, rad/s, in a Twist or TwistStamped.

    Raises:
        ValueError: If the message is of another type.
    """
    try:
        twist: Any = message
        twist = twist.get("twist", twist)
        linear, angular = twist.get("linear", {}), twist.get("angular", {})
        return float(linear.get("x", 0.0)), float(angular.get("z", 0.0))
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(f"{error}, expected a Twist") from error
