"""Messages of ROS as JSON, as rosbridge has them."""

import base64
import json
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarsim.recording.message_types import decode
from radarsim.recording.messages import RosMessage


def message_json(message: RosMessage) -> str:
    """Return a message as JSON; octets are in base64, and what is no number is null.

    Raises:
        ValueError: If the message is not of a known type.
    """
    return json.dumps(_plain(decode(message)), allow_nan=False)


def _plain(value: Any) -> Any:
    """Return a value of types that JSON has."""
    match value:
        case dict():
            return {key: _plain(each) for key, each in value.items()}
        case list():
            return [_plain(each) for each in value]
        case float():
            return value if math.isfinite(value) else None
        case np.ndarray():
            return _plain_array(value)
        case _:
            return value


def _plain_array(array: NDArray[Any]) -> Any:
    if array.dtype == np.uint8:
        return base64.b64encode(array.tobytes()).decode()
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        return [each if math.isfinite(each) else None for each in array.tolist()]
    return array.tolist()


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
