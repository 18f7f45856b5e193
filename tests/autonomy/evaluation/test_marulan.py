"""The trial scene in clear air, dust, smoke and rain, beam by beam at one seed."""

from functools import cache
from typing import Any, Final

import numpy as np
import pytest
from numpy.typing import NDArray

import radarsim
from radarsim import Pose2, Scan, Scene
from radarsim.geometry import Floats
from radarsim.presets.robots import load_robot
from radarsim.raycast.attenuation import EventKind
from radarsim.rng import generator_for
from radarsim.simulation.simulation import Simulation

NAME: Final = "marulan_trial"
SENSOR: Final = (-16 + 0.2085, 0.0, 0.0)  # on a P3AT at RobotStart1
CELL: Final = 0.2  # m, the range cell of hss94_marulan
RADARS: Final = ("hss94_marulan", "radar")
FAR_HOKUYO: Final[dict[str, Any]] = {"max_range": 80}
SMOKE_DB: Final = 0.5 * 23  # light in a metre of the cloud

Mask = NDArray[np.bool_]


@cache
def scene(variant: str = "clear") -> Scene:
    return radarsim.load_map(f"{NAME}@{variant}")


def scans(sensor: str, variant: str, count: int, **settings: Any) -> list[Scan]:
    scanner = radarsim.load_sensor(sensor, **settings)
    rng = generator_for(0, sensor)
    return [scanner.scan(scene(variant), SENSOR, rng) for _ in range(count)]


def scan(sensor: str, variant: str = "clear", **settings: Any) -> Scan:
    return scans(sensor, variant, 1, **settings)[0]


def seen_by(one: Scan) -> set[str]:
    return {target.object for target in one.echoes.targets.values()}


def cloud_bounds(variant: str) -> tuple[Floats, Floats]:
    (cloud,) = (p for p in scene(variant).parts if p.object_name == "cloud")
    return cloud.vertices.min(axis=0), cloud.vertices.max(axis=0)


def path_through_dust(angles: Floats) -> tuple[Floats, Floats]:
    """Return where beams enter the box of dust, and how far they go in it, m.

    Those that miss it enter it at inf.
    """
    low, high = (corner[:2] - SENSOR[:2] for corner in cloud_bounds("dust"))
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    directions[np.abs(directions) < 1e-12] = 1e-12
    near, far = np.sort([low / directions, high / directions], axis=0)
    enter, leave = near.max(axis=1), far.min(axis=1)
    missed = (enter >= leave) | (enter < 0)
    return np.where(missed, np.inf, enter), np.where(missed, 0.0, leave - enter)


def path_in_smoke(angles: Floats) -> Floats:
    """Return how far beams go inside the column of smoke, m."""
    low, high = cloud_bounds("smoke")
    middle, radius = (low + high)[:2] / 2 - SENSOR[:2], (high - low)[0] / 2
    beside = middle[0] * np.sin(angles) - middle[1] * np.cos(angles)
    half = np.sqrt(np.maximum(radius**2 - beside**2, 0.0))
    ahead = middle[0] * np.cos(angles) + middle[1] * np.sin(angles) > 0
    return np.where(ahead, 2 * half, 0.0)


def unchanged(clear: Scan, other: Scan) -> Mask:
    """Return which ranges in clear air stay the same to within a cell."""
    found = np.isfinite(clear.ranges)
    with np.errstate(invalid="ignore"):  # inf - inf, of beams that are left out
        return np.asarray((np.abs(other.ranges - clear.ranges) <= CELL)[found])


def test_all_variants_hold_the_same_objects() -> None:
    objects = radarsim.load_map(NAME).parts
    more = {"clear": [], "dust": ["cloud"], "smoke": ["cloud"], "rain": []}
    for variant, added in more.items():
        parts = scene(variant).parts
        assert [p.object_name for p in parts[len(objects) :]] == added
        for one, other in zip(objects, parts, strict=False):
            assert one.object_name == other.object_name
            assert np.array_equal(one.vertices, other.vertices)


def test_dust_is_10_m_deep_between_sensor_and_objects() -> None:
    low, high = cloud_bounds("dust")
    assert high[0] - low[0] == 10
    assert low[0] > SENSOR[0]
    beside = {"ground", "post", "crate_3"}
    others = [p for p in scene().parts if p.object_name not in beside]
    assert min(p.vertices[:, 0].min() for p in others) > high[0]
    material = scene("dust").materials["dust_cloud"]
    assert material.radar_db[2] < 0.02  # dB/m at 94 GHz, the bound that was measured


@pytest.mark.parametrize("sensor", ["sick", "hss94_marulan"])
def test_every_object_is_seen_and_nothing_else(sensor: str) -> None:
    one = scan(sensor)
    objects = {part.object_name for part in scene().parts} - {"ground"}
    assert seen_by(one) == objects
    found = np.isfinite(one.ranges)
    assert one.ranges[found].min() > 8
    assert one.ranges[found].max() < 25
    assert (np.abs(one.angles[found]) < np.radians(100)).all()


@pytest.mark.parametrize("variant", ["clear", "dust", "smoke", "rain"])
def test_start_poses_are_free(variant: str) -> None:
    simulation = Simulation(scene(variant))
    for start in scene(variant).starts:
        wanted = Pose2(start.pose.x, start.pose.y, start.pose.yaw)
        vehicle = simulation.spawn("R", load_robot("P3AT"), wanted)
        assert vehicle is not None
        assert vehicle.robot.pose == wanted


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["dust", "smoke", "rain"])
@pytest.mark.parametrize("sensor", RADARS)
def test_radar_measures_as_in_clear_air(sensor: str, variant: str) -> None:
    same = unchanged(scan(sensor), scan(sensor, variant))
    assert len(same) > 30
    assert same.mean() >= 0.99


@pytest.mark.parametrize("variant", ["dust", "smoke"])
@pytest.mark.parametrize("sensor", RADARS)
def test_radar_with_a_threshold_ignores_clouds(sensor: str, variant: str) -> None:
    clear = scan(sensor, echo_threshold=0.001).ranges
    cloudy = scan(sensor, variant, echo_threshold=0.001).ranges
    assert (np.isfinite(cloudy) == np.isfinite(clear)).all()


def test_laser_answers_inside_the_dust() -> None:
    clear, dusty = scan("physical"), scan("physical", "dust")
    enter, depth = path_through_dust(clear.angles)
    found = np.isfinite(clear.ranges)
    behind = np.isfinite(enter[found])
    assert depth[found][behind].min() >= 10
    wrong = ~unchanged(clear, dusty)
    assert np.count_nonzero(behind) > 30
    assert wrong[behind].mean() > 0.5
    assert not wrong[~behind].any()
    deep = depth >= 10  # where a share of 0.01 gets through
    into = dusty.ranges[deep] - enter[deep]
    assert (into > -1e-4).all()
    assert (into < depth[deep]).mean() > 0.9
    assert np.ptp(into[into < depth[deep]]) > 1


@pytest.mark.parametrize("variant", ["dust", "smoke"])
def test_sick_measures_the_same_through_every_cloud(variant: str) -> None:
    clear = scan("sick").ranges
    assert scan("sick", variant).ranges == pytest.approx(clear, abs=1e-9)


def test_hokuyo_is_blinded_only_where_smoke_is_thick() -> None:
    clear = scan("hokuyo", **FAR_HOKUYO)
    smoky = scan("hokuyo", "smoke", **FAR_HOKUYO).ranges
    inside = path_in_smoke(clear.angles)
    budget = 25 / SMOKE_DB  # m; one-way, half of its 50 dB
    blind = inside > budget + 0.1
    assert np.count_nonzero(blind) > 40
    assert (smoky[blind] == 0).all()
    thin = inside < budget - 0.1
    assert smoky[thin].tolist() == clear.ranges[thin].tolist()
    assert np.isfinite(smoky[thin]).any()


@pytest.mark.slow
def test_smoke_absorbs_the_light_of_a_physical_laser() -> None:
    clear = scan("physical")
    last = scan("physical", "smoke", return_mode="last").ranges
    blind = path_in_smoke(clear.angles) > 20 / SMOKE_DB + 0.1  # m; half of its 40 dB
    assert np.count_nonzero(blind & np.isfinite(clear.ranges)) > 20
    assert np.isinf(last[blind]).all()


@pytest.mark.parametrize("mode", ["first", "strongest"])
@pytest.mark.parametrize("sensor", RADARS)
def test_rain_shows_as_speckle_absent_in_clear_air(sensor: str, mode: str) -> None:
    empty = np.isinf(scan(sensor, return_mode=mode).ranges)
    near = 5.0  # m; nearer than any thing
    for one in scans(sensor, "clear", 10, return_mode=mode):
        assert not (one.ranges < near).any()
        assert EventKind.RAIN not in one.echoes.kinds
    wet = np.array([s.ranges for s in scans(sensor, "rain", 10, return_mode=mode)])
    assert 0 < np.mean(wet[:, empty] < near) < 0.1
