"""The lines of recordings by their times."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import recorded_runs
from recorded_runs import RecordedRun

from radarsim.addons.recording.bag import BagReader
from radarsim.addons.recording.recorders import EventType
from radarsim.addons.web.playback import RecordedLines
from radarsim.errors import RecordingError
from radarsim.protocol.reports import RangeScan
from radarsim.scene.scene import Scene


@contextmanager
def opened(folder: Path) -> Iterator[RecordedLines]:
    bag = BagReader(folder)
    with bag.open() as file:
        yield RecordedLines(file, bag.info)


@pytest.fixture(scope="module")
def run(foliage_room: Scene) -> RecordedRun:
    return recorded_runs.run_two_clients(foliage_room, ticks=250)


@pytest.fixture(scope="module")
def folder(run: RecordedRun, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recording") / "run"
    recorded_runs.write_run(run, folder)
    return folder


def test_robots_are_found_with_their_classes_and_times(folder: Path) -> None:
    with opened(folder) as recording:
        robots = [(robot.name, robot.class_name) for robot in recording.robots]
    assert robots == [("R 1", "P3AT_Compare"), ("R_1", "P3AT")]
    first, second = recording.robots
    assert first.joined == recording.start == 0
    assert second.joined == 0.26  # after a tenth of its ticks
    assert first.left == 2.5
    assert second.left == recording.end == 2.51


def test_the_lines_of_all_seconds_are_those_that_clients_were_sent(
    folder: Path, run: RecordedRun
) -> None:
    with opened(folder) as recording:
        read = [line for second in range(3) for line in recording.read(second)]
    for robot in recording.robots:
        lines = run.sent[robot.client].decode("latin-1").splitlines()
        own = [line.line for _, line in read if line.robot == robot.name]
        # What came before the robot, as the greeting of its client, is not of it.
        assert own == lines[-len(own) :]
        assert len(own) > 100
    times = [time for time, _ in read]
    assert times == sorted(times)


def test_a_second_is_read_without_the_others(folder: Path) -> None:
    with opened(folder) as recording:
        lines = recording.read(1)
    assert all(1 <= time < 2 for time, _ in lines)
    scans = [line for _, line in lines if isinstance(line.report, RangeScan)]
    assert len(scans) == 30  # of three scanners, ten times a second


def test_a_file_that_breaks_off_says_how_it_is_made_whole(
    folder: Path, tmp_path: Path
) -> None:
    broken = tmp_path / "broken"
    broken.mkdir()
    (file,) = folder.glob("*.mcap")
    (broken / "broken_0.mcap").write_bytes(file.read_bytes()[:-900])
    expected = pytest.raises(RecordingError, match="radarsim recording repair")
    with expected, opened(broken):
        pass


def test_damage_is_reported_and_the_rest_is_read(
    folder: Path, run: RecordedRun, tmp_path: Path
) -> None:
    damaged = tmp_path / "damaged"
    recorded_runs.write_run(run, damaged)
    (file,) = damaged.glob("*.mcap")
    data = bytearray(file.read_bytes())
    middle = len(data) // 2
    data[middle : middle + 40] = bytes(40)
    file.write_bytes(data)
    errors = 0
    with opened(damaged) as recording, opened(folder) as whole:
        for second in range(3):
            try:
                read = [line.line for _, line in recording.read(second)]
                assert read == [line.line for _, line in whole.read(second)]
            except RecordingError as error:
                assert "is damaged" in str(error)  # noqa: PT017 - of some seconds
                assert "radarsim recording repair" in str(error)  # noqa: PT017
                errors += 1
    assert errors in (1, 2)


def test_a_run_in_which_nobody_was_sent_anything_is_refused(
    run: RecordedRun, tmp_path: Path
) -> None:
    events = [event for event in run.events if event.type >= EventType.WAIT]
    events = [event for event in events if event.type <= EventType.END]
    recorded_runs.write_run(run._replace(events=events), tmp_path / "run")
    expected = pytest.raises(RecordingError, match="nothing was sent")
    with expected, opened(tmp_path / "run"):
        pass


def test_robots_of_one_name_stay_apart(foliage_room: Scene, tmp_path: Path) -> None:
    run = recorded_runs.run_two_clients(foliage_room, ticks=20)
    events = [
        event._replace(data=event.data.replace(b"{Name R_1}", b"{Name r 1}"))
        for event in run.events
    ]
    recorded_runs.write_run(run._replace(events=events), tmp_path / "run")
    with opened(tmp_path / "run") as recording:
        assert [robot.name for robot in recording.robots] == ["R 1", "r 1_2"]
