"""Messages of ROS 2, encoded: each function returns the type of one and its bytes.

Times are simulated seconds, frames are those of REP-103 and REP-105, units SI.

CDR, the encoding of ROS 2 messages: little-endian, aligned to the size of numbers.

Source: OMG, DDS Interoperability Wire Protocol 2.5, section 10; XCDR version 1.
"""

import math
import struct
from collections.abc import Mapping, Sequence
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose3

HEADER: Final = b"\x00\x01\x00\x00"  # little-endian, no options


class CdrWriter:
    """Encodes the fields of one message, one after the other."""

    def __init__(self) -> None:
        self._data = bytearray(HEADER)

    def numbers(self, code: str, *values: float) -> None:
        """Append numbers of one type.

        Args:
            code: Type of the numbers, as of ``struct``: ``B``, ``i``, ``I``, ``f`` or
                ``d``.
            values: The numbers.
        """
        self._align(struct.calcsize(f"<{code}"))
        self._data += struct.pack(f"<{len(values)}{code}", *values)

    def text(self, text: str) -> None:
        """Append a string."""
        data = text.encode() + b"\0"
        self.numbers("I", len(data))
        self._data += data

    def array(self, values: NDArray[Any]) -> None:
        """Append a sequence of unlimited length; ``values`` is little-endian, (N,)."""
        self.numbers("I", len(values))
        if len(values):
            self._align(values.itemsize)
            self._data += values.tobytes()

    def octets(self, data: bytes) -> None:
        """Append a sequence of bytes."""
        self.numbers("I", len(data))
        self._data += data

    def to_bytes(self) -> bytes:
        """Return the encoded message."""
        return bytes(self._data)

    def _align(self, size: int) -> None:
        """Fill up to a multiple of a size, counted from the end of the header."""
        self._data += bytes(-(len(self._data) - len(HEADER)) % size)


NANOSECONDS: Final = 1_000_000_000
UNKNOWN_COVARIANCE: Final = np.zeros(36)
# Types of ``sensor_msgs/msg/PointField`` by those of numpy.
_POINT_TYPES: Final = {"<f4": 7, "<u2": 4}
ECHO: Final = np.dtype(
    [
        ("x", "<f4"),
        ("y", "<f4"),
        ("z", "<f4"),
        ("intensity", "<f4"),
        ("power", "<f4"),
        ("beam", "<u2"),
        ("kind", "<u2"),
        ("object", "<u2"),
        ("material", "<u2"),
    ]
)
TARGET: Final = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("dbm", "<f4"), ("beam", "<u2")]
)

Points: TypeAlias = NDArray[np.void]


class RosMessage(NamedTuple):
    """An encoded message.

    Attributes:
        type: Name of the type, such as ``sensor_msgs/msg/LaserScan``.
        data: The message in CDR.
    """

    type: str
    data: bytes


class TopicMessage(NamedTuple):
    """A message for a topic.

    Attributes:
        topic: Name of the topic.
        message: The message.
        latched: Whether who subscribes later gets the last one.
    """

    topic: str
    message: RosMessage
    latched: bool = False


class Transform(NamedTuple):
    """Where a frame is in another one.

    Attributes:
        time: Simulated time, s.
        parent: Name of the outer frame.
        child: Name of the inner frame.
        pose: Pose of the inner frame in the outer one.
    """

    time: float
    parent: str
    child: str
    pose: Pose3


class Beams(NamedTuple):
    """The beams of a scan.

    Attributes:
        fov: Angle between the first beam and the last, rad.
        resolution: Angle between neighbouring beams, rad.
        min_range: Shortest range, m.
        max_range: Longest range, m.
        ranges: (N,) m, counter-clockwise from the right; a range of at least
            ``max_range`` is a beam without return, which becomes ``inf``.
    """

    fov: float
    resolution: float
    min_range: float
    max_range: float
    ranges: Floats


def laser_scan(time: float, frame: str, beams: Beams) -> RosMessage:
    """Encode a scan."""
    message = CdrWriter()
    _put_header(message, time, frame)
    first = -beams.fov / 2
    last = first + beams.resolution * (len(beams.ranges) - 1)
    message.numbers("f", first, last, beams.resolution, 0.0, 0.0)
    message.numbers("f", beams.min_range, beams.max_range)
    missed = beams.ranges >= beams.max_range
    message.array(np.where(missed, np.inf, beams.ranges).astype("<f4"))
    message.array(np.zeros(0, "<f4"))  # no intensities
    return RosMessage("sensor_msgs/msg/LaserScan", message.to_bytes())


def point_cloud(time: float, frame: str, points: Points) -> RosMessage:
    """Encode echoes or targets, rows of ``ECHO`` or ``TARGET``."""
    message = CdrWriter()
    _put_header(message, time, frame)
    message.numbers("I", 1, len(points))
    fields: Any = points.dtype.fields
    message.numbers("I", len(fields))
    for name, (dtype, offset, *_) in fields.items():
        message.text(name)
        message.numbers("I", offset)
        message.numbers("B", _POINT_TYPES[dtype.str])
        message.numbers("I", 1)
    message.numbers("B", 0)  # little-endian
    message.numbers("I", points.itemsize, points.nbytes)
    message.octets(points.tobytes())
    message.numbers("B", 1)  # all points are valid
    return RosMessage("sensor_msgs/msg/PointCloud2", message.to_bytes())


def grey_image(time: float, frame: str, pixels: NDArray[np.uint8]) -> RosMessage:
    """Encode a grey picture, (H, W)."""
    message = CdrWriter()
    _put_header(message, time, frame)
    height, width = pixels.shape
    message.numbers("I", height, width)
    message.text("mono8")
    message.numbers("B", 0)  # little-endian
    message.numbers("I", width)  # bytes of a row
    message.octets(pixels.tobytes())
    return RosMessage("sensor_msgs/msg/Image", message.to_bytes())


def odometry(time: float, frame: str, child: str, pose: Pose3) -> RosMessage:
    """Encode a pose by odometry; velocities and covariances are not known."""
    message = CdrWriter()
    _put_header(message, time, frame)
    message.text(child)
    message.numbers("d", *_position_and_quaternion(pose), *UNKNOWN_COVARIANCE)
    message.numbers("d", *np.zeros(6), *UNKNOWN_COVARIANCE)
    return RosMessage("nav_msgs/msg/Odometry", message.to_bytes())


def pose_stamped(time: float, frame: str, pose: Pose3) -> RosMessage:
    """Encode a pose in a frame."""
    message = CdrWriter()
    _put_header(message, time, frame)
    message.numbers("d", *_position_and_quaternion(pose))
    return RosMessage("geometry_msgs/msg/PoseStamped", message.to_bytes())


def twist_stamped(time: float, frame: str, speed: float, turn: float) -> RosMessage:
    """Encode a forward speed, m/s, and a counter-clockwise turn rate, rad/s."""
    message = CdrWriter()
    _put_header(message, time, frame)
    message.numbers("d", speed, 0.0, 0.0, 0.0, 0.0, turn)
    return RosMessage("geometry_msgs/msg/TwistStamped", message.to_bytes())


def transforms(each: Sequence[Transform]) -> RosMessage:
    """Encode where frames are."""
    message = CdrWriter()
    message.numbers("I", len(each))
    for time, parent, child, pose in each:
        _put_header(message, time, parent)
        message.text(child)
        message.numbers("d", *_position_and_quaternion(pose))
    return RosMessage("tf2_msgs/msg/TFMessage", message.to_bytes())


def occupancy_grid(
    time: float, frame: str, cells: NDArray[np.int8], corner: Pose3, resolution: float
) -> RosMessage:
    """Encode a map.

    Args:
        time: Simulated time, s.
        frame: Name of the frame.
        cells: (R, C) -1 unknown, 0 free to 100 occupied; the first row is the
            southernmost.
        corner: South-west corner of the map, m.
        resolution: Side of a cell, m.
    """
    message = CdrWriter()
    _put_header(message, time, frame)
    message.numbers("I", *_stamp(time))
    message.numbers("f", resolution)
    rows, columns = cells.shape
    message.numbers("I", columns, rows)
    message.numbers("d", *_position_and_quaternion(corner))
    message.array(cells.ravel())
    return RosMessage("nav_msgs/msg/OccupancyGrid", message.to_bytes())


def clock(time: float) -> RosMessage:
    """Encode simulated time."""
    message = CdrWriter()
    message.numbers("I", *_stamp(time))
    return RosMessage("rosgraph_msgs/msg/Clock", message.to_bytes())


def string(text: str) -> RosMessage:
    """Encode a text."""
    message = CdrWriter()
    message.text(text)
    return RosMessage("std_msgs/msg/String", message.to_bytes())


def octets(label: str, data: bytes) -> RosMessage:
    """Encode bytes, with a label on their only dimension."""
    message = CdrWriter()
    message.numbers("I", 1)
    message.text(label)
    message.numbers("I", len(data), len(data))  # size and stride of the dimension
    message.numbers("I", 0)  # offset
    message.octets(data)
    return RosMessage("std_msgs/msg/UInt8MultiArray", message.to_bytes())


def read_octets(data: bytes) -> tuple[str, bytes]:
    """Return label and bytes of a message of ``octets``.

    Raises:
        ValueError: If it is no such message.
    """
    try:
        (length,) = struct.unpack_from("<I", data, 8)
        label = data[12 : 11 + length].decode()
        at = 12 + length + -length % 4 + 12
        (count,) = struct.unpack_from("<I", data, at)
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(f"{len(data)} bytes, expected labelled bytes") from error
    found = data[at + 4 : at + 4 + count]
    if len(found) != count:
        raise ValueError(f"{len(found)} bytes, expected {count}")
    return label, found


def make_points(
    dtype: np.dtype[np.void],
    angles: Floats,
    ranges: Floats,
    columns: Mapping[str, NDArray[Any]],
) -> Points:
    """Return rows of a type in the frame of a scanner.

    Args:
        dtype: ``ECHO`` or ``TARGET``.
        angles: (P,) rad, of the beam of each point.
        ranges: (P,) m.
        columns: The other columns by name, (P,) each.
    """
    points = np.zeros(len(ranges), dtype)
    points["x"], points["y"] = ranges * np.cos(angles), ranges * np.sin(angles)
    for name, column in columns.items():
        points[name] = column
    return points


def _put_header(message: CdrWriter, time: float, frame: str) -> None:
    message.numbers("I", *_stamp(time))
    message.text(frame)


def _stamp(time: float) -> tuple[int, int]:
    """Return whole seconds, and nanoseconds; 0 for a time that is not known."""
    total = round(time * NANOSECONDS) if math.isfinite(time) and time > 0 else 0
    return divmod(total, NANOSECONDS)


def _position_and_quaternion(pose: Pose3) -> tuple[float, ...]:
    """Return x, y, z, m, and the rotation as x, y, z, w of a unit quaternion."""
    cr, sr = math.cos(pose.roll / 2), math.sin(pose.roll / 2)
    cp, sp = math.cos(pose.pitch / 2), math.sin(pose.pitch / 2)
    cy, sy = math.cos(pose.yaw / 2), math.sin(pose.yaw / 2)
    return (
        *(pose.x, pose.y, pose.z),
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
        cr * cp * cy + sr * sp * sy,
    )
