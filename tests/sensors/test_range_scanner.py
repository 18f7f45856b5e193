import math

import numpy as np
import pytest
from parts import block

import radarsim
from radarsim import Material, Part, Pose3, Scene, StartPose
from radarsim.geometry import Floats
from radarsim.rng import generator_for
from radarsim.sensors.range_scanner import sensor_pose

WALL = Material("wall")
LEAF = Material("leaf", density=0.5)
SMOKE = Material("smoke", density=0.0, laser_density=0.5, solid=False)


def room(*parts: Part) -> Scene:
    """Return a room of 10 m by 10 m around the origin, with parts in it."""
    return Scene("room", "Room", (block("room", WALL, (10, 10, 4), (0, 0, 1)), *parts))


def wall_distances(angles: Floats) -> Floats:
    distances: Floats = 5 / np.maximum(np.abs(np.cos(angles)), np.abs(np.sin(angles)))
    return distances


def test_ideal_laser_measures_a_square_room() -> None:
    scan = radarsim.load_sensor("laser").scan(room(), (0, 0, 0))
    assert scan.ranges == pytest.approx(wall_distances(scan.angles), abs=1e-6)
    assert scan.rays is None


def test_radar_without_side_rays_measures_a_square_room() -> None:
    radar = radarsim.load_sensor("radar", side_offset_uu=0)
    scan = radar.scan(room(), (0, 0, 0), generator_for(0))
    assert scan.ranges == pytest.approx(wall_distances(scan.angles), abs=1e-6)


def test_beam_is_spent_at_power_over_density() -> None:
    bush = block("bush", LEAF, (4, 6, 2), (3, 0, 1))  # from x = 1 to the wall
    radar = radarsim.load_sensor("radar", side_offset_uu=0, penetration_power=1)
    scan = radar.scan(room(bush), (0, 0, 0), generator_for(0))
    assert scan.ranges[90] == pytest.approx(1 + 1 / 0.5, abs=1e-6)


def test_no_surface_within_range_gives_inf() -> None:
    laser = radarsim.load_sensor("laser", max_range=4.9)
    scan = laser.scan(room(), (0, 0, 0))
    assert np.isinf(scan.ranges).all()


def test_ranges_below_the_minimum_range_are_kept() -> None:
    near = block("near", WALL, (0.1, 2, 2), (0.09, 0, 1))
    scan = radarsim.load_sensor("sick").scan(room(near), (0, 0, 0))
    assert scan.ranges[90] == pytest.approx(0.04, abs=1e-6)
    assert scan.range_min == 0.1


@pytest.mark.parametrize(
    ("sensor", "expected"),
    [
        pytest.param("laser", 5.0, id="ideal laser passes"),
        pytest.param("sick", 5.0, id="sick passes"),
        pytest.param("radar", 5.0, id="radar passes"),
        pytest.param("hokuyo", 0.0, id="hokuyo is blinded"),
    ],
)
def test_smoke_blinds_only_the_hokuyo(sensor: str, expected: float) -> None:
    cloud = block("cloud", SMOKE, (2, 2, 2), (2, 0, 1))
    settings = {"max_range": 80.0}
    if sensor == "radar":
        settings["side_offset_uu"] = 0
    scanner = radarsim.load_sensor(sensor, **settings)
    scan = scanner.scan(room(cloud), (0, 0, 0), generator_for(0))
    ahead = int(np.argmin(np.abs(scan.angles)))
    along = 1 / math.cos(scan.angles[ahead])
    assert scan.ranges[ahead] == pytest.approx(expected * along, abs=1e-6)


def test_range_of_a_side_ray_counts_from_its_own_start() -> None:
    step = block("step", WALL, (1, 5, 2), (3.5, 2.55, 1))  # face at x = 3 from y = 0.05
    radar = radarsim.load_sensor("radar", fov_deg=2, resolution_deg=1)
    scene, rng = room(step), generator_for(7)
    found = {-1: set[float](), 0: set[float](), 1: set[float]()}
    for _ in range(60):
        scan = radar.scan(scene, (0, 0, 0), rng)
        assert scan.rays is not None
        found[int(scan.rays[1])].add(round(float(scan.ranges[1]), 6))
    assert found == {-1: {5.0}, 0: {5.0}, 1: {3.0}}


def test_side_ray_behind_a_surface_is_replaced_by_the_centre_ray() -> None:
    fence = block("fence", WALL, (4, 0.02, 2), (1, 0.05, 1))  # 5 cm to the left
    scene = room(fence)
    radar = radarsim.load_sensor("radar", ray_weights=(0, 0, 1), side_mode="lateral")
    scan = radar.scan(scene, (0, 0, 0), generator_for(0))
    assert scan.rays is not None
    assert set(scan.rays.tolist()) == {0}
    centre = radarsim.load_sensor("radar", side_offset_uu=0)
    assert (
        scan.ranges.tolist()
        == centre.scan(scene, (0, 0, 0), generator_for(0)).ranges.tolist()
    )


def test_side_ray_behind_foliage_is_kept() -> None:
    hedge = block("hedge", LEAF, (4, 0.02, 2), (1, 0.05, 1))
    radar = radarsim.load_sensor("radar", ray_weights=(0, 0, 1), side_mode="lateral")
    scan = radar.scan(room(hedge), (0, 0, 0), generator_for(0))
    assert scan.rays is not None
    assert set(scan.rays.tolist()) == {1}


def test_pose_of_three_numbers_is_above_the_floor() -> None:
    scene = Scene("s", "S", (), (StartPose("RobotStart1", Pose3(0, 0, 2)),))
    assert sensor_pose(scene, (1, 2, 0.5)) == Pose3(1, 2, 2.346, 0, 0, 0.5)
    assert sensor_pose(scene, (1, 2, 3, 0.1, 0.2, 0.3)).z == 3


@pytest.mark.parametrize(
    "pose",
    [
        pytest.param((1, 2), id="two"),
        pytest.param((1, 2, 3, 4), id="four"),
        pytest.param((1, math.nan, 3), id="nan"),
        pytest.param((1, 2, 3, 4, 5, math.inf), id="infinite"),
    ],
)
def test_invalid_pose_is_rejected(pose: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="expected three or six finite numbers"):
        sensor_pose(room(), pose)


def test_scan_as_dict_distinguishes_no_return_from_blindness() -> None:
    cloud = block("cloud", SMOKE, (2, 0.2, 2), (2, 0, 1))
    hokuyo = radarsim.load_sensor("hokuyo", fov_deg=90, resolution_deg=45, max_range=5)
    plain = hokuyo.scan(room(cloud), (0, 0, 0)).to_dict()
    assert plain["ranges"] == [None, 0.0, None]
    assert plain["rays"] is None
    assert plain["angle_min"] == pytest.approx(-math.pi / 4)
    assert plain["angle_increment"] == pytest.approx(math.pi / 4)
    assert (plain["range_min"], plain["range_max"]) == (0.1, 5)
    assert plain["pose"] == [0, 0, 0.346, 0, 0, 0]
