"""``--record`` of commands that drive a robot, or follow one."""

import time
from pathlib import Path

import numpy as np
import pytest
from commands import run_in_process
from PIL import Image
from processes import start_radarsim
from rosbags.typesys.stores.ros2_jazzy import (
    nav_msgs__msg__OccupancyGrid as OccupancyGrid,
)
from rosbags.typesys.stores.ros2_jazzy import tf2_msgs__msg__TFMessage as TFMessage

import radarsim
from radarsim.addons.recording.bag import BagReader
from radarsim.addons.recording.cdr import decode
from radarsim.addons.recording.recorders import EventType
from radarsim.addons.testing import UsarsimServer
from radarsim.client import Client

FIRST_SECOND = ("--time-limit", "1")
fast_server = pytest.mark.usarsim(map="empty_room", speed=4)


def last_map(folder: Path) -> OccupancyGrid:
    maps = [each for each in BagReader(folder).messages() if each.topic == "/map"]
    assert all(each.latched for each in maps)
    return decode(maps[-1].type, maps[-1].data, OccupancyGrid)


def frames_of(folder: Path) -> dict[str, str]:
    """Return the parent of each frame."""
    return {
        each.child_frame_id: each.header.frame_id
        for topic, type_, data, _, _ in BagReader(folder).messages()
        if topic in ("/tf", "/tf_static")
        for each in decode(type_, data, TFMessage).transforms
    }


def test_simulated_run_is_recorded_and_verified(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    words = ("empty_room", "--algorithm", "bug2", "--goal", "5,0")
    run = run_in_process("navigate", *words, *FIRST_SECOND, "--record", str(folder))
    assert f"recorded in {folder}" in run.err
    verified = run_in_process("replay", str(folder), "--verify")
    assert (verified.code, verified.err) == (0, "")
    assert "of 1 clients" in verified.text
    scans = radarsim.load_recording(folder).scans["P3AT_Radar360/lms200"]
    assert len(scans.times) > 7


def test_map_in_the_recording_is_the_one_that_is_written(tmp_path: Path) -> None:
    folder, out = tmp_path / "run", tmp_path / "maps"
    out.mkdir()
    words = ("foliage_room", *FIRST_SECOND, "--record", str(folder))
    assert run_in_process("map", "-o", str(out), *words).code == 0
    assert run_in_process("replay", str(folder), "--verify").code == 0
    found = last_map(folder)
    shape = found.info.height, found.info.width
    cells = found.data.reshape(shape)[::-1]
    with Image.open(out / "map.pgm") as image:
        pixels = np.asarray(image)
    levels = np.select([cells < 0, cells == 0], [205, 254], 0)
    np.testing.assert_array_equal(levels, pixels)
    assert {-1, 0, 100} == set(np.unique(cells))


@fast_server
def test_run_on_a_server_elsewhere_is_recorded(
    usarsim_server: UsarsimServer, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    server = f"127.0.0.1:{usarsim_server.address[1]}"
    words = ("--algorithm", "bug2", "--goal", "5,0", "--connect", server)
    options = (*FIRST_SECOND, "--record", str(folder))
    run = run_in_process("navigate", *words, *options)
    assert f"recorded in {folder}" in run.err
    recording = radarsim.load_recording(folder)
    scans = recording.scans["P3AT_Radar360/lms200"]
    assert len(scans.times) > 7
    assert np.isfinite(scans.ranges).mean() > 0.9
    assert scans.range_max == 80
    frames = frames_of(folder)
    assert frames["P3AT_Radar360/lms200"] == "P3AT_Radar360/base_link"
    assert frames["P3AT_Radar360/base_link"] == "P3AT_Radar360/odom"
    assert frames["P3AT_Radar360/odom"] == "map"
    topics = {message.topic for message in BagReader(folder).messages()}
    assert {"/P3AT_Radar360/cmd_vel", "/clock"} <= topics
    calls = list(BagReader(folder).calls())
    assert calls[0].type is EventType.CONNECT
    assert calls[0].tick > 0  # simulated time ran before
    refused = run_in_process("replay", str(folder), "--verify")
    assert refused.code == 1
    assert "expected a server's recording" in refused.err


def test_existing_folder_is_refused_before_anything_runs(tmp_path: Path) -> None:
    words = ("no_such_map", "--record", str(tmp_path))
    run = run_in_process("map", "-o", str(tmp_path / "maps"), *words)
    assert run.code == 1
    assert "expected a new folder" in run.err


@pytest.mark.slow
@fast_server
def test_robot_of_another_client_is_recorded(
    usarsim_server: UsarsimServer, tmp_path: Path
) -> None:
    folder, port = tmp_path / "run", usarsim_server.address[1]
    words = ["--watch", "R1", "--connect", f"127.0.0.1:{port}"]
    words += ["--record", str(folder)]
    with start_radarsim("map", "-o", str(tmp_path / "maps"), *words) as process:
        assert process.stderr is not None
        process.stderr.readline()  # it waits for the robot
        with Client.connect("127.0.0.1", port) as client:
            client.spawn("P3AT_Radar360", name="R1", start="RobotStart1")
            client.drive(*client.robot_info().wheel_speeds(0.5, 0.0))
            deadline, began = time.monotonic() + 240, client.session.time
            while client.session.time < began + 3 and time.monotonic() < deadline:
                client.read()
        process.communicate(timeout=240)
    assert len(radarsim.load_recording(folder).scans["R1/lms200"].times) > 20
    assert frames_of(folder)["R1/lms200"] == "R1/base_link"
    assert 100 in last_map(folder).data
