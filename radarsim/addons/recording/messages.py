"""Creates ROS 2 messages: each function returns a message of one type.

Times are simulated seconds. Frames follow REP-103 and REP-105, units are SI.
"""

import math
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose3
from radarsim.server.views import FOV_DEG

NANOSECONDS: Final = 1_000_000_000
CLOCK: Final = "/clock"  # name of a topic
MAP: Final = "map"  # name of a frame
LATEST: Final = 2.0**31 - 1  # s; latest time that fits into a message
# Covariance of x, y, z, roll, pitch and yaw: m**2 and rad**2 for poses, (m/s)**2 and
# (rad/s)**2 for motion. Filters need these values, and drivers of wheeled robots
# publish similar ones. Axes that wheels do not measure have large values.
ODOMETRY_COVARIANCE: Final = np.diag([1e-3, 1e-3, 1e6, 1e6, 1e6, 1e-3]).ravel()
# Data types of ``sensor_msgs/msg/PointField``, by numpy type.
_POINT_TYPES: Final = {"<f4": 7, "<u2": 4}
ECHO: Final = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "intensity", "power")]
    + [(name, "<u2") for name in ("beam", "kind", "object", "material")]
)
TARGET: Final = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("dbm", "<f4"), ("beam", "<u2")]
)

Points: TypeAlias = NDArray[np.void]
# The fields of a message, in the order of the type's definition: numbers, texts, arrays
# of numbers, nested ``Fields``, or lists of these. The encoder of rosbags reads
# attributes, so a namespace is encoded without a copy (row m of the benchmarks).
Fields: TypeAlias = SimpleNamespace


class TopicMessage(NamedTuple):
    """A message for a topic.

    Attributes:
        topic: Name of the topic.
        type: Name of the type, such as ``sensor_msgs/msg/LaserScan``.
        fields: Fields of the message; float32 fields are rounded already.
        latched: Whether late subscribers get the last message of the topic.
    """

    topic: str
    type: str
    fields: Fields
    latched: bool = False


def _message(topic: str, type_: str, **fields: object) -> TopicMessage:
    return TopicMessage(topic, type_, Fields(**fields))


def laser_scan(
    topic: str,
    time: float,
    frame: str,
    ranges: Floats,
    *,
    fov: float,
    resolution: float,
    min_range: float,
    max_range: float,
    scan_time: float,
) -> TopicMessage:
    """Return a ``LaserScan``.

    Args:
        topic: Name of the topic.
        time: Simulated time, s.
        frame: Frame of the scanner.
        ranges: (N,) m, counter-clockwise from the right. Ranges of at least
            ``max_range`` are beams without return, and become ``inf``.
        fov: Angle between the first beam and the last, rad.
        resolution: Angle between neighbouring beams, rad.
        min_range: Shortest range, m.
        max_range: Longest range, m.
        scan_time: Time between scans, s.
    """
    first = -fov / 2
    return _message(
        topic,
        "sensor_msgs/msg/LaserScan",
        header=header_of(time, frame),
        angle_min=float32(first),
        angle_max=float32(first + resolution * (len(ranges) - 1)),
        angle_increment=float32(resolution),
        time_increment=0.0,
        scan_time=float32(scan_time),
        range_min=float32(min_range),
        range_max=float32(max_range),
        ranges=np.where(ranges >= max_range, np.inf, ranges).astype("<f4"),
        intensities=np.zeros(0, "<f4"),
    )


def point_cloud(topic: str, time: float, frame: str, points: Points) -> TopicMessage:
    """Return a ``PointCloud2`` of echoes or targets: rows of ``ECHO`` or ``TARGET``."""
    fields = points.dtype.fields
    assert fields is not None  # the array is structured
    return _message(
        topic,
        "sensor_msgs/msg/PointCloud2",
        header=header_of(time, frame),
        height=1,
        width=len(points),
        fields=[
            Fields(name=name, offset=at, datatype=_POINT_TYPES[kind.str], count=1)
            for name, (kind, at, *_) in fields.items()
        ],
        is_bigendian=False,
        point_step=points.itemsize,
        row_step=points.nbytes,
        data=np.frombuffer(points.tobytes(), np.uint8),
        is_dense=True,  # all points are valid
    )


def radar_scan(topic: str, time: float, frame: str, points: Points) -> TopicMessage:
    """Return a ``RadarScan`` of targets: rows of ``TARGET``."""
    x, y, dbm = points["x"], points["y"], points["dbm"]
    columns = np.hypot(x, y).tolist(), np.arctan2(y, x).tolist(), dbm.tolist()
    returns = [
        Fields(
            range=range_,
            azimuth=azimuth,
            elevation=0.0,
            doppler_velocity=math.nan,  # a single sweep measures no velocity
            amplitude=power,
        )
        for range_, azimuth, power in zip(*columns, strict=True)
    ]
    fields = Fields(header=header_of(time, frame), returns=returns)
    return TopicMessage(topic, "radar_msgs/msg/RadarScan", fields)


def grey_image(
    topic: str, time: float, frame: str, pixels: NDArray[np.uint8]
) -> TopicMessage:
    """Return an ``Image`` of grey pixels, (H, W)."""
    height, width = pixels.shape
    return _message(
        topic,
        "sensor_msgs/msg/Image",
        header=header_of(time, frame),
        height=height,
        width=width,
        encoding="mono8",
        is_bigendian=0,
        step=width,  # bytes per row
        data=pixels.ravel(),
    )


def compressed_image(topic: str, time: float, frame: str, jpeg: bytes) -> TopicMessage:
    """Return a ``CompressedImage`` with a JPEG file."""
    return _message(
        topic,
        "sensor_msgs/msg/CompressedImage",
        header=header_of(time, frame),
        format="jpeg",
        data=np.frombuffer(jpeg, np.uint8),
    )


def camera_info(
    topic: str, time: float, frame: str, width: int, height: int
) -> TopicMessage:
    """Return a ``CameraInfo``: intrinsics of a pinhole camera without distortion."""
    focal = width / 2 / math.tan(math.radians(FOV_DEG) / 2)
    x, y = width / 2 - 0.5, height / 2 - 0.5  # pixel centres are at integers
    k = np.array([[focal, 0, x], [0, focal, y], [0, 0, 1]])
    region = Fields(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    return _message(
        topic,
        "sensor_msgs/msg/CameraInfo",
        header=header_of(time, frame),
        height=height,
        width=width,
        distortion_model="plumb_bob",
        d=np.zeros(5),
        k=k.ravel(),
        r=np.eye(3).ravel(),
        p=np.column_stack([k, np.zeros(3)]).ravel(),
        binning_x=0,
        binning_y=0,
        roi=region,
    )


def odometry(
    topic: str,
    time: float,
    frame: str,
    child: str,
    pose: Pose3,
    motion: tuple[float, float],
) -> TopicMessage:
    """Return an ``Odometry``: a pose, and the motion in the child frame.

    Args:
        topic: Name of the topic.
        time: Simulated time, s.
        frame: Frame in which the pose is given.
        child: Frame that has the pose.
        pose: Pose of the child frame.
        motion: Forward speed, m/s, and counter-clockwise turn rate, rad/s.
    """
    return _message(
        topic,
        "nav_msgs/msg/Odometry",
        header=header_of(time, frame),
        child_frame_id=child,
        pose=Fields(pose=pose_fields(pose), covariance=ODOMETRY_COVARIANCE),
        twist=Fields(twist=_twist(*motion), covariance=ODOMETRY_COVARIANCE),
    )


def pose_stamped(topic: str, time: float, frame: str, pose: Pose3) -> TopicMessage:
    """Return a ``PoseStamped``: a pose in a frame."""
    fields = Fields(header=header_of(time, frame), pose=pose_fields(pose))
    return TopicMessage(topic, "geometry_msgs/msg/PoseStamped", fields)


def twist_stamped(
    topic: str, time: float, frame: str, speed: float, turn: float
) -> TopicMessage:
    """Return a ``TwistStamped``: forward speed, m/s, and left turn rate, rad/s."""
    fields = Fields(header=header_of(time, frame), twist=_twist(speed, turn))
    return TopicMessage(topic, "geometry_msgs/msg/TwistStamped", fields)


def transform(time: float, parent: str, child: str, pose: Pose3) -> Fields:
    """Return a ``TransformStamped``: the pose of a frame in its parent frame."""
    place = Fields(
        translation=vector(pose.x, pose.y, pose.z), rotation=quaternion(pose)
    )
    header = header_of(time, parent)
    return Fields(header=header, child_frame_id=child, transform=place)


def transforms(
    topic: str, each: Sequence[Fields], *, latched: bool = False
) -> TopicMessage:
    """Return a ``TFMessage`` with transforms, each made by ``transform``."""
    fields = Fields(transforms=each)
    return TopicMessage(topic, "tf2_msgs/msg/TFMessage", fields, latched)


def occupancy_grid(
    time: float, corner: tuple[float, float], resolution: float, cells: NDArray[np.int8]
) -> TopicMessage:
    """Return an ``OccupancyGrid`` for the topic ``/map``.

    Args:
        time: Simulated time, s.
        corner: South-west corner of the map, m.
        resolution: Side of a cell, m.
        cells: (R, C) -1 unknown, 0 free to 100 occupied; the first row is the
            southernmost.
    """
    rows, columns = cells.shape
    info = Fields(
        map_load_time=_stamp(time),
        resolution=float32(resolution),
        width=columns,
        height=rows,
        origin=pose_fields(Pose3(*corner, 0.0)),
    )
    fields = Fields(header=header_of(time, MAP), info=info, data=cells.ravel())
    return TopicMessage("/map", "nav_msgs/msg/OccupancyGrid", fields, latched=True)


def clock(time: float) -> TopicMessage:
    """Return a ``Clock`` with the simulated time, s."""
    return _message(CLOCK, "rosgraph_msgs/msg/Clock", clock=_stamp(time))


def string(topic: str, text: str) -> TopicMessage:
    """Return a latched ``String``."""
    return TopicMessage(topic, "std_msgs/msg/String", Fields(data=text), latched=True)


def octets(topic: str, label: str, data: bytes) -> TopicMessage:
    """Return a ``UInt8MultiArray`` with a label on its only dimension."""
    dimension = Fields(label=label, size=len(data), stride=len(data))
    return _message(
        topic,
        "std_msgs/msg/UInt8MultiArray",
        layout=Fields(dim=[dimension], data_offset=0),
        data=np.frombuffer(data, np.uint8),
    )


def header_of(time: float, frame: str) -> Fields:
    """Return a ``Header``."""
    return Fields(stamp=_stamp(time), frame_id=frame)


def _stamp(time: float) -> Fields:
    """Return a time as seconds and nanoseconds; 0 if it is unknown or too large."""
    total = round(time * NANOSECONDS) if 0 < time < LATEST else 0
    seconds, nanoseconds = divmod(total, NANOSECONDS)
    return Fields(sec=seconds, nanosec=nanoseconds)


def pose_fields(pose: Pose3) -> Fields:
    """Return a ``Pose``."""
    return Fields(position=vector(pose.x, pose.y, pose.z), orientation=quaternion(pose))


def _twist(speed: float, turn: float) -> Fields:
    return Fields(linear=vector(speed, 0.0, 0.0), angular=vector(0.0, 0.0, turn))


def vector(x: float, y: float, z: float) -> Fields:
    """Return a ``Vector3`` or a ``Point``."""
    return Fields(x=x, y=y, z=z)


def quaternion(pose: Pose3) -> Fields:
    """Return the rotation of a pose as a ``Quaternion``."""
    cr, sr = math.cos(pose.roll / 2), math.sin(pose.roll / 2)
    cp, sp = math.cos(pose.pitch / 2), math.sin(pose.pitch / 2)
    cy, sy = math.cos(pose.yaw / 2), math.sin(pose.yaw / 2)
    return Fields(
        x=sr * cp * cy - cr * sp * sy,
        y=cr * sp * cy + sr * cp * sy,
        z=cr * cp * sy - sr * sp * cy,
        w=cr * cp * cy + sr * sp * sy,
    )


def float32(value: float) -> float:
    """Round a number to single precision."""
    # JSON has double precision. Rounding gives subscribers of JSON and of CDR the same
    # numbers.
    return float(np.float32(value))
