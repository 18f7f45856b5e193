"""A recording has what slam_toolbox, AMCL and Nav2 need, message by message.

No ROS runs here. What the nodes ask for is from their sources and from rclcpp: names of
frames and topics, quality of service, and what their filters do with transforms.
"""

import bisect
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recorded_runs
from mcap.reader import make_reader
from recorded_runs import all_messages, messages_of

from radarsim.addons.recording.bag_folder import create_folder, file_name
from radarsim.addons.recording.recording_process import write_recording
from radarsim.scene.scene import Scene

BEST_EFFORT, RELIABLE = 0, 1
VOLATILE, TRANSIENT_LOCAL = 0, 1
# Of subscriptions: reliability and durability that they ask for.
ASKED = {
    "/lms200/scan": (BEST_EFFORT, VOLATILE),  # of sensor data
    "/tf": (RELIABLE, VOLATILE),
    "/tf_static": (RELIABLE, TRANSIENT_LOCAL),
    "/map": (RELIABLE, TRANSIENT_LOCAL),  # AMCL, and the static layer of costmaps
    "/odom": (BEST_EFFORT, VOLATILE),
    "/clock": (BEST_EFFORT, VOLATILE),
    "/robot_description": (RELIABLE, TRANSIENT_LOCAL),  # RViz
}
WAIT = 0.5  # s that slam_toolbox waits for a transform, by its transform_timeout


@pytest.fixture(scope="module")
def bag(foliage_room: Scene, tmp_path_factory: pytest.TempPathFactory) -> Path:
    run = recorded_runs.run_two_clients(foliage_room, ticks=200)
    news = {"no_namespace": "R 1", "own_localization": True}
    folder = tmp_path_factory.mktemp("recording") / "run"
    create_folder(folder)
    info = run.info.model_copy(update=news)
    write_recording(folder, info, run.events, foliage_room)
    return folder


def seconds(stamp: Any) -> float:
    return float(stamp.sec + stamp.nanosec / 1e9)


def test_scans_have_transforms_around_them_soon_enough(bag: Path) -> None:
    """The filters of tf2 wait until a scan can be placed in ``odom``."""
    scans = messages_of(bag, "/lms200/scan")
    placed = [
        seconds(t.header.stamp)
        for message in messages_of(bag, "/tf")
        for t in message.transforms
        if (t.header.frame_id, t.child_frame_id) == ("odom", "base_link")
    ]
    assert placed == sorted(placed)
    assert len(scans) > 10
    counted = 0
    for scan in scans:
        stamp = seconds(scan.header.stamp)
        after = bisect.bisect_left(placed, stamp - 1e-9)
        if 0 < after < len(placed):  # it lies between two, or on one
            counted += 1
            assert placed[after] - stamp < WAIT
    assert counted > len(scans) / 2


def test_beams_are_as_many_as_karto_computes(bag: Path) -> None:
    first, *scans = messages_of(bag, "/lms200/scan")
    assert first.scan_time == 0
    for scan in scans:
        assert scan.scan_time == pytest.approx(0.1)
        gaps = (scan.angle_max - scan.angle_min) / scan.angle_increment
        assert round(gaps) + 1 == len(scan.ranges)
        assert 0 <= scan.range_min < scan.range_max < np.inf
        near = scan.ranges[np.isfinite(scan.ranges)]
        assert (near < scan.range_max).all()
        assert not np.isnan(scan.ranges).any()


def test_time_grows_and_no_message_is_ahead_of_it(bag: Path) -> None:
    now, last = 0.0, -1.0
    for topic, message in all_messages(bag):
        if topic == "/clock":
            now = seconds(message.clock)
            assert now >= last
            last = now
        elif topic in ("/lms200/scan", "/odom"):
            assert seconds(message.header.stamp) <= now + 1e-9
        elif topic == "/tf":
            stamps = [seconds(t.header.stamp) for t in message.transforms]
            assert max(stamps) <= now + 1e-9


def test_odometry_can_be_filtered(bag: Path) -> None:
    """Its frames are those of the transforms, its covariances positive definite."""
    odometry = messages_of(bag, "/odom")
    frames = {(each.header.frame_id, each.child_frame_id) for each in odometry}
    assert frames == {("odom", "base_link")}
    for covariance in (odometry[-1].pose.covariance, odometry[-1].twist.covariance):
        assert (np.linalg.eigvalsh(covariance.reshape(6, 6)) > 0).all()
    assert np.diff([seconds(each.header.stamp) for each in odometry]).max() < 0.5
    assert odometry[-1].twist.twist.linear.x > 0.1  # it drives


def test_quality_of_service_is_at_least_what_is_asked_for(bag: Path) -> None:
    with (bag / file_name(bag)).open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    offered = {
        channel.topic: channel.metadata["offered_qos_profiles"]
        for channel in summary.channels.values()
    }
    for topic, (reliability, durability) in ASKED.items():
        given = offered[topic]
        assert reliability <= ("reliability: reliable" in given)
        assert durability <= ("durability: transient_local" in given)


def test_true_map_is_in_the_frame_that_amcl_localises_in(bag: Path) -> None:
    (grid,) = messages_of(bag, "/map")
    assert grid.header.frame_id == "map"
    q = grid.info.origin.orientation  # Nav2 knows no turned maps
    assert (q.x, q.y, q.z, q.w) == (0, 0, 0, 1)
    assert {*np.unique(grid.data)} <= {-1, 0, 100}
