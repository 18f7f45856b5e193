"""Messages have the values that they were made of, and all fields of their types."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.addons.recording import messages
from radarsim.addons.recording.cdr import UInt8MultiArray, decode, encode, typestore
from radarsim.addons.recording.messages import Fields, RosMessage, Transform
from radarsim.addons.recording.robot_topics import Legend, RobotTopics
from radarsim.client.robot_info import ScannerInfo
from radarsim.geometry import Pose3, rotation_matrix
from radarsim.protocol.echoes import target_lines

PointField: Any = typestore().types["sensor_msgs/msg/PointField"]
NUMBERS = st.floats(-1e6, 1e6)
POSES = st.builds(Pose3, *[NUMBERS] * 3, *[st.floats(-3.2, 3.2)] * 3)
NAMES = st.text(st.characters(min_codepoint=33, max_codepoint=0x2FFF), max_size=30)
TIMES = st.integers(0, 10**9).map(lambda ticks: ticks / 100)


def decoded(message: RosMessage) -> Any:
    """Encode a message, and decode it; its fields are the type's, in its order."""
    check_fields(message.type, message.fields)
    return typestore().deserialize_cdr(encode(message).data, message.type)


def check_fields(type_: str, fields: Fields) -> None:
    defined = typestore().fielddefs[type_][1]
    assert list(vars(fields)) == [name for name, _ in defined]
    for name, (_, described) in defined:
        value = getattr(fields, name)
        if isinstance(value, SimpleNamespace):
            check_fields(str(described), value)
        elif isinstance(value, list):
            for each in value:
                check_fields(described[0][1], each)  # type: ignore[arg-type]


def stamp_of(header: Any) -> tuple[int, int]:
    return header.stamp.sec, header.stamp.nanosec


def rows_of(cloud: Any) -> Any:
    """Return the points of a cloud by what it tells of its fields."""
    kinds = {PointField.FLOAT32: "<f4", PointField.UINT16: "<u2"}
    dtype = np.dtype(
        {
            "names": [field.name for field in cloud.fields],
            "formats": [kinds[field.datatype] for field in cloud.fields],
            "offsets": [field.offset for field in cloud.fields],
            "itemsize": cloud.point_step,
        }
    )
    return cloud.data.view(dtype)


@given(TIMES, NAMES, st.lists(st.floats(0, 100), max_size=40))
def test_scan_has_its_ranges_and_misses_are_infinite(
    time: float, frame: str, ranges: list[float]
) -> None:
    scan = messages.laser_scan(
        time,
        frame,
        np.array(ranges),
        fov=2.0,
        resolution=0.1,
        min_range=0.5,
        max_range=80.0,
        scan_time=0.25,
    )
    found = decoded(scan)
    # JSON has the same numbers as CDR.
    assert (scan.fields.angle_min, scan.fields.angle_increment) == (
        found.angle_min,
        found.angle_increment,
    )
    assert found.scan_time == 0.25
    assert found.header.frame_id == frame
    assert stamp_of(found.header) == divmod(round(time * 100) * 10**7, 10**9)
    expected = [np.inf if each >= 80 else each for each in ranges]
    np.testing.assert_array_equal(found.ranges, np.array(expected, np.float32))
    assert found.angle_min == np.float32(-1.0)
    limits = found.range_min, found.range_max, found.angle_increment
    assert limits == (0.5, 80.0, np.float32(0.1))


def test_picture_has_its_rows() -> None:
    pixels = np.arange(12, dtype=np.uint8).reshape(3, 4)
    found = decoded(messages.grey_image(2.5, "R1/Navtech", pixels))
    assert (found.header.frame_id, found.encoding) == ("R1/Navtech", "mono8")
    assert (found.height, found.width, found.step) == (3, 4, 4)
    assert found.data.tolist() == list(range(12))


@given(TIMES, POSES)
def test_poses_are_positions_and_unit_quaternions(time: float, pose: Pose3) -> None:
    found = decoded(messages.pose_stamped(time, "map", pose)).pose
    position, q = found.position, found.orientation
    assert (position.x, position.y, position.z) == (pose.x, pose.y, pose.z)
    assert math.hypot(q.x, q.y, q.z, q.w) == pytest.approx(1)
    expected = rotation_matrix(pose.roll, pose.pitch, pose.yaw)
    ahead = [
        1 - 2 * (q.y**2 + q.z**2),
        2 * (q.x * q.y + q.z * q.w),
        2 * (q.x * q.z - q.y * q.w),
    ]
    np.testing.assert_allclose(ahead, expected[:, 0], atol=1e-12)


def test_odometry_has_both_frames() -> None:
    pose = Pose3(1.0, 2.0, 0.0, yaw=0.5)
    frames = "R1/odom", "R1/base_link"
    found = decoded(messages.odometry(1.5, *frames, pose, 0.5, -0.25))
    assert (found.header.frame_id, found.child_frame_id) == frames
    assert found.pose.pose.position.y == 2.0
    assert (found.twist.twist.linear.x, found.twist.twist.angular.z) == (0.5, -0.25)
    for covariance in (found.pose.covariance, found.twist.covariance):
        assert (np.linalg.eigvalsh(covariance.reshape(6, 6)) > 0).all()


def test_motion_is_ahead_and_counter_clockwise() -> None:
    found = decoded(messages.twist_stamped(2.0, "R1/base_link", 0.5, -0.25)).twist
    assert (found.linear.x, found.angular.z) == (0.5, -0.25)


@given(st.lists(st.builds(Transform, TIMES, NAMES, NAMES, POSES), max_size=4))
def test_transforms_name_parent_and_child(each: list[Transform]) -> None:
    found = decoded(messages.transforms(each)).transforms
    assert [t.header.frame_id for t in found] == [t.parent for t in each]
    assert [t.child_frame_id for t in found] == [t.child for t in each]
    assert [t.transform.translation.x for t in found] == [t.pose.x for t in each]


@given(st.integers(0, 50))
def test_points_keep_their_columns(count: int) -> None:
    numbers = np.arange(count, dtype=np.float64)
    columns = {"intensity": numbers / 64, "power": numbers / 32, "beam": numbers}
    angles, ranges = numbers / 10, numbers + 1.0
    points = messages.make_points(messages.ECHO, angles, ranges, columns)
    found = decoded(messages.point_cloud(1.0, "R1/lms200", points))
    read = rows_of(found)
    assert (found.width, found.row_step) == (count, count * found.point_step)
    np.testing.assert_allclose(np.hypot(read["x"], read["y"]), numbers + 1.0, rtol=1e-6)
    np.testing.assert_array_equal(read["intensity"], numbers / 64)
    np.testing.assert_array_equal(read["beam"], numbers)


@pytest.mark.parametrize("count", [0, 1, 300])
def test_targets_of_a_turn_are_one_cloud(count: int) -> None:
    mount = Pose3(0.2, 0.0, 0.2)
    scanner = ScannerInfo("Navtech", mount, 2.5, 165.0, 0.0157, 2 * math.pi * 0.9, 361)
    topics = RobotTopics("R1", Legend())
    topics.describe(None, [scanner], {}, 0.0)
    beams, ranges = np.arange(count), np.linspace(3.0, 90.0, count)
    lines = target_lines(4.0, "Navtech", beams, ranges, -60.0 - ranges)
    told = [message for line in lines for message in topics.of_report(line)]
    (topic, message, latched) = told[-1]
    assert (len(told), topic, latched) == (1, "/R1/Navtech/targets", False)
    cloud = decoded(message)
    assert (cloud.header.frame_id, stamp_of(cloud.header)) == ("R1/Navtech", (4, 0))
    read = rows_of(cloud)
    np.testing.assert_array_equal(read["beam"], beams)
    np.testing.assert_allclose(read["dbm"], -60.0 - ranges)
    directions = np.arctan2(read["y"], read["x"])
    expected = (scanner.angles[:count] + math.pi) % (2 * math.pi) - math.pi
    np.testing.assert_allclose(directions, expected, atol=1e-6)
    np.testing.assert_allclose(np.hypot(read["x"], read["y"]), ranges, rtol=1e-6)


def test_clock_and_text() -> None:
    now = decoded(messages.clock(1.25)).clock
    assert (now.sec, now.nanosec) == (1, 250_000_000)
    assert decoded(messages.string("grün")).data == "grün"


@pytest.mark.parametrize("time", [math.nan, -1.0, math.inf])
def test_unknown_time_is_zero(time: float) -> None:
    now = decoded(messages.clock(time)).clock
    assert (now.sec, now.nanosec) == (0, 0)


@given(NAMES, st.binary(max_size=300))
def test_bytes_are_read_back(label: str, data: bytes) -> None:
    message = messages.octets(label, data)
    found = decoded(message)
    assert bytes(found.data) == data
    assert found.layout.dim[0].label == label


@given(st.integers(0, 40))
def test_torn_bytes_are_refused(cut: int) -> None:
    whole = encode(messages.octets("take 1 2", b"1234"))
    torn = whole._replace(data=whole.data[: min(cut, len(whole.data) - 1)])
    with pytest.raises(ValueError, match="expected"):
        decode(torn, UInt8MultiArray)


def test_other_types_are_refused() -> None:
    with pytest.raises(ValueError, match="UInt8MultiArray expected"):
        decode(encode(messages.string("take 1 2")), UInt8MultiArray)
