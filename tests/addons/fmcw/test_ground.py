"""Echoes of level ground, against the integral over the beam."""

import math

import numpy as np
import pytest
from fmcw_scenes import block, correlation, db, echo_power, scene_of
from fmcw_scenes import radar as fmcw_radar
from scipy import ndimage, signal

import radarsim
from radarsim.addons.fmcw.antenna import elevation_pattern
from radarsim.addons.fmcw.radar import FmcwRadar
from radarsim.addons.fmcw.radar_equation import radar_constant
from radarsim.addons.fmcw.scattering import ground_heights
from radarsim.addons.fmcw.speckle import TEXTURE_CELL
from radarsim.geometry import Floats, Pose3
from radarsim.scene.material import Material
from radarsim.scene.scene import Scene

HEIGHT = 0.55  # m, of the antenna
EYE = Pose3(0.0, 0.0, HEIGHT)
SOIL = Material("soil", backscatter_db=-25, constant_gamma=True)
FLOOR = Material("floor", backscatter_db=-25)


@pytest.fixture(scope="module")
def radar() -> FmcwRadar:
    scanner = radarsim.load_sensor("navtech_cts350x", fmcw={"sidelobe_db": -300})
    radar: FmcwRadar = scanner.fmcw
    return radar


def ground(width: float, material: Material) -> Scene:
    return scene_of(block((width, width, 0.2), (0.0, 0.0, -0.1), material))


def integral(radar: FmcwRadar) -> Floats:
    """Return the power by range of ground of a gamma of -25 dB, W."""
    it, ranges = radar.settings, np.maximum(radar.ranges, 2 * HEIGHT)
    down = np.arcsin(HEIGHT / ranges)
    across = math.radians(it.beamwidth_az_deg) * math.sqrt(math.pi / (8 * math.log(2)))
    solid = across * HEIGHT / ranges**2 * it.bin_size
    pattern = elevation_pattern(it, -down) ** 2
    return np.asarray(radar_constant(it) * 10**-2.5 * pattern * solid / ranges**2)


def test_ground_returns_evenly_in_all_directions(radar: FmcwRadar) -> None:
    share = echo_power(radar, ground(800, SOIL), EYE) / integral(radar)
    for start in (3.0, 6.0, 12.0, 20.0, 30.0, 50.0):
        some = share[:, (radar.ranges >= start) & (radar.ranges < 1.3 * start)]
        assert db(some.mean()) == pytest.approx(0, abs=0.5)
        assert some.std() / some.mean() < 0.4
        assert some.min() > 0.05


def test_open_ground_goes_on_beyond_the_edge_of_the_map(radar: FmcwRadar) -> None:
    small, large = (echo_power(radar, ground(width, SOIL), EYE) for width in (20, 800))
    np.testing.assert_allclose(small, large, rtol=1e-3, atol=1e-12)


def test_floor_ends_at_its_edge(radar: FmcwRadar) -> None:
    ahead = echo_power(radar, ground(20, FLOOR), EYE)[0]
    assert (ahead[(radar.ranges > 3) & (radar.ranges < 9.9)] > 0).all()
    assert ahead[radar.ranges > 10.2].sum() < 1e-30  # W


def test_ground_ends_at_a_wall(radar: FmcwRadar) -> None:
    wall = block((0.2, 60, 20), (30.1, 0, 0))
    scene = scene_of(wall, *ground(800, SOIL).parts)
    ahead = echo_power(radar, scene, EYE)[0]
    behind = (radar.ranges > 33.5) & (radar.ranges < 60)
    # What the wall itself is spread over, a grazing ray's 3 m, is left out.
    assert ahead[behind].sum() < 1e-3 * integral(radar)[behind].sum()


def test_patches_of_ground_return_what_each_of_them_does(radar: FmcwRadar) -> None:
    """A strip of grass across soil, 20 to 40 m ahead; its rays are metres apart."""
    grass = Material("grass", backscatter_db=-15, constant_gamma=True)
    strip = block((20, 200, 0.1), (30.0, 0.0, -0.045), grass)
    scene = scene_of(*ground(200, SOIL).parts, strip)
    share = echo_power(radar, scene, EYE) / integral(radar)
    ahead = np.vstack([share[:8], share[-8:]])
    for low, high, expected in ((10, 18, 0), (22, 38, 10), (43, 60, 0)):
        some = ahead[:, (radar.ranges >= low) & (radar.ranges < high)]
        assert db(some.mean()) == pytest.approx(expected, abs=0.6)
    behind = share[180:220, (radar.ranges >= 22) & (radar.ranges < 38)]
    assert db(behind.mean()) == pytest.approx(0, abs=0.6)


def test_heights_of_uneven_ground_have_the_spectrum_of_iso_8608() -> None:
    """Power density along lines: 1 cm^3 at 0.1 waves per metre, falling by n^-2."""
    waves, density = signal.periodogram(
        ground_heights(), fs=1 / TEXTURE_CELL, window="boxcar", detrend=False
    )
    expected = 1e-6 * (0.1 / np.maximum(waves, 1e-9)) ** 2
    for low, high in ((0.05, 0.2), (0.2, 0.5), (0.5, 1.0)):
        band = (waves >= low) & (waves < high)
        ratio = density.mean(axis=0)[band].sum() / expected[band].sum()
        assert ratio == pytest.approx(1, abs=0.15)


def shares_of_the_view(heights: Floats, above: float) -> Floats:
    """Return how much of uneven ground shows over level ground, (A, S).

    Args:
        heights: (A, S) m, of steps of ``TEXTURE_CELL`` away from an antenna.
        above: Its height, m.
    """
    ways = TEXTURE_CELL * np.arange(1, heights.shape[1] + 1)
    slopes = (heights - above) / ways
    highest = np.maximum.accumulate(slopes, axis=1)
    return np.asarray(np.diff(highest, axis=1) / np.diff(-above / ways))


def uneven_heights(directions: int, steps: int, roughness: float) -> Floats:
    """Return the heights of ground around the origin, (A, S) m."""
    angles = -2 * math.pi * np.arange(directions)[:, None] / directions
    ways = np.arange(1, steps + 1)
    places = ways * np.cos(angles), ways * np.sin(angles)
    found = ndimage.map_coordinates(ground_heights(), places, order=1, mode="grid-wrap")
    return np.asarray(math.sqrt(roughness) * found.astype(np.float64))


@pytest.mark.parametrize("distance", [10, 20, 40])
def test_uneven_ground_hides_itself_as_by_smith(distance: int) -> None:
    """B. G. Smith, Geometrical shadowing of a random rough surface, IEEE TAP 1967."""
    roughness, above = 16384.0, 1.9
    heights = uneven_heights(3200, 4 * distance + 20, roughness)
    slope = float(np.diff(heights, axis=1).std()) / TEXTURE_CELL
    lit = shares_of_the_view(heights, above)[:, 4 * distance - 20 :] > 0
    steep = above / distance / slope  # of the ray, in rms slopes of the ground
    beyond = math.erfc(steep / math.sqrt(2))
    hidden = math.sqrt(2 / math.pi) / steep * math.exp(-(steep**2) / 2) - beyond
    expected = (1 - beyond / 2) / (1 + hidden / 2)
    assert lit.mean() == pytest.approx(expected, abs=0.03)


def test_uneven_ground_shows_what_rises_and_hides_what_is_behind() -> None:
    """Each step has the share of the view that it fills, by the heights alone."""
    uneven = Material(
        "uneven", backscatter_db=-25, constant_gamma=True, roughness_cm3=4096
    )
    narrow = fmcw_radar(beamwidth_az_deg=0.9, fan_deg=25)
    eye = Pose3(0.0, 0.0, 1.9)
    seen, level = (
        echo_power(narrow, ground(800, each), eye) for each in (uneven, SOIL)
    )
    edges = np.arange(8, 60, 0.25)
    bins = np.searchsorted(narrow.ranges, np.hypot(edges, eye.z))
    found, plain = (
        np.add.reduceat(each, bins, axis=1)[:, :-1] for each in (seen, level)
    )
    # The beam, out and back, is a Gaussian of 0.9 / 4 sqrt(ln 2) degrees: 2.4 columns.
    shares = shares_of_the_view(uneven_heights(3200, 400, 4096), eye.z)
    in_beam = ndimage.gaussian_filter1d(shares, 2.4, axis=0, mode="wrap")[::8]
    expected = in_beam[:, 31 : 31 + found.shape[1]]
    assert correlation(found / plain.mean(axis=0), expected) > 0.85
    for low, high in ((0, 50), (50, 120), (120, 200)):
        ratio = found[:, low:high].sum() / plain[:, low:high].sum()
        assert ratio == pytest.approx(expected[:, low:high].mean(), abs=0.1)


@pytest.mark.parametrize("constant", [False, True])
def test_roof_below_the_antenna_does_not_change_the_view(
    radar: FmcwRadar, constant: bool
) -> None:
    rough = Material("soil", backscatter_db=-25, constant_gamma=True, roughness_cm3=256)
    roof = Material("roof", backscatter_db=-25, constant_gamma=constant)
    parts = block((400, 400, 0.2), (0, 0, -0.1), rough)
    eye, far = Pose3(0, 0, 3), radar.ranges > 40
    open_, covered = (
        echo_power(radar, scene_of(parts, *above), eye)[:, far]
        for above in ((), (block((1.6, 1.6, 0.1), (0, 0, 2.65), roof),))
    )
    assert covered == pytest.approx(open_, rel=1e-3)
