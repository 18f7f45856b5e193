"""Recordings as arrays and tables: what the clients of the run were sent."""

import sys
from pathlib import Path

import numpy as np
import pytest
import xarray
from recorded_runs import RecordedRun

import radarsim
from radarsim.addons.recording.bag import BagMessage, BagWriter
from radarsim.addons.recording.bag_folder import create_folder, file_name
from radarsim.addons.recording.cdr import encode
from radarsim.addons.recording.recording import Recording
from radarsim.client.session import Session
from radarsim.errors import MissingPackage, RecordingError
from radarsim.protocol.echoes import EchoLine
from radarsim.protocol.reports import GroundTruth, RangeScan, Report
from radarsim.scene.scene import Scene


@pytest.fixture(scope="module")
def recording(bag: Path) -> Recording:
    return radarsim.load_recording(bag)


def reports_of(run: RecordedRun, client: int) -> list[Report]:
    return Session().receive(run.sent[client])


def scans_of(run: RecordedRun) -> list[RangeScan]:
    return [
        report
        for report in reports_of(run, 1)
        if isinstance(report, RangeScan) and report.name == "Hokuyo"
    ]


def test_scans_are_those_of_the_client(run: RecordedRun, recording: Recording) -> None:
    scans = scans_of(run)
    found = recording.scans["R_1/Hokuyo"]
    assert found.times.tolist() == [scan.time for scan in scans]
    expected = np.array([scan.ranges for scan in scans], np.float32)
    hit = np.isfinite(found.ranges)
    assert 0 < hit.sum() < hit.size
    np.testing.assert_array_equal(found.ranges[hit], expected[hit])
    assert (expected[~hit] >= np.float32(found.range_max)).all()
    assert found.angles[-1] == pytest.approx(scans[0].fov / 2, abs=1e-4)
    assert found.angles[0] == pytest.approx(-scans[0].fov / 2, abs=1e-4)
    assert found.frame == "R_1/Hokuyo"
    assert recording.is_complete
    assert recording.info == run.info


def test_poses_are_those_of_the_client(run: RecordedRun, recording: Recording) -> None:
    truths = [each for each in reports_of(run, 2) if isinstance(each, GroundTruth)]
    found = recording.poses["R_1_2/ground_truth"]
    expected = np.array([truth.pose.numbers() for truth in truths])
    np.testing.assert_allclose(found.poses, expected, atol=1e-12)
    assert (found.frame, len(found.times)) == ("map", len(truths))
    assert recording.poses["R_1/odom"].frame == "R_1/odom"


def test_echoes_are_those_of_the_client(run: RecordedRun, recording: Recording) -> None:
    lines = [
        each
        for each in reports_of(run, 1)
        if isinstance(each, EchoLine) and each.name == "lms200"
    ]
    groups = [line.echoes for line in lines if line.echoes is not None]
    found = recording.echoes["R_1/lms200"]
    assert len(found) == sum(len(group.beams) for group in groups)
    ranges = np.concatenate([group.ranges for group in groups])
    np.testing.assert_allclose(found.ranges, ranges, rtol=1e-6)
    kinds = [kind for group in groups for kind in group.kinds]
    assert found.kinds.tolist() == kinds
    objects = [group.object for group in groups for _ in group.beams]
    assert found.objects.tolist() == objects
    assert "foliage" in found.materials


def test_tree_has_a_dataset_for_each_scanner(recording: Recording) -> None:
    tree = recording.to_xarray()
    scan = tree["R_1/lms200/scan"]
    series = recording.scans["R_1/lms200"]
    ahead = scan.ranges.sel(angle=0, method="nearest")
    np.testing.assert_array_equal(ahead, series.ranges[:, len(series.angles) // 2])
    assert tree["R_1_2/ground_truth"].x.dims == ("time",)
    materials = tree["R_1/lms200/echoes"].material
    assert (
        materials.to_numpy().tolist()
        == recording.echoes["R_1/lms200"].materials.tolist()
    )


def test_scanner_with_new_beams_goes_on_under_another_name(tmp_path: Path) -> None:
    from radarsim.addons.recording.messages import laser_scan

    create_folder(tmp_path / "run")
    writer = BagWriter(tmp_path / "run", {"version": "1"})
    for tick, count in enumerate((3, 3, 5)):
        message = laser_scan(
            "/R1/laser/scan",
            tick / 100,
            "R1/laser",
            np.arange(float(count)),
            fov=1.0,
            resolution=1 / (count - 1),
            min_range=0.0,
            max_range=8.0,
            scan_time=0.1,
        )
        data = encode(message)
        writer.write(BagMessage(message.topic, message.type, data, tick * 10_000_000))
    writer.close()
    scans = radarsim.load_recording(tmp_path / "run").scans
    shapes = {name: series.ranges.shape for name, series in scans.items()}
    assert shapes == {"R1/laser": (2, 3), "R1/laser_2": (1, 5)}


def test_torn_recording_is_read_as_far_as_it_goes(
    recording: Recording, tmp_path: Path
) -> None:
    content = (recording.folder / file_name(recording.folder)).read_bytes()
    torn = tmp_path / "torn"
    create_folder(torn)
    (torn / file_name(torn)).write_bytes(content[: len(content) * 2 // 3])
    found = radarsim.load_recording(torn)
    assert not found.is_complete
    ranges = found.scans["R_1/lms200"].ranges
    whole = recording.scans["R_1/lms200"].ranges
    assert 0 < len(ranges) < len(whole)
    np.testing.assert_array_equal(ranges, whole[: len(ranges)])


def test_other_messages_are_refused(tmp_path: Path) -> None:
    from radarsim.addons.recording.messages import string

    create_folder(tmp_path / "run")
    writer = BagWriter(tmp_path / "run", {"version": "1"})
    message = string("/R1/laser/scan", "no scan")
    writer.write(BagMessage(message.topic, message.type, encode(message), 0))
    writer.close()
    with pytest.raises(RecordingError, match="expected topics of a radarsim run"):
        radarsim.load_recording(tmp_path / "run")


def test_scan_is_a_dataset_and_echoes_a_frame(foliage_room: Scene) -> None:
    radar = radarsim.load_sensor("radar", return_mode="all")
    scan = radar.scan(foliage_room, (-8, 0, 0), radarsim.generator_for(0, "a look"))
    dataset = scan.to_xarray()
    assert isinstance(dataset, xarray.Dataset)
    np.testing.assert_array_equal(dataset.ranges, scan.ranges)
    np.testing.assert_array_equal(dataset.rays, scan.rays)
    frame = scan.echoes.to_pandas()
    assert len(frame) == len(scan.echoes) > 100
    rows = [
        (beam, each["range"], each["kind"], each["material"])
        for beam, echoes in enumerate(scan.echoes.to_lists())
        for each in echoes
    ]
    columns = frame[["beam", "range", "kind", "material"]]
    assert list(columns.itertuples(index=False, name=None)) == rows


def test_missing_package_is_named_with_its_extra(
    recording: Recording, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(MissingPackage, match=r"xarray.*'\.\[tables\]'"):
        recording.to_xarray()
