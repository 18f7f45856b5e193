"""Echoes of level ground, against the integral over the beam."""

import math

import numpy as np
import pytest
from fmcw_scenes import block, db, echo_power, scene_of

import radarsim
from radarsim.addons.fmcw.antenna import elevation_pattern
from radarsim.addons.fmcw.radar import FmcwRadar
from radarsim.addons.fmcw.radar_equation import radar_constant
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
