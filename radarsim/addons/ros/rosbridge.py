"""The rosbridge protocol, version 2, for one client of a bridge, without I/O.

ROS messages are encoded in the JSON of rosbridge. The services are the part of rosapi
that roslibpy and roslib call. Source: ROSBRIDGE_PROTOCOL.md of rosbridge_suite.
"""

import base64
import json
import math
from collections.abc import Callable
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

from radarsim.addons.recording.messages import TopicMessage
from radarsim.addons.ros.board import (
    LONGEST_NAME,
    MOST_WAITING,
    Board,
    BoardClient,
    Json,
    full_name,
    velocity_of,
)
from radarsim.addons.ros.bridge import TWIST
from radarsim.errors import MissingPackage, import_optional


def message_json(message: TopicMessage) -> str:
    """Return a ROS message as JSON: bytes as base64, NaN and infinity as null."""

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
                # ``tolist`` is much faster, but works only if all numbers are finite.
                is_whole = value.dtype.kind != "f" or bool(np.isfinite(value).all())
                return value.tolist() if is_whole else plain(value.tolist())
            case _:
                return value

    return json.dumps(plain(message.fields), allow_nan=False)


def _id_of(message: Json) -> str:
    """Return the id of a subscription as JSON text, in which 1 and "1" differ."""
    text = json.dumps(message.get("id"))
    if len(text) > LONGEST_NAME:
        raise ValueError(f"id of {len(text)} characters, expected up to {LONGEST_NAME}")
    return text


def _cdr() -> ModuleType:
    """Return the module with the definitions of message types.

    Raises:
        MissingPackage: If rosbags is not installed.
    """
    import_optional("rosbags.typesys", "record")
    from radarsim.addons.recording import cdr  # noqa: PLC0415 - needs extra

    return cdr


class RosbridgeClient(BoardClient):
    """A connected rosbridge client; see ``BoardClient``."""

    name = "rosbridge"
    encode = staticmethod(message_json)

    def __init__(self, board: Board) -> None:
        super().__init__(board)
        self._last: dict[str, float] = {}  # time of the last message, by topic
        self.handlers = {
            "subscribe": self._subscribe,
            "unsubscribe": self._unsubscribe,
            "publish": self._publish,
            "call_service": self._call,
            # These messages need no action: clients may publish without advertising.
            **dict.fromkeys(("advertise", "unadvertise", "set_level"), lambda _: None),
        }
        # Some clients prefix names of services with a slash, which ``_call`` removes.
        self._services: dict[str, Callable[[Json], Json]] = {
            "rosapi/topics": self._topics,
            "rosapi/topics_and_raw_types": self._topics_and_raw_types,
            "rosapi/topics_for_type": self._topics_for_type,
            "rosapi/topic_type": lambda arguments: {
                "type": self._all_types.get(str(arguments.get("topic")), "")
            },
            "rosapi/message_details": self._message_details,
            "rosapi/nodes": lambda _: {"nodes": ["/radarsim"]},
            "rosapi/services": lambda _: {"services": []},
            "rosapi/get_param_names": lambda _: {"names": []},
            # Versions of rosapi use different names for this service.
            **dict.fromkeys(
                ("rosapi/time", "rosapi/get_time"), lambda _: {"time": self._time}
            ),
        }

    @property
    def _all_types(self) -> dict[str, str]:
        """Message types by topic, including the topics for velocity commands."""
        return dict.fromkeys(self._board.drivers, TWIST) | self._board.types

    @property
    def _time(self) -> Json:
        """The simulated time with field names of ROS 2, and of ROS 1 for roslibpy."""
        sec, nanosec = self._board.now.sec, self._board.now.nanosec
        return {"sec": sec, "nanosec": nanosec, "secs": sec, "nsecs": nanosec}

    def offer(self, topic: str, data: Any, now: float) -> None:
        """Queue a message of a subscribed topic, if the throttle rate permits it."""
        interval = min(self._subscriptions[topic].values())
        if now - self._last.get(topic, -math.inf) < interval:
            return
        self._last[topic] = now
        self._queue(topic, data)

    def _queue(self, topic: str, text: str) -> None:
        self.waiting.append(
            f'{{"op": "publish", "topic": {json.dumps(topic)}, "msg": {text}}}'
        )
        # All topics share one queue, because clients expect messages in order of time.
        while len(self.waiting) > MOST_WAITING * max(1, len(self._subscriptions)):
            self.waiting.popleft()

    def _subscribe(self, message: Json) -> None:
        topic = str(message["topic"])
        if len(topic) > LONGEST_NAME:
            raise ValueError(f"topic {topic[:80]!r}, expected a shorter name")
        # The throttle rate is in ms; some clients send null for 0.
        interval = float(message.get("throttle_rate") or 0) / 1000
        latched = self._add_subscription(topic, _id_of(message), interval)
        if latched:  # the throttle rate does not apply to the first message
            self._queue(topic, latched)

    def _unsubscribe(self, message: Json) -> None:
        topic, own = str(message["topic"]), _id_of(message)
        left = self._subscriptions.get(topic, {})
        left.pop(own, None)
        # A message without an id ends all subscriptions to the topic.
        if own == "null" or not left:
            self._subscriptions.pop(topic, None)

    def _publish(self, message: Json) -> None:
        drive = self._board.driver(str(message["topic"]))
        drive(*velocity_of(message.get("msg")))

    def _call(self, message: Json) -> None:
        service = str(message["service"])
        arguments = message.get("args") or {}
        serve = self._services.get(service.removeprefix("/"))
        answer: Json = {"op": "service_response", "service": service}
        try:
            values = serve and serve(arguments if isinstance(arguments, dict) else {})
            answer |= {"values": values or {}, "result": serve is not None}
        except MissingPackage as error:  # raised by ``_cdr``
            answer |= {"values": str(error), "result": False}
        if "id" in message:
            answer["id"] = message["id"]
        self.waiting.append(json.dumps(answer))

    def _topics(self, _: Json) -> Json:
        types = self._all_types
        return {"topics": list(types), "types": list(types.values())}

    def _topics_and_raw_types(self, arguments: Json) -> Json:
        types = self._all_types.values()
        texts = [_cdr().definition_of(each) for each in types]
        return {**self._topics(arguments), "typedefs_full_text": texts}

    def _topics_for_type(self, arguments: Json) -> Json:
        types, wanted = self._all_types, full_name(str(arguments.get("type")))
        return {"topics": [name for name in types if types[name] == wanted]}

    def _message_details(self, arguments: Json) -> Json:
        wanted = full_name(str(arguments.get("type")))
        return {"typedefs": _cdr().type_definitions(wanted)}

    def complain(self, text: str) -> None:
        """Queue an error status for the client; see ``BoardClient.complain``."""
        self.waiting.append(json.dumps({"op": "status", "level": "error", "msg": text}))
