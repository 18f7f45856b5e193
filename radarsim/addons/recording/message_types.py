"""The fields of the types of messages, and how to read encoded messages by them.

Source: the packages ``common_interfaces``, ``rcl_interfaces`` and ``geometry2`` of
ROS 2 Jazzy, whose definitions these are.
"""

import struct
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

import numpy as np

from radarsim.addons.recording.messages import HEADER, RosMessage

_DEFINITIONS: Final = {
    "builtin_interfaces/msg/Time": "int32 sec, uint32 nanosec",
    "geometry_msgs/msg/Point": "float64 x, float64 y, float64 z",
    "geometry_msgs/msg/Pose": "geometry_msgs/msg/Point position,"
    " geometry_msgs/msg/Quaternion orientation",
    "geometry_msgs/msg/PoseStamped": "std_msgs/msg/Header header,"
    " geometry_msgs/msg/Pose pose",
    "geometry_msgs/msg/PoseWithCovariance": "geometry_msgs/msg/Pose pose,"
    " float64[36] covariance",
    "geometry_msgs/msg/Quaternion": "float64 x, float64 y, float64 z, float64 w",
    "geometry_msgs/msg/Transform": "geometry_msgs/msg/Vector3 translation,"
    " geometry_msgs/msg/Quaternion rotation",
    "geometry_msgs/msg/TransformStamped": "std_msgs/msg/Header header,"
    " string child_frame_id, geometry_msgs/msg/Transform transform",
    "geometry_msgs/msg/Twist": "geometry_msgs/msg/Vector3 linear,"
    " geometry_msgs/msg/Vector3 angular",
    "geometry_msgs/msg/TwistStamped": "std_msgs/msg/Header header,"
    " geometry_msgs/msg/Twist twist",
    "geometry_msgs/msg/TwistWithCovariance": "geometry_msgs/msg/Twist twist,"
    " float64[36] covariance",
    "geometry_msgs/msg/Vector3": "float64 x, float64 y, float64 z",
    "nav_msgs/msg/MapMetaData": "builtin_interfaces/msg/Time map_load_time,"
    " float32 resolution, uint32 width, uint32 height, geometry_msgs/msg/Pose origin",
    "nav_msgs/msg/OccupancyGrid": "std_msgs/msg/Header header,"
    " nav_msgs/msg/MapMetaData info, int8[] data",
    "nav_msgs/msg/Odometry": "std_msgs/msg/Header header, string child_frame_id,"
    " geometry_msgs/msg/PoseWithCovariance pose,"
    " geometry_msgs/msg/TwistWithCovariance twist",
    "rosgraph_msgs/msg/Clock": "builtin_interfaces/msg/Time clock",
    "sensor_msgs/msg/Image": "std_msgs/msg/Header header, uint32 height, uint32 width,"
    " string encoding, uint8 is_bigendian, uint32 step, uint8[] data",
    "sensor_msgs/msg/LaserScan": "std_msgs/msg/Header header, float32 angle_min,"
    " float32 angle_max, float32 angle_increment, float32 time_increment,"
    " float32 scan_time, float32 range_min, float32 range_max, float32[] ranges,"
    " float32[] intensities",
    "sensor_msgs/msg/PointCloud2": "std_msgs/msg/Header header, uint32 height,"
    " uint32 width, sensor_msgs/msg/PointField[] fields, bool is_bigendian,"
    " uint32 point_step, uint32 row_step, uint8[] data, bool is_dense",
    "sensor_msgs/msg/PointField": "string name, uint32 offset, uint8 datatype,"
    " uint32 count",
    "std_msgs/msg/Header": "builtin_interfaces/msg/Time stamp, string frame_id",
    "std_msgs/msg/MultiArrayDimension": "string label, uint32 size, uint32 stride",
    "std_msgs/msg/MultiArrayLayout": "std_msgs/msg/MultiArrayDimension[] dim,"
    " uint32 data_offset",
    "std_msgs/msg/String": "string data",
    "std_msgs/msg/UInt8MultiArray": "std_msgs/msg/MultiArrayLayout layout,"
    " uint8[] data",
    "tf2_msgs/msg/TFMessage": "geometry_msgs/msg/TransformStamped[] transforms",
}
TYPES: Final = frozenset(_DEFINITIONS)
# How single numbers and arrays of them are read, by types of ROS.
NUMBERS: Final = {
    "bool": (struct.Struct("<?"), np.dtype("?")),
    "int8": (struct.Struct("<b"), np.dtype("i1")),
    "uint8": (struct.Struct("<B"), np.dtype("u1")),
    "int32": (struct.Struct("<i"), np.dtype("<i4")),
    "uint32": (struct.Struct("<I"), np.dtype("<u4")),
    "float32": (struct.Struct("<f"), np.dtype("<f4")),
    "float64": (struct.Struct("<d"), np.dtype("<f8")),
}
_COUNT: Final = NUMBERS["uint32"][0]


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a type.

    Attributes:
        name: Name of the field.
        type: Name of a type, ``string``, or a key of ``NUMBERS``.
        length: Number of its elements; 0 if each message has its own, None for a
            field that is no array.
    """

    name: str
    type: str
    length: int | None = None


@cache
def fields_of(type_: str) -> tuple[Field, ...]:
    """Return the fields of a type of ``TYPES``, in order."""
    return tuple(map(_read_field, _DEFINITIONS[type_].split(", ")))


def _read_field(text: str) -> Field:
    type_, name = text.split(" ")
    element, bracket, rest = type_.partition("[")
    return Field(name, element, int(rest[:-1] or 0) if bracket else None)


def decode(message: RosMessage) -> dict[str, Any]:
    """Return the fields of a message by name.

    Messages in it are dictionaries as well; arrays of numbers are arrays of numpy,
    other arrays are lists.

    Raises:
        ValueError: If the message is not of ``TYPES``, or is not whole.
    """
    if message.type not in TYPES:
        raise ValueError(f"message of {message.type!r}, expected one of {len(TYPES)}")
    try:
        return _Reader(message.data).message(message.type)
    except (struct.error, UnicodeDecodeError) as error:
        raise ValueError(f"{message.type} {error}, expected a whole message") from error


class _Reader:
    """Reads the fields of one message, one after the other."""

    def __init__(self, data: bytes) -> None:
        self._data = memoryview(data)[len(HEADER) :]
        self._at = 0

    def message(self, type_: str) -> dict[str, Any]:
        return {field.name: self._value(field) for field in fields_of(type_)}

    def _value(self, field: Field) -> Any:
        if field.length is None:
            return self._single(field.type)
        count: int = field.length or self._number(_COUNT)
        if field.type in NUMBERS:
            return self._array(NUMBERS[field.type][1], count)
        # Every element takes a byte or more, so this ends soon whatever is claimed.
        return [self._single(field.type) for _ in range(count)]

    def _single(self, type_: str) -> Any:
        if type_ == "string":
            return str(self._bytes(self._number(_COUNT))[:-1], "utf-8")
        if type_ in NUMBERS:
            return self._number(NUMBERS[type_][0])
        return self.message(type_)

    def _number(self, layout: struct.Struct) -> Any:
        self._at += -self._at % layout.size
        (value,) = layout.unpack_from(self._data, self._at)
        self._at += layout.size
        return value

    def _array(self, dtype: np.dtype[Any], count: int) -> Any:
        if count:
            self._at += -self._at % dtype.itemsize
        return np.frombuffer(self._bytes(count * dtype.itemsize), dtype)

    def _bytes(self, size: int) -> memoryview:
        found = self._data[self._at : self._at + size]
        if len(found) != size:
            raise struct.error(f"ends after {len(self._data)} bytes")
        self._at += size
        return found
