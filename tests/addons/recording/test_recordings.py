"""Recordings: what a run was, readable by others, and repeated to the byte."""

import random
import re
import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import recorded_runs
from mcap.reader import SeekingReader
from recorded_runs import RecordedRun, messages_of
from rosbags.highlevel import AnyReader
from rosbags.interfaces import ConnectionExtRosbag2

from radarsim.addons.recording.bag import BagReader, BagWriter, repair
from radarsim.addons.recording.bag_folder import create_folder, file_name
from radarsim.addons.recording.recorders import EventType
from radarsim.addons.recording.replay import repeat_run
from radarsim.errors import RecordingError
from radarsim.scene.scene import Scene


def test_calls_are_read_as_they_were_written(run: RecordedRun, bag: Path) -> None:
    reader = BagReader(bag)
    assert list(reader.calls()) == run.calls
    assert reader.is_complete
    assert reader.info == run.info


def test_run_is_repeated_to_the_byte(
    run: RecordedRun, bag: Path, foliage_room: Scene
) -> None:
    host = recorded_runs.host_of(run, foliage_room)
    result = repeat_run(host, BagReader(bag).calls())
    assert not result.difference
    assert result.bytes == sum(map(len, run.sent.values()))
    assert result.clients == 2


def test_changed_command_is_found_with_tick_line_and_byte(
    run: RecordedRun, foliage_room: Scene
) -> None:
    changed = [
        call._replace(data=call.data.replace(b"{Left 3}", b"{Left 4}"))
        if call.type is EventType.RECEIVE
        else call
        for call in run.calls
    ]
    drove = next(c.tick for c in changed if b"{Left 4}" in c.data)
    result = repeat_run(recorded_runs.host_of(run, foliage_room), changed)
    found = re.fullmatch(
        r"tick (\d+), line (\d+), byte (\d+) of client 1: came '(.*)', expected '(.*)'",
        result.difference,
    )
    assert found is not None
    tick, number, byte = map(int, found.groups()[:3])
    repeated, recorded = found.groups()[3:]
    assert drove < tick <= drove + 20
    line = run.sent[1].split(b"\r\n")[number - 1].decode()
    assert recorded in line
    assert line[byte - 1 :][:3] in line[line.index(recorded) :]
    assert recorded != repeated


def test_other_seed_differs(run: RecordedRun, foliage_room: Scene) -> None:
    host = recorded_runs.host_of(run, foliage_room, seed=2)
    assert repeat_run(host, run.calls).difference


def test_frames_lead_from_the_map_to_each_scanner(bag: Path) -> None:
    parents: dict[str, set[str]] = {}
    for topic in ("/tf", "/tf_static"):
        for message in messages_of(bag, topic):
            for each in message.transforms:
                found = parents.setdefault(each.child_frame_id, set())
                found.add(each.header.frame_id)
    scanners = {"R_1": ["lms200", "Hokuyo"], "R_1_2": ["lms200"]}
    expected = {
        child: {parent}
        for robot, names in scanners.items()
        for child, parent in [
            (f"{robot}/odom", "map"),
            (f"{robot}/base_link", f"{robot}/odom"),
            (f"{robot}/camera_optical", f"{robot}/base_link"),
            *((f"{robot}/{name}", f"{robot}/base_link") for name in names),
        ]
    }
    assert parents == expected
    # Who subscribes later gets only the last message.
    last = messages_of(bag, "/tf_static")[-1].transforms
    assert {each.child_frame_id.split("/")[0] for each in last} == {"R_1", "R_1_2"}


def test_echoes_are_points_in_the_frame_of_the_scanner(bag: Path) -> None:
    clouds = messages_of(bag, "/R_1/lms200/echoes")
    legends = messages_of(bag, "/radarsim/legend")
    scans = messages_of(bag, "/R_1/lms200/scan")
    assert len(clouds) > 5
    assert '"foliage"' in legends[-1].data
    cloud = clouds[-1]
    scan = next(m for m in scans if m.header.stamp == cloud.header.stamp)
    points = cloud.data.view(
        np.dtype([(n, "<f4") for n in "xyzip"] + [(n, "<u2") for n in "bkom"])
    )
    angles = np.arctan2(points["y"], points["x"])
    expected = scan.angle_min + points["b"] * scan.angle_increment
    np.testing.assert_allclose(angles, expected, atol=1e-4)
    # The range of a beam is that of its last echo.
    ranges = np.hypot(points["x"], points["y"])
    farthest = np.zeros(len(scan.ranges))
    np.maximum.at(farthest, points["b"], ranges)
    seen = np.isfinite(scan.ranges) & (farthest > 0)
    assert seen.sum() > 100
    np.testing.assert_allclose(farthest[seen], scan.ranges[seen], atol=0.011)


def test_commands_to_drive_are_motions(bag: Path) -> None:
    (message,) = messages_of(bag, "/R_1/cmd_vel")
    assert message.twist.linear.x == pytest.approx(2.5 * 0.1275, rel=0.3)
    assert message.twist.angular.z < 0


def test_clock_runs_with_simulated_time(bag: Path) -> None:
    times = [
        message.clock.sec + message.clock.nanosec / 1e9
        for message in messages_of(bag, "/clock")
    ]
    np.testing.assert_allclose(np.diff(times), 0.01)


def test_metadata_counts_what_is_there(bag: Path) -> None:
    counts = Counter(message.topic for message in BagReader(bag).messages())
    with AnyReader([bag]) as reader:
        assert {each.topic: each.msgcount for each in reader.connections} == counts
        assert reader.message_count == sum(counts.values())
    with (bag / file_name(bag)).open("rb") as file:
        summary = SeekingReader(file, validate_crcs=True).get_summary()
    assert summary is not None
    assert all(each.schema_id for each in summary.channels.values())
    assert {each.message_encoding for each in summary.channels.values()} == {"cdr"}


def test_latched_topics_are_offered_as_such(bag: Path) -> None:
    with AnyReader([bag]) as reader:
        durable = {
            each.topic
            for each in reader.connections
            if isinstance(each.ext, ConnectionExtRosbag2)
            and each.ext.offered_qos_profiles[0].durability.name == "TRANSIENT_LOCAL"
        }
    models = {f"/{robot}/robot_description" for robot in ("R_1", "R_1_2")}
    assert durable == {"/tf_static", "/radarsim/legend", "/scene", "/map", *models}


def test_times_are_of_ticks_and_in_order(run: RecordedRun, bag: Path) -> None:
    times = [message.time for message in BagReader(bag).messages()]
    assert times == sorted(times)
    assert times[-1] // 10_000_000 == run.calls[-1].tick


@pytest.mark.parametrize("seed", range(10))
def test_torn_recording_is_repaired(
    seed: int, run: RecordedRun, bag: Path, tmp_path: Path
) -> None:
    content = (bag / file_name(bag)).read_bytes()
    torn = tmp_path / "torn"
    create_folder(torn)
    cut = random.Random(seed).randrange(1500, len(content))
    (torn / file_name(torn)).write_bytes(content[:cut])
    before = list(BagReader(torn).messages())
    assert repair(torn) == len(before)
    reader = BagReader(torn)
    calls = list(reader.calls())
    assert calls == run.calls[: len(calls)]
    assert reader.is_complete
    with AnyReader([torn]) as other:
        assert other.message_count == len(before)
    assert sorted(path.name for path in torn.iterdir()) == [
        "metadata.yaml",
        file_name(torn),
    ]


def test_recording_that_goes_on_is_not_repaired(
    run: RecordedRun, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    create_folder(folder)
    writer = BagWriter(folder, run.info.to_text())
    before = (folder / file_name(folder)).read_bytes()
    assert BagReader(folder).is_being_written
    with pytest.raises(RecordingError, match="still being recorded"):
        repair(folder)
    assert (folder / file_name(folder)).read_bytes() == before
    writer.close()
    assert not BagReader(folder).is_being_written
    repair(folder)


def test_recording_in_a_renamed_folder_is_read(bag: Path, tmp_path: Path) -> None:
    renamed = tmp_path / "renamed"
    create_folder(renamed)
    content = (bag / file_name(bag)).read_bytes()
    (renamed / file_name(bag)).write_bytes(content)
    messages = list(BagReader(renamed).messages())
    assert messages == list(BagReader(bag).messages())
    assert repair(renamed) == len(messages)
    assert sorted(path.name for path in renamed.iterdir()) == [
        "metadata.yaml",
        file_name(renamed),
    ]


def test_changed_byte_in_a_chunk_is_noticed(bag: Path, tmp_path: Path) -> None:
    content = bytearray((bag / file_name(bag)).read_bytes())
    content[len(content) // 2] ^= 1
    broken = tmp_path / "broken"
    create_folder(broken)
    (broken / file_name(broken)).write_bytes(content)
    reader = BagReader(broken)
    assert len(list(reader.messages())) < len(list(BagReader(bag).messages()))
    assert not reader.is_complete


def test_wrong_folder_suggests_its_neighbours(bag: Path, tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    right = shutil.copytree(bag, runs / "monday")
    shutil.copytree(bag, runs / "tuesday")
    for wrong, expected in {
        runs / "munday": r"no such recording \(did you mean 'monday'\?\), .* \*\.mcap$",
        runs / "friday_noon": r"no such recording, .* \*\.mcap$",
        runs: "not a recording, expected one of .*'monday', 'tuesday'",
        next(
            right.glob("*.mcap")
        ): rf"no such recording \(did you mean '{right}'\?\), ",
        tmp_path / "nowhere" / "run": r"no such recording, .* \*\.mcap$",
    }.items():
        with pytest.raises(RecordingError, match=expected):
            BagReader(wrong)


def test_folder_below_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="file"):
        create_folder(tmp_path / "file" / "run")


def test_other_files_are_no_recordings(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="not a recording, expected the folder"):
        BagReader(tmp_path)
    (tmp_path / file_name(tmp_path)).write_bytes(b"not MCAP")
    with pytest.raises(RecordingError, match="not a recording of radarsim"):
        BagReader(tmp_path)
