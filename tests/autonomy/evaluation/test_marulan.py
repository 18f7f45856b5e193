"""The trial scene in clear air, dust, smoke and rain, beam by beam at one seed."""

from functools import cache
from typing import Any, Final

import numpy as np
import pytest
from numpy.typing import NDArray

import radarsim
from radarsim import Scan, Scene
from radarsim.geometry import Floats
from radarsim.raycast.rays import EventKind
from radarsim.rng import generator_for

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


def path_in_smoke(angles: Floats) -> Floats:
    """Return how far beams go inside the column of smoke, m."""
    low, high = cloud_bounds("smoke")
    middle, radius = (low + high)[:2] / 2 - SENSOR[:2], (high - low)[0] / 2
    aside = middle[0] * np.sin(angles) - middle[1] * np.cos(angles)
    half = np.sqrt(np.maximum(radius**2 - aside**2, 0.0))
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


@pytest.mark.parametrize("sensor", ["sick", "hss94_marulan"])
def test_every_object_is_seen_and_nothing_else(sensor: str) -> None:
    one = scan(sensor)
    objects = {part.object_name for part in scene().parts} - {"ground"}
    assert seen_by(one) == objects
    found = np.isfinite(one.ranges)
    assert one.ranges[found].min() > 8
    assert one.ranges[found].max() < 25
    assert (np.abs(one.angles[found]) < np.radians(100)).all()


@pytest.mark.slow
@pytest.mark.parametrize("variant", ["dust", "smoke", "rain"])
@pytest.mark.parametrize("sensor", RADARS)
def test_radar_measures_as_in_clear_air(sensor: str, variant: str) -> None:
    same = unchanged(scan(sensor), scan(sensor, variant))
    assert len(same) > 30
    assert same.mean() >= 0.99


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
