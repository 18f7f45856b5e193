"""Speckle, against its own probabilities worked out apart."""

import math
from typing import Any

import numpy as np
import pytest
from parts import brick

import radarsim
from radarsim import Material, Part, Pose3, Scan, Scene
from radarsim.geometry import Floats
from radarsim.presets.sensors import load_settings
from radarsim.rng import generator_for
from radarsim.scene.material import RAIN_RATES, RAIN_REFLECTIVITY_DB, rain_reflectivity
from radarsim.sensors.rain_and_clouds import contrast

WALL = Material("wall")
POURING = Material("rain", density=0.0, laser_density=0.0, solid=False, rain=100.0)
WIDE = {"fov_deg": 359, "resolution_deg": 0.1}


def take(world: Scene, seed: int = 0, **settings: Any) -> Scan:
    radar = radarsim.load_sensor("radar", **{**WIDE, "side_offset_uu": 0, **settings})
    return radar.scan(world, Pose3(0, 0, 0), generator_for(seed, "rain"))


def rainy_scene(*parts: Part) -> Scene:
    return Scene("rain", "Rain", parts, air=POURING)


WALLED = rainy_scene(brick(WALL, (20, 20, 9), (0, 0, 0)))


def chances(q: float, cell: float, max_range: float, from_: float = 1.0) -> Floats:
    """Return the probability that the nearest cell that shows is this one, by cell."""
    middles = np.arange(from_ + cell, max_range, cell)
    shows = np.exp(-(middles**2) / q)
    before = np.cumprod(np.concatenate([[1.0], 1 - shows[:-1]]))
    return np.asarray(shows * before)


def test_reflectivity_interpolates_its_table_by_power_laws() -> None:
    for band, row in enumerate(RAIN_REFLECTIVITY_DB):
        for rate, decibels in zip(RAIN_RATES, row, strict=True):
            found = 10 * math.log10(rain_reflectivity(band, rate))
            assert found == pytest.approx(decibels)
    assert rain_reflectivity(1, 0) == 0.0
    three = [rain_reflectivity(2, rate) for rate in (26, 31, 37)]
    slope = math.log(three[1] / three[0]) / math.log(31 / 26)
    assert math.log(three[2] / three[1]) / math.log(37 / 31) == pytest.approx(slope)
    assert rain_reflectivity(2, 0.5) < rain_reflectivity(2, 1)
    assert rain_reflectivity(2, 200) > rain_reflectivity(2, 100)


def test_contrast_follows_the_volume_of_the_cell() -> None:
    """At 77 GHz, 25 mm/h, 1.8 by 1.8 degrees and 0.25 m: -47.5 dBsm at 10 m."""
    beam = {"band_ghz": 77, "beamwidth_az_deg": 1.8, "beamwidth_el_deg": 1.8}
    cell = {"range_resolution": 0.25, "least_rcs_dbsm": -30}
    settings = load_settings("radar", **beam, **cell)
    q = contrast(settings, 25) / 10**2
    assert 10 * math.log10(q) == pytest.approx(-47.5 + 30, abs=0.05)
    further = contrast(settings, 25) / 50**2
    at_50 = -30 + 40 * math.log10(5)
    assert 10 * math.log10(further) == pytest.approx(-33.5 - at_50, abs=0.1)


@pytest.mark.parametrize("least", [-35.0, -25.0, -15.0])
def test_distance_of_the_nearest_cell_has_the_expected_distribution(
    least: float,
) -> None:
    settings: dict[str, Any] = {"least_rcs_dbsm": least, "max_range": 30}
    ranges = take(rainy_scene(), **settings).ranges
    wanted = chances(contrast(load_settings("radar", **settings), 100), 0.25, 30)
    n = len(ranges)
    shown = ranges[np.isfinite(ranges)]
    cells = np.rint((shown - 1.25) / 0.25).astype(int)
    assert shown == pytest.approx(1.25 + 0.25 * cells)
    counts = np.bincount(cells, minlength=len(wanted))[: len(wanted)]
    error = np.sqrt(wanted * (1 - wanted) / n)
    assert (np.abs(counts / n - wanted) <= 4.5 * error + 1e-3).all()


def test_wall_is_stronger_and_farther_than_rain() -> None:
    clear = Scene("clear", "Clear", WALLED.parts)
    for mode in ("last", "strongest"):
        wet = take(WALLED, return_mode=mode)
        assert wet.ranges.tolist() == take(clear, return_mode=mode).ranges.tolist()
    first = take(WALLED, return_mode="first").ranges
    assert 0.05 < np.mean(first < 9) < 0.95


def test_rain_is_an_echo_from_the_air() -> None:
    scan = take(WALLED, return_mode="all")
    lists = scan.to_dict()["echoes"]
    drops = [echo for beam in lists for echo in beam if echo["kind"] == "rain"]
    assert len(drops) > 20
    assert {echo["object"] for echo in drops} == {"air"}
    assert all(0 < echo["strength"] < 0.5 for echo in drops)
    assert all(echo["robot_passes"] for echo in drops)
    ordered = [[echo["range"] for echo in beam] for beam in lists]
    assert ordered == [sorted(beam) for beam in ordered]


def test_shower_shows_only_where_it_is() -> None:
    shower = brick(POURING, (2, 40, 9), (3, 0, 0))  # from x = 2 to 4
    world = Scene("shower", "Shower", (shower,))
    scan = take(world, least_rcs_dbsm=-35, fov_deg=20, resolution_deg=0.01)
    seen = np.isfinite(scan.ranges)
    x = scan.ranges[seen] * np.cos(scan.angles[seen])
    assert seen.mean() > 0.3
    assert (x.min(), x.max()) == (pytest.approx(2, abs=0.3), pytest.approx(4, abs=1))
    assert (x <= 4).all()
    q = contrast(load_settings("radar", least_rcs_dbsm=-35), 100)
    cells = np.arange(1.25, 4.1, 0.25)
    there = cells[(cells >= 2) & (cells < 4)]
    wanted = 1 - np.prod(1 - np.exp(-(there**2) / q))
    assert seen.mean() == pytest.approx(wanted, abs=0.08)


def test_same_seed_gives_the_same_rain_and_lasers_see_none() -> None:
    one, again, other = (
        take(WALLED, seed, return_mode="first").ranges for seed in (1, 1, 2)
    )
    assert one.tolist() == again.tolist()
    assert one.tolist() != other.tolist()
    laser = radarsim.load_sensor("laser", return_mode="first")
    assert np.isfinite(laser.scan(WALLED, Pose3(0, 0, 0)).ranges).all()
    assert laser.scan(WALLED, Pose3(0, 0, 0)).ranges.min() > 9


def test_rain_requires_an_rng() -> None:
    still = radarsim.load_sensor("radar", ray_choice="together")
    with pytest.raises(ValueError, match="no rng, expected a Generator"):
        still.scan(rainy_scene(), Pose3(0, 0, 0))


def test_rain_shows_for_every_arrangement_of_rays() -> None:
    for settings in (
        {"incidence_weights": True},
        {"side_mode": "cone", "beamwidth_az_deg": 2, "cone_rays": 3},
        {"ray_choice": "together", "range_noise": 0.1, "range_quantum": 0.2},
    ):
        scan = take(WALLED, return_mode="first", resolution_deg=1, **settings)
        assert 0.02 < np.mean(scan.ranges < 8) < 0.98, settings


@pytest.mark.parametrize("quantum", [0.1, 0.2, 0.25])
def test_rain_shows_at_every_multiple_of_the_quantum(quantum: float) -> None:
    ranges = take(rainy_scene(), range_quantum=quantum, least_rcs_dbsm=-30).ranges
    steps = np.rint(ranges[np.isfinite(ranges)] / quantum).astype(int)
    first = math.floor(1 / quantum) + 1
    assert set(range(first, first + 4)) <= set(steps.tolist())


def test_power_at_rain_accounts_for_losses_before_it() -> None:
    """In foliage of 0.1 per metre R metres take 0.1 R of the power."""
    leaf = Material("leaf", density=0.1)
    world = rainy_scene(brick(leaf, (60, 60, 9), (0, 0, 0)))
    scan = take(world, return_mode="all", least_rcs_dbsm=-40)
    echoes = scan.echoes
    drops = echoes.kinds == radarsim.EventKind.RAIN
    assert drops.sum() > 50
    assert echoes.power[drops] == pytest.approx(1 - 0.1 * echoes.ranges[drops])
    assert (echoes.strength[drops] <= 1 - 0.1 * echoes.ranges[drops]).all()
    assert (echoes.strength[drops] > 0).all()
