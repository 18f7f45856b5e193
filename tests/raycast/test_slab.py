"""Rays of all directions through a slab, against the exponential integral."""

import numpy as np
import pytest
from scipy.special import expn

from radarsim.raycast.rays import RADAR, RayClass, Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import box

NEPER_DB = 10 / np.log(10)
COUNT = 40_000
WIDTH = 1e5  # m, of a slab 1 m thick


@pytest.mark.parametrize(
    ("depth", "expected"), [(0.25, 0.75887), (1.0, 0.57425), (3.0, 0.50532)]
)
def test_share_that_leaves_an_isotropic_source_under_a_slab(
    depth: float, expected: float
) -> None:
    """Half of it goes down; of the rest E2 of the optical depth passes the slab."""
    assert 0.5 + 0.5 * expn(2, depth) == pytest.approx(expected, abs=1e-5)
    vertices, faces = box(WIDTH, WIDTH, 1.0)
    slab = Part("slab", Material("haze", density=depth * NEPER_DB), vertices, faces)
    tracer = tracer_of(Scene("slab", "Slab", (slab,)))
    # Even in height and azimuth is even on the sphere.
    up = -1 + (2 * np.arange(COUNT) + 1) / COUNT
    azimuth = generator_for(0).uniform(0, 2 * np.pi, COUNT)
    level = np.sqrt(1 - up**2)
    directions = np.stack([level * np.cos(azimuth), level * np.sin(azimuth), up], -1)
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    full = 100.0  # dB, as the density is in decibels
    rays = Rays(
        np.tile([0.0, 0.0, -0.6], (COUNT, 1)),
        directions,
        np.full(COUNT, 4e4),
        np.full(COUNT, full),
        np.zeros(COUNT, np.uint8),
        np.full(COUNT, -1, np.int64),
        (RayClass(RADAR, 1, 1.0, 0, is_absorbed=False, in_decibels=True),),
    )
    events = tracer.trace(rays, events=True).events
    left = np.zeros(COUNT)  # depleted power
    np.minimum.at(power := np.full(COUNT, full), events["ray"], events["power"])
    reached = power > 0
    left[reached] = 10 ** ((power[reached] - full) / 10)
    assert left.mean() == pytest.approx(expected, abs=1e-3)
