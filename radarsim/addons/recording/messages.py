"""Messages of ROS 2: each function returns the type of one and its fields.

Times are simulated seconds, frames are those of REP-103 and REP-105, units SI.
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
LATEST: Final = 2.0**31 - 1  # s that a time can tell
# Of x, y, z, roll, pitch, yaw: squares of m and rad, or of m/s and rad/s. Drivers of
# wheeled robots set such, as filters need some; large ones for what wheels do not tell.
ODOMETRY_COVARIANCE: Final = np.diag([1e-3, 1e-3, 1e6, 1e6, 1e6, 1e-3]).ravel()
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
# By name, in the order of the type's definition: numbers, texts, arrays of numbers,
# fields of a message in this one, or a list of such. Attributes, as the encoder of
# rosbags reads them, so that it needs no copy (row m of the benchmarks).
Fields: TypeAlias = SimpleNamespace


class RosMessage(NamedTuple):
    """A message.

    Attributes:
        type: Name of the type, such as ``sensor_msgs/msg/LaserScan``.
        fields: Its fields; those of 32 bits are rounded to these already.
    """

    type: str
    fields: Fields


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


def _message(type_: str, **fields: object) -> RosMessage:
    return RosMessage(type_, Fields(**fields))


def laser_scan(
    time: float,
    frame: str,
    ranges: Floats,
    *,
    fov: float,
    resolution: float,
    min_range: float,
    max_range: float,
    scan_time: float,
) -> RosMessage:
    """Return a scan.

    Args:
        time: Simulated time, s.
        frame: Frame of the scanner.
        ranges: (N,) m, counter-clockwise from the right; a range of at least
            ``max_range`` is a beam without return, which becomes ``inf``.
        fov: Angle between the first beam and the last, rad.
        resolution: Angle between neighbouring beams, rad.
        min_range: Shortest range, m.
        max_range: Longest range, m.
        scan_time: Time between scans, s.
    """
    first = -fov / 2
    return _message(
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


def point_cloud(time: float, frame: str, points: Points) -> RosMessage:
    """Return echoes or targets, rows of ``ECHO`` or ``TARGET``."""
    fields = points.dtype.fields
    assert fields is not None  # they have columns
    return _message(
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


def radar_scan(time: float, frame: str, points: Points) -> RosMessage:
    """Return targets, rows of ``TARGET``, as drivers of radars publish them."""
    x, y, dbm = points["x"], points["y"], points["dbm"]
    columns = np.hypot(x, y).tolist(), np.arctan2(y, x).tolist(), dbm.tolist()
    returns = [
        Fields(
            range=range_,
            azimuth=azimuth,
            elevation=0.0,
            doppler_velocity=math.nan,  # which a radar of one sweep does not measure
            amplitude=power,
        )
        for range_, azimuth, power in zip(*columns, strict=True)
    ]
    header = header_of(time, frame)
    return _message("radar_msgs/msg/RadarScan", header=header, returns=returns)


def grey_image(time: float, frame: str, pixels: NDArray[np.uint8]) -> RosMessage:
    """Return a grey picture, (H, W)."""
    height, width = pixels.shape
    return _message(
        "sensor_msgs/msg/Image",
        header=header_of(time, frame),
        height=height,
        width=width,
        encoding="mono8",
        is_bigendian=0,
        step=width,  # bytes of a row
        data=pixels.ravel(),
    )


def compressed_image(time: float, frame: str, jpeg: bytes) -> RosMessage:
    """Return a picture that is a file of JPEG."""
    data = np.frombuffer(jpeg, np.uint8)
    return _message(
        "sensor_msgs/msg/CompressedImage",
        header=header_of(time, frame),
        format="jpeg",
        data=data,
    )


def camera_info(time: float, frame: str, width: int, height: int) -> RosMessage:
    """Return the intrinsics of the camera: a pinhole without distortion."""
    focal = width / 2 / math.tan(math.radians(FOV_DEG) / 2)
    x, y = width / 2 - 0.5, height / 2 - 0.5  # pixels have their middles at integers
    k = np.array([[focal, 0, x], [0, focal, y], [0, 0, 1]])
    region = Fields(x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    return _message(
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
    time: float, frame: str, child: str, pose: Pose3, speed: float, turn: float
) -> RosMessage:
    """Return a pose by odometry, and the motion in the frame of the child.

    Args:
        time: Simulated time, s.
        frame: Frame of the pose.
        child: Frame that is there.
        pose: Where it is.
        speed: Speed ahead, m/s.
        turn: Counter-clockwise turn rate, rad/s.
    """
    return _message(
        "nav_msgs/msg/Odometry",
        header=header_of(time, frame),
        child_frame_id=child,
        pose=Fields(pose=pose_fields(pose), covariance=ODOMETRY_COVARIANCE),
        twist=Fields(twist=_twist(speed, turn), covariance=ODOMETRY_COVARIANCE),
    )


def pose_stamped(time: float, frame: str, pose: Pose3) -> RosMessage:
    """Return a pose in a frame."""
    fields = Fields(header=header_of(time, frame), pose=pose_fields(pose))
    return RosMessage("geometry_msgs/msg/PoseStamped", fields)


def twist_stamped(time: float, frame: str, speed: float, turn: float) -> RosMessage:
    """Return a forward speed, m/s, and a counter-clockwise turn rate, rad/s."""
    fields = Fields(header=header_of(time, frame), twist=_twist(speed, turn))
    return RosMessage("geometry_msgs/msg/TwistStamped", fields)


def transform(time: float, parent: str, child: str, pose: Pose3) -> Fields:
    """Return the pose of a frame in its parent, for ``transforms``."""
    place = Fields(
        translation=vector(pose.x, pose.y, pose.z), rotation=quaternion(pose)
    )
    header = header_of(time, parent)
    return Fields(header=header, child_frame_id=child, transform=place)


def transforms(each: Sequence[Fields]) -> RosMessage:
    """Return where frames are."""
    return _message("tf2_msgs/msg/TFMessage", transforms=each)


def occupancy_grid(
    time: float, frame: str, cells: NDArray[np.int8], corner: Pose3, resolution: float
) -> RosMessage:
    """Return a map.

    Args:
        time: Simulated time, s.
        frame: Name of the frame.
        cells: (R, C) -1 unknown, 0 free to 100 occupied; the first row is the
            southernmost.
        corner: South-west corner of the map, m.
        resolution: Side of a cell, m.
    """
    rows, columns = cells.shape
    return _message(
        "nav_msgs/msg/OccupancyGrid",
        header=header_of(time, frame),
        info=Fields(
            map_load_time=_stamp(time),
            resolution=float32(resolution),
            width=columns,
            height=rows,
            origin=pose_fields(corner),
        ),
        data=cells.ravel(),
    )


def clock(time: float) -> RosMessage:
    """Return simulated time."""
    return _message("rosgraph_msgs/msg/Clock", clock=_stamp(time))


def string(text: str) -> RosMessage:
    """Return a text."""
    return _message("std_msgs/msg/String", data=text)


def octets(label: str, data: bytes) -> RosMessage:
    """Return bytes, with a label on their only dimension."""
    dimension = Fields(label=label, size=len(data), stride=len(data))
    return _message(
        "std_msgs/msg/UInt8MultiArray",
        layout=Fields(dim=[dimension], data_offset=0),
        data=np.frombuffer(data, np.uint8),
    )


def header_of(time: float, frame: str) -> Fields:
    """Return a header."""
    return Fields(stamp=_stamp(time), frame_id=frame)


def _stamp(time: float) -> Fields:
    """Return whole seconds, and nanoseconds; 0 for a time that is not known."""
    total = round(time * NANOSECONDS) if 0 < time < LATEST else 0
    seconds, nanoseconds = divmod(total, NANOSECONDS)
    return Fields(sec=seconds, nanosec=nanoseconds)


def pose_fields(pose: Pose3) -> Fields:
    """Return a pose."""
    return Fields(position=vector(pose.x, pose.y, pose.z), orientation=quaternion(pose))


def _twist(speed: float, turn: float) -> Fields:
    return Fields(linear=vector(speed, 0.0, 0.0), angular=vector(0.0, 0.0, turn))


def vector(x: float, y: float, z: float) -> Fields:
    """Return a vector, or a point."""
    return Fields(x=x, y=y, z=z)


def quaternion(pose: Pose3) -> Fields:
    """Return the rotation of a pose."""
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
    """Round a number to 32 bits."""
    # JSON has 64 bits; it tells what a subscriber with 32 bits gets as well.
    return float(np.float32(value))
