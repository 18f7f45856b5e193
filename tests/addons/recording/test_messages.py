"""Messages of topics, as ROS decodes them."""

import json
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.addons.recording import messages
from radarsim.addons.recording.cdr import (
    UInt8MultiArray,
    decode,
    definition_of,
    encode,
    typestore,
)
from radarsim.addons.recording.messages import TopicMessage
from radarsim.addons.recording.robot_topics import Legend, RobotTopics
from radarsim.addons.ros.rosbridge import message_json
from radarsim.client.robot_info import ScannerInfo
from radarsim.geometry import Pose3
from radarsim.protocol.echoes import target_lines

PointField: Any = typestore().types["sensor_msgs/msg/PointField"]


def decoded(message: TopicMessage) -> Any:
    return typestore().deserialize_cdr(encode(message), message.type)


def stamp_of(header: Any) -> tuple[int, int]:
    return header.stamp.sec, header.stamp.nanosec


def rows_of(cloud: Any) -> Any:
    """Return the points of a cloud by its description of the fields."""
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


@pytest.mark.parametrize("count", [0, 1, 300])
def test_targets_of_a_turn_are_one_cloud(count: int) -> None:
    mount = Pose3(0.2, 0.0, 0.2)
    scanner = ScannerInfo("Navtech", mount, 2.5, 165.0, 0.0157, 2 * math.pi * 0.9, 361)
    topics = RobotTopics("R1", Legend())
    topics.describe(None, [scanner], {}, 0.0)
    beams, ranges = np.arange(count), np.linspace(3.0, 90.0, count)
    lines = target_lines(4.0, "Navtech", beams, ranges, -60.0 - ranges)
    converted = [message for line in lines for message in topics.of_report(line)]
    message = converted[-1]
    assert (len(converted), message.topic) == (2, "/R1/Navtech/targets")
    assert not message.latched
    cloud = decoded(message)
    assert (cloud.header.frame_id, stamp_of(cloud.header)) == ("R1/Navtech", (4, 0))
    read = rows_of(cloud)
    np.testing.assert_array_equal(read["beam"], beams)
    np.testing.assert_allclose(read["dbm"], -60.0 - ranges)
    directions = np.arctan2(read["y"], read["x"])
    expected = (scanner.angles[:count] + math.pi) % (2 * math.pi) - math.pi
    np.testing.assert_allclose(directions, expected, atol=1e-6)
    np.testing.assert_allclose(np.hypot(read["x"], read["y"]), ranges, rtol=1e-6)
    # The same as a scan of the drivers of radars, which other nodes of ROS read.
    assert converted[0].topic == "/R1/Navtech/radar_scan"
    assert converted[0].type == "radar_msgs/msg/RadarScan"
    scan = decoded(converted[0])
    assert (scan.header.frame_id, stamp_of(scan.header)) == ("R1/Navtech", (4, 0))
    returns = np.array(
        [
            (each.range, each.azimuth, each.elevation, each.amplitude)
            for each in scan.returns
        ]
    ).reshape(-1, 4)
    columns = [ranges, expected, np.zeros(count), -60.0 - ranges]
    np.testing.assert_allclose(returns, np.column_stack(columns), rtol=1e-6, atol=1e-6)
    assert all(math.isnan(each.doppler_velocity) for each in scan.returns)
    sent = json.loads(message_json(converted[0]))["returns"]
    assert {each["doppler_velocity"] for each in sent} <= {None}
    assert "float32 doppler_velocity" in definition_of(converted[0].type)


@pytest.mark.parametrize("time", [math.nan, -1.0, math.inf])
def test_unknown_time_is_zero(time: float) -> None:
    now = decoded(messages.clock(time)).clock
    assert (now.sec, now.nanosec) == (0, 0)


@given(st.integers(0, 40))
def test_torn_bytes_are_refused(cut: int) -> None:
    whole = encode(messages.octets("/a", "take 1 2", b"1234"))
    torn = whole[: min(cut, len(whole) - 1)]
    with pytest.raises(ValueError, match="expected"):
        decode("std_msgs/msg/UInt8MultiArray", torn, UInt8MultiArray)
