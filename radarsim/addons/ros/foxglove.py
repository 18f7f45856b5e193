"""The Foxglove WebSocket protocol, version 1, for a client of a bridge, without I/O.

ROS 2 messages are encoded in CDR, as in recordings. A client may drive the robot of the
bridge. Source: the ws-protocol specification of Foxglove. The package of Foxglove is
not used, as it accepts pages of any site.
"""

import json
import struct
from typing import Any, Final

from radarsim.addons.recording.cdr import (
    Twist,
    TwistStamped,
    decode,
    definition_of,
    encode,
)
from radarsim.addons.recording.messages import CLOCK, NANOSECONDS
from radarsim.addons.ros.board import (
    LONGEST_NAME,
    MOST_ENTRIES,
    MOST_WAITING,
    Board,
    BoardClient,
    Json,
    full_name,
    velocity_of,
)

APP: Final = "https://app.foxglove.dev"
MESSAGE, TIME = 1, 2  # first bytes of binary messages
_MESSAGE_HEAD: Final = struct.Struct("<BIQ")
_TIME: Final = struct.Struct("<BQ")
_CLIENT_HEAD: Final = struct.Struct("<BI")
_INFO: Final = {
    "op": "serverInfo",
    "name": "radarsim",
    "capabilities": ["clientPublish", "time"],
    "supportedEncodings": ["cdr", "json"],
    # Clients publish ROS messages only if the server names the ROS distribution.
    "metadata": {"ROS_DISTRO": "jazzy"},
}


class FoxgloveClient(BoardClient):
    """A connected Foxglove client; see ``BoardClient``."""

    name = "Foxglove"
    subprotocols = ("foxglove.sdk.v1", "foxglove.websocket.v1")
    encode = staticmethod(encode)

    def __init__(self, board: Board) -> None:
        super().__init__(board)
        self.waiting.append(json.dumps(_INFO))
        # Topic, encoding and message type of each channel that the client advertises.
        self._own: dict[int, tuple[str, str, str]] = {}
        self.handlers = {
            "subscribe": self._subscribe,
            "unsubscribe": self._unsubscribe,
            "advertise": self._advertise,
            "unadvertise": self._unadvertise,
        }
        self._announce(list(board.types))

    @classmethod
    def trusts(cls, origin: str) -> bool:
        """Return whether an origin is the Foxglove site or a desktop program.

        Pages of other sites have origins with http or https, or the origin "null".
        """
        scheme, has_scheme, _ = origin.partition("://")
        return origin == APP or bool(has_scheme and scheme not in ("http", "https"))

    @property
    def _time(self) -> int:
        """The simulated time, ns."""
        now: int = self._board.now.sec * NANOSECONDS + self._board.now.nanosec
        return now

    def wants(self, topic: str) -> bool:
        """Return whether a topic is the clock or subscribed to by the client."""
        return topic == CLOCK or bool(self._subscriptions.get(topic))

    def offer(self, topic: str, data: Any, now: float) -> None:  # noqa: ARG002
        """Queue a message of a subscribed topic; see ``BoardClient.offer``."""
        if topic == CLOCK:
            self._queue(_TIME.pack(TIME, self._time))
        for number in self._subscriptions.get(topic, ()):
            self._queue(_MESSAGE_HEAD.pack(MESSAGE, number, self._time) + data)

    def announce(self, topic: str) -> None:
        """Queue a message that announces a new topic; see ``BoardClient.announce``."""
        self._announce([topic])

    def complain(self, text: str) -> None:
        """Queue an error status for the client; see ``BoardClient.complain``."""
        status = {"op": "status", "level": 2, "message": text}
        self.waiting.append(json.dumps(status))

    def _take(self, data: str | bytes) -> None:
        if isinstance(data, bytes):
            self._take_message(data)
        else:
            super()._take(data)

    def _announce(self, topics: list[str]) -> None:
        types = self._board.types
        # The id of a channel is the position of its topic in ``types``, counted from 1.
        channels = [
            {
                "id": 1 + list(types).index(topic),
                "topic": topic,
                "encoding": "cdr",
                "schemaName": types[topic],
                "schemaEncoding": "ros2msg",
                "schema": definition_of(types[topic]),
            }
            for topic in topics
        ]
        self.waiting.append(json.dumps({"op": "advertise", "channels": channels}))

    def _queue(self, data: bytes) -> None:
        """Queue binary data. If too much data waits, drop the oldest, but no texts."""
        self.waiting.append(data)
        if len(self.waiting) > MOST_WAITING * (1 + len(self._subscriptions)):
            oldest = next(
                i for i, each in enumerate(self.waiting) if isinstance(each, bytes)
            )
            del self.waiting[oldest]

    def _subscribe(self, message: Json) -> None:
        topics = list(self._board.types)
        for each in message["subscriptions"]:
            number, channel = int(each["id"]), int(each["channelId"])
            if not 0 < channel <= len(topics):
                raise ValueError(f"channel {channel}, expected 1 to {len(topics)}")
            head = _MESSAGE_HEAD.pack(MESSAGE, number, self._time)
            latched = self._add_subscription(topics[channel - 1], number, 0.0)
            if latched:
                self._queue(head + latched)

    def _unsubscribe(self, message: Json) -> None:
        gone = {int(each) for each in message["subscriptionIds"]}
        for topic, numbers in self._subscriptions.items():
            self._subscriptions[topic] = {n: 0.0 for n in numbers if n not in gone}

    def _advertise(self, message: Json) -> None:
        # Topics that drive no robot are accepted, because Foxglove panels advertise all
        # topics that they may publish.
        for each in message["channels"]:
            if len(self._own) >= MOST_ENTRIES:
                raise ValueError(f"too many topics, expected at most {MOST_ENTRIES}")
            number, topic = int(each["id"]), str(each["topic"])[:LONGEST_NAME]
            type_ = full_name(str(each["schemaName"])[:LONGEST_NAME])
            self._own[number] = topic, str(each["encoding"])[:LONGEST_NAME], type_

    def _unadvertise(self, message: Json) -> None:
        for each in message["channelIds"]:
            self._own.pop(int(each), None)

    def _take_message(self, data: bytes) -> None:
        """Execute a velocity command in a binary message of the client."""
        operation, number = _CLIENT_HEAD.unpack_from(data)
        if operation != MESSAGE:
            raise ValueError(f"operation {operation}, expected {MESSAGE}")
        topic, code, type_ = self._own[number]
        drive = self._board.driver(topic)
        content = data[_CLIENT_HEAD.size :]
        if code == "json":
            velocity = velocity_of(json.loads(content))
        else:
            if type_ == TwistStamped.__msgtype__:
                twist = decode(type_, content, TwistStamped).twist
            else:
                twist = decode(type_, content, Twist)
            velocity = twist.linear.x, twist.angular.z
        drive(*velocity)
