"""Scanners with other settings, with a noise of one's own, and with seeds."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarsim
from radarsim.errors import PresetError
from radarsim.geometry import Floats, Pose3
from radarsim.scene.scene import Scene
from radarsim.sensors.range_scanner import load_sensor

PLACE = (-8.0, 0.0, 0.0)


def double(ranges: Floats, rng: np.random.Generator) -> Floats:
    """Double the ranges and add a noise that is easy to see."""
    return 2 * ranges + rng.uniform(0.0, 0.5, len(ranges))


@pytest.mark.parametrize("name", ["radar", "laser", "navtech_cts350x"])
def test_settings_are_those_of_the_preset_with_all_changes(name: str) -> None:
    first = load_sensor(name, max_range=20.0)
    second = first.with_settings(fov_deg=90).with_settings(min_range=0.5)
    known = load_sensor(name, max_range=20.0, fov_deg=90, min_range=0.5)
    assert second.settings == known.settings
    assert first.settings == load_sensor(name, max_range=20.0).settings


def test_settings_of_a_navtech_stay() -> None:
    radar = load_sensor("navtech_cts350x", fmcw={"azimuths": 8})
    changed = radar.with_settings(fmcw={"bins": 400}, fov_deg=90)
    assert changed.fmcw.settings.azimuths == 8
    assert changed.fmcw.settings.bins == 400


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"max_rnge": 3}, "did you mean 'max_range'"),
        ({"fov_deg": -1}, "fov_deg"),
        ({"fmcw": {"bins": 400}}, "no spectrum"),
    ],
)
def test_settings_that_are_wrong_are_errors(changes: Any, text: str) -> None:
    with pytest.raises(PresetError, match=text):
        load_sensor("radar").with_settings(**changes)


def test_seed_is_that_of_a_generator_of_the_sensor(foliage_room: Scene) -> None:
    radar = load_sensor("radar")
    by_seed = radar.scan(foliage_room, PLACE, 7).ranges
    rng = radarsim.generator_for(7, "radar")
    assert by_seed.tolist() == radar.scan(foliage_room, PLACE, rng).ranges.tolist()
    many = radar.scan_many(foliage_room, [PLACE], 7).ranges
    assert many[0].tolist() == by_seed.tolist()
    small = {"azimuths": 8, "bins": 400, "rays_across": 1, "rays_up": 1}
    navtech = load_sensor("navtech_cts350x", fmcw=small)
    one, other = (
        navtech.spectrum(foliage_room, PLACE, each).power
        for each in (7, radarsim.generator_for(7, "navtech_cts350x"))
    )
    assert np.array_equal(one, other)


def test_noise_of_ones_own_comes_after_the_scan(foliage_room: Scene) -> None:
    laser = load_sensor("laser")
    exact = laser.scan(foliage_room, PLACE).ranges
    noisy = laser.with_noise(double).scan(foliage_room, PLACE, 1).ranges
    added = noisy - 2 * exact
    assert ((added >= 0) & (added <= 0.5)).all()
    assert 0.2 < added.mean() < 0.3
    kept = laser.with_noise(double).with_settings(max_range=80.0)
    again = kept.scan(foliage_room, PLACE, 1).ranges
    assert again.tolist() == noisy.tolist()


@pytest.mark.parametrize("name", ["laser", "radar"])
def test_many_scans_have_the_noise_of_single_ones(
    foliage_room: Scene, name: str
) -> None:
    sensor = load_sensor(name).with_noise(double)
    poses = [(-8.0, y, 0.0) for y in (-1.0, 0.0, 1.0)]
    rng = radarsim.generator_for(5, "noise")
    single = [sensor.scan(foliage_room, pose, rng).ranges.tolist() for pose in poses]
    many = sensor.scan_many(foliage_room, poses, radarsim.generator_for(5, "noise"))
    assert many.ranges.tolist() == single


def test_noise_needs_a_generator_and_gives_as_many_ranges(foliage_room: Scene) -> None:
    laser = load_sensor("laser").with_noise(double)
    with pytest.raises(ValueError, match="no rng, expected a Generator for the noise"):
        laser.scan(foliage_room, PLACE)
    short = load_sensor("laser").with_noise(lambda ranges, _: ranges[1:])
    with pytest.raises(ValueError, match=r"shape \(180,\), expected \(181,\)"):
        short.scan(foliage_room, PLACE, 1)


@pytest.mark.parametrize("place", [PLACE, Pose3(0.0, 0.0, 1.0)])
@pytest.mark.parametrize("name", ["foliage_room", Path("foliage_room")])
def test_name_of_a_map_is_no_scene(name: object, place: Pose3) -> None:
    text = r"expected a Scene from radarsim\.load_map\('foliage_room'\)"
    with pytest.raises(TypeError, match=text):
        load_sensor("laser").scan(name, place)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=text):
        radarsim.Host(name)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r"scene 3, expected a Scene$"):
        load_sensor("laser").scan(3, place)  # type: ignore[arg-type]
