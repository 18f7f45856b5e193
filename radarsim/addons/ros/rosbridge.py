"""The protocol of rosbridge, version 2: one client of a bridge, without I/O.

Source: ROSBRIDGE_PROTOCOL.md of rosbridge_suite; of the services those of rosapi that
roslibpy and roslib call. Messages of ROS are JSON as rosbridge writes it.
"""

import base64
import json
import math
from collections import deque
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, Final, TypeAlias

import numpy as np

from radarsim.addons.recording.call_converter import CLOCK
from radarsim.addons.recording.messages import RosMessage, TopicMessage
from radarsim.addons.ros.bridge import TWIST, DriveCallback
from radarsim.addons.ros.message_types import (
    full_name,
    full_text,
    type_definition,
    types_within,
)

Json: TypeAlias = dict[str, Any]  # an object of a client


def message_json(message: RosMessage) -> str:
    """Return a message as JSON; octets are in base64, and what is no number is null."""

    def plain(value: object) -> object:
        match value:
            case SimpleNamespace():
                return {key: plain(each) for key, each in vars(value).items()}
            case list():
                return [plain(each) for each in value]
            case float():
                return value if math.isfinite(value) else None
            case np.ndarray() if value.dtype == np.uint8:
                return base64.b64encode(value.tobytes()).decode()
            case np.ndarray():
                # Whole arrays at once, which is much faster, unless some is no number.
                is_whole = value.dtype.kind != "f" or bool(np.isfinite(value).all())
                return value.tolist() if is_whole else plain(value.tolist())
            case _:
                return value

    return json.dumps(plain(message.fields), allow_nan=False)


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


def _id_of(message: Json) -> str:
    """Return the id of a subscription as JSON, which keeps 1 and "1" apart."""
    text = json.dumps(message.get("id"))
    if len(text) > LONGEST_NAME:
        raise ValueError(f"an id of {len(text)} characters, expected {LONGEST_NAME}")
    return text


MOST_WAITING: Final = 20  # messages of a topic for a client; beyond it the oldest go
MOST_SUBSCRIPTIONS: Final = 1000
LONGEST_NAME: Final = 256  # characters


class TopicBoard:
    """The topics there are, for all clients.

    Attributes:
        types: Types of topics, by name; also of those that are only listened to.
        drivers: Where velocity commands go, by topic.
        time: Simulated time, in the fields of ROS 2 and ROS 1; 0 before ``/clock``.
    """

    name = "rosbridge"
    subprotocols: tuple[str, ...] = ()

    def __init__(self) -> None:
        self.types: dict[str, str] = {}
        self.drivers: dict[str, DriveCallback] = {}
        self.time: object = dict.fromkeys(("sec", "nanosec", "secs", "nsecs"), 0)
        self._latched: dict[str, RosMessage] = {}
        self._texts: dict[str, str] = {}  # of latched messages, once they are wanted

    def add(self, message: TopicMessage, wanted: bool) -> str:
        """Note a message; return its JSON, empty if nobody wants it."""
        self.types[message.topic] = message.message.type
        if message.topic == CLOCK:
            now = vars(message.message.fields.clock)
            # roslibpy reads the names of ROS 1.
            self.time = {**now, "secs": now["sec"], "nsecs": now["nanosec"]}
        if message.latched:
            self._latched[message.topic] = message.message
            self._texts.pop(message.topic, None)
        # Once for all clients, as arrays of scans take long to write.
        return message_json(message.message) if wanted else ""

    def latched(self, topic: str) -> str:
        """Return the last message of a latched topic; empty if there is none."""
        if topic in self._latched and topic not in self._texts:
            self._texts[topic] = message_json(self._latched[topic])
        return self._texts.get(topic, "")

    def listen(self, topic: str, take: DriveCallback) -> None:
        """Pass the velocity commands on a topic to a function."""
        self.types[topic] = TWIST
        self.drivers[topic] = take

    def new_client(self) -> "RosbridgeClient":
        """Return a new client."""
        return RosbridgeClient(self)

    def trusts(self, _: str) -> bool:
        """Return whether a program of an origin may connect: none beside its own."""
        return False


class RosbridgeClient:
    """One client: what it wants, and what waits for it.

    Attributes:
        waiting: Texts that are to be sent, oldest first.
    """

    def __init__(self, board: TopicBoard) -> None:
        self.waiting: deque[Any] = deque()
        self._board = board
        # Shortest intervals, s, by topic and id; "null" without an id.
        self._subscriptions: dict[str, dict[str, float]] = {}
        self._last: dict[str, float] = {}  # times of messages, by topic
        self._handlers: dict[str, Callable[[Json], object]] = {
            "subscribe": self._subscribe,
            "unsubscribe": self._unsubscribe,
            "publish": self._publish,
            "call_service": self._call,
            # Topics need no announcement here.
            **dict.fromkeys(("advertise", "unadvertise", "set_level"), lambda _: None),
        }

        # Some clients put a slash in front.
        self._services: dict[str, Callable[[Json], Json]] = {
            "rosapi/topics": self._topics,
            "rosapi/topics_and_raw_types": self._topics_and_raw_types,
            "rosapi/topics_for_type": self._topics_for_type,
            "rosapi/topic_type": lambda arguments: {
                "type": board.types.get(str(arguments.get("topic")), "")
            },
            "rosapi/message_details": self._message_details,
            "rosapi/nodes": lambda _: {"nodes": ["/radarsim"]},
            "rosapi/services": lambda _: {"services": []},
            "rosapi/get_param_names": lambda _: {"names": []},
            # By two names, as in the versions of rosapi.
            **dict.fromkeys(
                ("rosapi/time", "rosapi/get_time"), lambda _: {"time": board.time}
            ),
        }

    def wants(self, topic: str) -> bool:
        """Return whether it has subscribed to a topic."""
        return topic in self._subscriptions

    def offer(self, topic: str, text: str, now: float) -> None:
        """Queue a message of a topic that it wants; the oldest go if too many wait.

        Args:
            topic: Name of the topic.
            text: The message as JSON.
            now: Time of the loop, s.
        """
        interval = min(self._subscriptions[topic].values())
        if now - self._last.get(topic, -math.inf) < interval:
            return
        self._last[topic] = now
        self._queue(topic, text)

    def _queue(self, topic: str, text: str) -> None:
        self.waiting.append(
            f'{{"op": "publish", "topic": {json.dumps(topic)}, "msg": {text}}}'
        )
        # All topics share a queue, as clients expect messages in the order of time.
        while len(self.waiting) > MOST_WAITING * max(1, len(self._subscriptions)):
            self.waiting.popleft()

    def announce(self, topic: str) -> None:
        """Do nothing: clients ask which topics there are."""

    def receive(self, text: str | bytes) -> None:
        """Do what a message asks for; what is wrong is answered with a status."""
        try:
            message = json.loads(text)
            operation = message["op"]
            handler = self._handlers[operation]
        # Thousands of brackets in each other are a RecursionError.
        except (ValueError, RecursionError):
            self._complain(f"{text[:80]!r}, expected JSON")
        except (KeyError, TypeError):
            self._complain(f"{text[:80]!r}, expected op: {', '.join(self._handlers)}")
        else:
            try:
                handler(message)
            except KeyError as error:
                self._complain(f"{operation}: nothing for {error}, expected a value")
            except (ValueError, TypeError, OverflowError) as error:
                self._complain(f"{operation}: {error}")

    def _subscribe(self, message: Json) -> None:
        topic = str(message["topic"])
        if len(topic) > LONGEST_NAME:
            raise ValueError(f"a topic of {len(topic)} characters, expected a name")
        # In ms, as the protocol has it; clients send null for none.
        interval = float(message.get("throttle_rate") or 0) / 1000
        # All that a client can make this keep is limited.
        if sum(map(len, self._subscriptions.values())) >= MOST_SUBSCRIPTIONS:
            raise ValueError(f"expected at most {MOST_SUBSCRIPTIONS} subscriptions")
        self._subscriptions.setdefault(topic, {})[_id_of(message)] = interval
        latched = self._board.latched(topic)
        if latched:  # whatever the throttle rate: there may be no other for long
            self._queue(topic, latched)

    def _unsubscribe(self, message: Json) -> None:
        topic, own = str(message["topic"]), _id_of(message)
        left = self._subscriptions.get(topic, {})
        left.pop(own, None)
        # Without an id all subscriptions of the topic end.
        if own == "null" or not left:
            self._subscriptions.pop(topic, None)

    def _publish(self, message: Json) -> None:
        topic = str(message["topic"])
        drive = self._board.drivers.get(topic)
        if drive is None:
            known = ", ".join(self._board.drivers) or "none, see --robot"
            raise ValueError(f"{topic[:80]!r}, expected a topic of: {known}")
        drive(*velocity_of(message.get("msg")))

    def _call(self, message: Json) -> None:
        service = str(message["service"])
        arguments = message.get("args") or {}
        serve = self._services.get(service.removeprefix("/"))
        values = serve and serve(arguments if isinstance(arguments, dict) else {})
        answer = {
            "op": "service_response",
            "service": service,
            "values": values or {},
            "result": serve is not None,
        }
        if "id" in message:
            answer["id"] = message["id"]
        self.waiting.append(json.dumps(answer))

    def _topics(self, _: Json) -> Json:
        types = self._board.types
        return {"topics": list(types), "types": list(types.values())}

    def _topics_and_raw_types(self, arguments: Json) -> Json:
        texts = [full_text(each) for each in self._board.types.values()]
        return {**self._topics(arguments), "typedefs_full_text": texts}

    def _topics_for_type(self, arguments: Json) -> Json:
        types, wanted = self._board.types, full_name(str(arguments.get("type")))
        return {"topics": [name for name in types if types[name] == wanted]}

    def _message_details(self, arguments: Json) -> Json:
        wanted = types_within(full_name(str(arguments.get("type"))))
        return {"typedefs": [type_definition(each) for each in wanted]}

    def _complain(self, text: str) -> None:
        self.waiting.append(json.dumps({"op": "status", "level": "error", "msg": text}))
