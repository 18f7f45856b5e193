"""Scans from many poses have the values of single scans in the same order."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from joint_scans import scan_together

from radarsim.geometry import Pose3
from radarsim.raycast import tracer as tracer_module
from radarsim.raycast.rays import Boxes
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.scene.scene import Scene
from radarsim.sensors import scan_batch as scan_batch_module
from radarsim.sensors.range_scanner import RangeScanner, load_sensor
from radarsim.sensors.scan_batch import ScanBatch, ScanRequest, take_scans

APART = {"side_mode": "perpendicular", "side_offset_uu": 100}
SENSORS: dict[str, tuple[str, dict[str, Any]]] = {
    "radar": ("radar", {}),
    "laser": ("laser", {}),
    "noisy": ("radar", {"range_noise": 0.1, "return_mode": "strongest"}),
    "chosen by incidence": ("radar", {"incidence_weights": True}),
    "rays that start apart": ("radar", APART),
}


def drive(count: int) -> list[tuple[float, float, float]]:
    """Return poses along a drive through the room and its hedge."""
    yaws = np.linspace(0.0, 6.0, count)
    return [(-8.0 + 0.1 * i, np.sin(0.3 * i), yaw) for i, yaw in enumerate(yaws)]


def one_by_one(
    sensor: RangeScanner, scene: Scene, poses: Sequence[Any], seed: int
) -> tuple[bytes, bytes | None]:
    rng = generator_for(seed)
    scans = [sensor.scan(scene, pose, rng) for pose in poses]
    ranges = np.array([scan.ranges for scan in scans])
    if not sensor.has_side_rays:
        return ranges.tobytes(), None
    return ranges.tobytes(), np.array([scan.rays for scan in scans]).tobytes()


@pytest.mark.parametrize(("name", "settings"), SENSORS.values(), ids=SENSORS)
def test_scans_from_many_poses_equal_single_scans(
    name: str, settings: dict[str, Any], foliage_room: Scene
) -> None:
    sensor, poses = load_sensor(name, **settings), drive(120)
    many = sensor.scan_many(foliage_room, poses, generator_for(3))
    assert many.ranges.shape == (120, len(sensor.angles))
    rays = None if many.rays is None else many.rays.tobytes()
    expected = one_by_one(sensor, foliage_room, poses, 3)
    assert (many.ranges.tobytes(), rays) == expected


@pytest.mark.parametrize("threads", [2, 7])
@pytest.mark.parametrize(
    ("name", "room"), [("radar", "foliage_room"), ("physical", "smoke_room")]
)
def test_number_of_threads_does_not_matter(
    name: str,
    room: str,
    threads: int,
    request: pytest.FixtureRequest,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene: Scene = request.getfixturevalue(room)
    sensor, poses = load_sensor(name), drive(250)
    expected = one_by_one(sensor, scene, poses, 4)[0]
    monkeypatch.setattr(scan_batch_module, "thread_count", lambda: threads)
    many = sensor.scan_many(scene, poses, generator_for(4))
    assert many.ranges.tobytes() == expected


@pytest.mark.parametrize("name", ["radar", "physical", "hss94_marulan"])
def test_many_scans_are_taken_in_a_few_batches(
    name: str, foliage_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    sensor, batches = load_sensor(name), []

    class Counted(ScanBatch):
        def trace(self, *args: Any, **options: Any) -> None:
            batches.append(self)
            super().trace(*args, **options)

    monkeypatch.setattr(scan_batch_module, "ScanBatch", Counted)
    monkeypatch.setattr(scan_batch_module, "Scan", None)  # none is built
    sensor.scan_many(foliage_room, drive(60), generator_for(3))
    rays = 60 * len(sensor.pattern.shares)
    assert len(batches) <= 1 + rays // scan_batch_module.CHUNK_RAYS * 2


def test_poses_are_returned_in_space(empty_room: Scene) -> None:
    laser = load_sensor("laser", fov_deg=2)
    flat = laser.scan_many(empty_room, np.array([[1.0, 2.0, 0.5]]))
    assert flat.poses.tolist() == [[1.0, 2.0, 0.346, 0.0, 0.0, 0.5]]
    tilted = laser.scan_many(empty_room, np.array([[1.0, 2.0, 3.0, 0.1, 0.2, 0.3]]))
    assert tilted.poses.tolist() == [[1.0, 2.0, 3.0, 0.1, 0.2, 0.3]]
    assert tilted.angles.tolist() == laser.angles.tolist()
    assert tilted.rays is None


def test_no_pose_gives_empty_arrays(empty_room: Scene) -> None:
    radar = load_sensor("radar")
    none = radar.scan_many(empty_room, [], generator_for(1))
    assert (none.poses.shape, none.ranges.shape) == ((0, 6), (0, 181))
    assert none.rays is not None
    assert none.rays.shape == (0, 181)


@pytest.mark.parametrize(
    ("poses", "named"),
    [
        (np.zeros(3), r"poses\[0\]: "),
        ([None], r"poses\[0\]: "),
        (
            [(0.0, 0.0, 0.0), (0.0, np.nan, 0.0)],
            r"poses\[1\]: pose \[0\.0, nan, 0\.0\]",
        ),
    ],
    ids=["one pose", "None", "nan"],
)
def test_what_is_no_pose_is_an_error_that_names_it(
    empty_room: Scene, poses: Any, named: str
) -> None:
    with pytest.raises(ValueError, match=f"^{named}"):
        load_sensor("laser").scan_many(empty_room, poses)


def crowd(count: int) -> tuple[list[Pose3], Boxes]:
    """Return sensors, and robots around them: their own, near them, and over them."""
    rng = np.random.Generator(np.random.PCG64(2))
    places, yaws = rng.uniform([-8, -4], [8, 4], (count, 2)), rng.uniform(-3, 3, count)
    tilts = np.where(np.arange(count) % 5 == 0, 0.1, 0.0)
    columns = zip(places.tolist(), tilts.tolist(), yaws.tolist(), strict=True)
    poses = [Pose3(x, y, 0.346, tilt, -tilt, yaw) for (x, y), tilt, yaw in columns]
    rows = np.zeros((3 * count, 8))
    rows[:count, :2] = places - 0.1
    rows[count : 2 * count, :2] = places + np.array([0.45, 0.0])
    rows[2 * count :, :2] = rng.uniform([-9, -5], [9, 5], (count, 2))
    rows[:, 2], rows[:, 7] = rng.uniform(-3, 3, len(rows)), np.arange(len(rows))
    rows[:, 4:7] = 0.5, 0.31, 0.25
    return poses, Boxes(rows)


def requests(sensors: list[RangeScanner], poses: list[Pose3]) -> list[ScanRequest]:
    """Return a scan from each pose, of the sensors in turn."""
    return [
        ScanRequest(sensors[i % len(sensors)], pose, generator_for(i), i)
        for i, pose in enumerate(poses)
    ]


@pytest.mark.parametrize("name", list(SENSORS))
def test_scans_among_robots_are_the_same_together_as_alone(
    name: str, foliage_room: Scene
) -> None:
    preset, settings = SENSORS[name]
    tracer, (poses, boxes) = tracer_of(foliage_room), crowd(12)
    sensors = [load_sensor(preset, **settings), load_sensor("laser")]
    together = scan_together(tracer, requests(sensors, poses), boxes)
    for scan, request in zip(together, requests(sensors, poses), strict=True):
        (alone,) = scan_together(tracer, [request], boxes)
        assert scan.to_dict() == alone.to_dict()
        for column in ("origins", "directions", "power", "carrier_id"):
            one, other = getattr(scan.cast, column), getattr(alone.cast, column)
            np.testing.assert_array_equal(one, other)


LASTS: dict[str, dict[str, Any]] = {
    "laser": {},
    "blinded": {"spent_reads": "zero", "max_range": 9.0},
    "noisy": {"range_noise": 0.1, "range_quantum": 0.01},
    "aside": APART,
    "all echoes": {"return_mode": "all"},
}


@pytest.mark.parametrize("settings", LASTS.values(), ids=LASTS)
def test_reported_ranges_are_those_of_scans_up_to_the_maximum(
    settings: dict[str, Any], foliage_room: Scene
) -> None:
    tracer, (poses, boxes) = tracer_of(foliage_room), crowd(12)
    sensors = [load_sensor("radar", **settings), load_sensor("laser")]
    taken = take_scans(tracer, requests(sensors, poses), boxes)
    scans = scan_together(tracer, requests(sensors, poses), boxes)
    for i, ((batch, row), scan) in enumerate(zip(taken, scans, strict=True)):
        most = sensors[i % 2].settings.max_range
        ranges = np.minimum(scan.ranges, most)
        assert batch.reported[row].tobytes() == ranges.tobytes()


@pytest.mark.parametrize("settings", LASTS.values(), ids=LASTS)
def test_ranges_of_a_crowd_are_the_same_on_one_thread_and_on_five(
    settings: dict[str, Any], foliage_room: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    tracer, (poses, boxes) = tracer_of(foliage_room), crowd(13)
    sensors = [load_sensor("radar", **settings)]
    requested = requests(sensors, poses)
    alone = [take_scans(tracer, [one], boxes)[0][0].reported for one in requested]
    monkeypatch.setattr(tracer_module, "RAYS_PER_THREAD", 1)
    monkeypatch.setattr(tracer_module, "thread_count", lambda: 5)
    together = take_scans(tracer, requests(sensors, poses), boxes)
    read = [batch.reported[row].tobytes() for batch, row in together]
    assert read == [each.tobytes() for each in alone]
