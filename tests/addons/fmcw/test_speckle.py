"""Speckle of rough surfaces, against closed forms: still, driving, turning, in a wind.

Source of the correlations: J. W. Goodman, Speckle Phenomena in Optics, 2007, for a
Gaussian aperture; the field is correlated as the Fourier transform of the power of the
two-way pattern, and the power as the square of that.
"""

import math
from dataclasses import replace
from functools import cache, lru_cache
from typing import Any

import numpy as np
import pytest
from fmcw_scenes import EYE, block, correlation, echoes_of, radar, scene_of
from numpy.typing import NDArray

import radarsim
from radarsim.addons.fmcw.antenna import fixed_viewpoints
from radarsim.addons.fmcw.radar import FmcwRadar
from radarsim.addons.fmcw.speckle import clutter_texture, scatterers_in
from radarsim.errors import EngineError
from radarsim.geometry import Pose3
from radarsim.scene.material import Material
from radarsim.scene.scene import Scene

# All around the antenna, so thin that it returns evenly as far as 50 m.
MIST = Material("mist", density=0.0, radar_db=(1e-3, 1e-3, 1e-3))
SEEN = slice(200, 900)  # bins


@pytest.fixture(scope="module")
def which() -> FmcwRadar:
    return radar(bins=1000)


@cache
def mist(material: Material = MIST) -> Scene:
    return scene_of(block((400, 400, 200), (0, 0, 0), material))


@lru_cache(maxsize=4)
def pattern(
    which: FmcwRadar,
    pose: Pose3 = EYE,
    time: float = 0.0,
    scene: Scene | None = None,
    seed: int = 0,
) -> NDArray[np.complex128]:
    """Return the amplitudes by direction and bin, of a mean power of 1."""
    view = fixed_viewpoints(pose, which.times(0) + time)
    found = echoes_of(which, scene or mist(), view, seed)
    field = found.field.view(np.complex64)[:, SEEN]
    return np.asarray(field / np.sqrt(found.power[:, SEEN]), np.complex128)


def power_correlation(first: NDArray[Any], second: NDArray[Any]) -> float:
    return correlation(np.abs(first) ** 2, np.abs(second) ** 2)


def test_speckle_of_terrain_is_exponential(which: FmcwRadar) -> None:
    """Measured at 95 GHz: standard deviation over mean 0.97 to 1."""
    cells = np.abs(pattern(which)[::3]).ravel() ** 2  # each is independent
    assert cells.mean() == pytest.approx(1, abs=0.02)
    assert cells.std() / cells.mean() == pytest.approx(1, abs=0.03)
    ordered = np.sort(cells / cells.mean())
    shares = (np.arange(ordered.size) + 0.5) / ordered.size
    assert np.abs(shares - (1 - np.exp(-ordered))).max() < 1.6 / math.sqrt(ordered.size)


def test_speckle_of_neighbouring_directions_is_correlated_by_the_beam(
    which: FmcwRadar,
) -> None:
    field = pattern(which)
    for steps, expected in ((1, 0.5), (2, 0.0625)):  # of half a beamwidth
        found = power_correlation(field, np.roll(field, steps, 0))
        assert found == pytest.approx(expected, abs=0.02)
    assert abs(power_correlation(field[:, 1:], field[:, :-1])) < 0.02


def test_standing_radar_sees_a_standing_world(foliage_room: Scene) -> None:
    turning = radarsim.load_sensor("navtech_cts350x")
    rng, place = radarsim.generator_for(0), (-8, 0, 0)
    first, second = (turning.spectrum(foliage_room, place, rng) for _ in range(2))
    loud = first.echo_power > 100 * first.noise_floor
    assert loud.mean() > 0.004
    counts = [each.counts[loud].astype(float) for each in (first, second)]
    assert correlation(*counts) > 0.98
    # Beyond the walls there is only noise, more in directions of strong echoes.
    counts = [each.counts[:, 2000:].astype(float) for each in (first, second)]
    counts = [each - each.mean(axis=1, keepdims=True) for each in counts]
    assert abs(correlation(*counts)) < 0.02


@pytest.mark.parametrize("distance", [0.01, 0.02, 0.05])
def test_speckle_across_the_way_changes_within_half_the_antenna(
    which: FmcwRadar, distance: float
) -> None:
    it = which.settings
    width = math.radians(it.beamwidth_az_deg) / (4 * math.sqrt(math.log(2)))
    expected = math.exp(-((4 * math.pi * width * distance / it.wavelength) ** 2))
    moved = replace(EYE, y=EYE.y + distance)
    ahead = np.r_[-10:11]  # directions within 9 degrees of the normal of the way
    fields = [pattern(which, pose)[ahead] for pose in (EYE, moved)]
    assert power_correlation(*fields) == pytest.approx(expected, abs=0.05)


def test_speckle_ahead_comes_nearer_as_the_radar_drives(which: FmcwRadar) -> None:
    bins = 5
    moved = replace(EYE, x=EYE.x + bins * which.settings.bin_size)
    first, second = (pattern(which, pose)[0] for pose in (EYE, moved))
    assert power_correlation(first[bins:], second[:-bins]) > 0.95
    assert abs(power_correlation(first, second)) < 0.15


def test_phase_ahead_turns_by_twice_the_way(which: FmcwRadar) -> None:
    it, way = which.settings, 0.0005
    moved = replace(EYE, x=EYE.x + way)
    first, second = (pattern(which, pose)[0] for pose in (EYE, moved))
    turn = np.angle((second * first.conj()).sum())
    assert turn == pytest.approx(-4 * math.pi * way / it.wavelength, abs=0.05)


def test_speckle_turns_with_the_world_as_the_radar_does(which: FmcwRadar) -> None:
    turned = replace(EYE, yaw=3 * which.settings.step)
    first, second = pattern(which), pattern(which, turned)
    # To the left by three directions: what was ahead is then three farther clockwise.
    assert power_correlation(first, np.roll(second, -3, 0)) > 0.99


def test_places_far_apart_have_speckle_of_their_own(which: FmcwRadar) -> None:
    for place in (Pose3(3, 0, 1), Pose3(-6, 5, 1)):
        assert abs(power_correlation(pattern(which), pattern(which, place))) < 0.03


def test_seeds_have_speckle_of_their_own(which: FmcwRadar) -> None:
    own, other = pattern(which), pattern(which, seed=2)
    assert (own == pattern(which, EYE, scene=mist(), seed=0)).all()
    assert abs(power_correlation(own, other)) < 0.03


@pytest.mark.parametrize("time", [0.01, 0.04])
def test_leaves_in_a_wind_lose_their_speckle(which: FmcwRadar, time: float) -> None:
    """The field keeps exp(-(4 pi sigma t / lambda)^2 / 2) of its correlation."""
    speed = 0.01
    leaves = mist(replace(MIST, sway_m_per_s=speed))
    first, second = (pattern(which, EYE, t, leaves) for t in (0.0, time))
    phase = 4 * math.pi * speed * time / which.settings.wavelength
    found = (first * second.conj()).mean() / (np.abs(first) ** 2).mean()
    assert found == pytest.approx(math.exp(-(phase**2) / 2), abs=0.02)
    assert (pattern(which, EYE, time) == pattern(which)).all()


@pytest.mark.parametrize("shape", [0.5, 1.5, 5])
def test_clutter_has_a_texture_of_gamma_distribution(shape: float) -> None:
    texture = clutter_texture(shape)
    assert texture.mean() == pytest.approx(1, abs=1e-3)
    assert texture.var() == pytest.approx(1 / shape, rel=0.1)


def test_scatterers_are_those_of_directions_in_the_map() -> None:
    """An antenna that turns by nine columns sees the same nine columns earlier."""
    settings = radar(clutter_shape=1.5).settings
    count, key = settings.azimuths * settings.rays_across, 2**64 - 5
    azimuths = np.arange(count) * 2 * math.pi / count
    which = np.arange(count) % 7
    found = []
    for yaw in (0.3, 0.3 + 9 * 2 * math.pi / count):
        view = fixed_viewpoints(Pose3(8, -5, 2, 0, 0, yaw), np.zeros(7))
        found.append(scatterers_in(settings, azimuths, view, which, key, 1))
    first, turned = found
    assert np.roll(turned, -9).tobytes() == first.tobytes()
    assert len(np.unique(first["key"])) == count
    # Directions are whole columns; the nearest ones are those of the azimuths.
    angles = np.rint((0.3 - azimuths) * count / (2 * math.pi)) * 2 * math.pi / count
    x, y = np.cos(angles), np.sin(angles)
    along = (8 * x - 5 * y) / settings.bin_size
    assert np.abs(first["start"] - along).max() <= 0.5 + 1e-9
    begin = key % 512 + 8 / 0.25, key // 512 % 512 - 5 / 0.25
    assert first["x"] == pytest.approx(begin[0])
    assert first["y"] == pytest.approx(begin[1])
    assert first["dx"] == pytest.approx(x * settings.bin_size / 0.25, abs=1e-12)
    assert first["dy"] == pytest.approx(y * settings.bin_size / 0.25, abs=1e-12)
    for wrong in (-1, 7):
        with pytest.raises(EngineError, match="inconsistent lengths"):
            scatterers_in(settings, azimuths, view, which + wrong, key, 1)
