"""What foliage has to take from beams so that a wanted share of power gets through.

The transmission of a ray is the share of its penetration power that is left behind the
plant: 0 if it is spent in there, or ends at its wood. That of a plant is the mean over
level rays from all sides, spread evenly over the disc that its crown is seen as.
"""

import math
from collections.abc import Callable, Sequence
from typing import Final, TypeAlias

import numpy as np

from radarsim.geometry import Floats
from radarsim.raycast.penetration import Outcome
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracers import tracer_of
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene

POWER: Final = 1.0  # that rays leave with
DENSITY: Final = 0.7  # power per metre of the ball that is the measure for all
ACCURACY: Final = 1e-3  # of what is found, as a share of it
WOODEN: Final = Material("wood")

Foliage: TypeAlias = Callable[[float], Material]


def bundle(
    centre: Floats,
    radius: float,
    rng: np.random.Generator,
    *,
    azimuths: int = 48,
    rays: int = 800,
) -> Rays:
    """Point level rays at a ball from all around.

    Args:
        centre: Of the ball, (3,) m.
        radius: Of the ball, m.
        rng: Draws from where they come, and where they go through the ball's disc.
        azimuths: From how many sides.
        rays: How many from each.

    Returns:
        Parallel rays from each side, which start and end 1 m in front of the ball and
        behind it.
    """
    first = rng.uniform(0, 2 * math.pi)
    around = np.repeat(first + 2 * math.pi * np.arange(azimuths) / azimuths, rays)
    count = np.tile(np.arange(rays), azimuths)
    # Spirals of even density, each turned by chance, with a place drawn for each ray.
    out = radius * np.sqrt((count + rng.random(len(count))) / rays)
    golden = math.pi * (3 - math.sqrt(5))
    turn = golden * count + np.repeat(rng.uniform(0, 2 * math.pi, azimuths), rays)
    ways = np.column_stack([np.cos(around), np.sin(around), np.zeros(len(around))])
    left = np.column_stack([-ways[:, 1], ways[:, 0], ways[:, 2]])
    beside = out * np.cos(turn)
    starts = centre - (radius + 1) * ways + beside[:, None] * left
    starts[:, 2] += out * np.sin(turn)
    return Rays.alike(starts, ways, reach=2 * radius + 2, power=POWER)


def transmission(parts: Sequence[Part], rays: Rays) -> Floats:
    """Give the share of power that each ray has left behind all parts, (N,)."""
    traces = tracer_of(Scene("plant", "Plant", tuple(parts))).trace(rays)
    through = traces.outcomes == Outcome.NOTHING
    return np.where(through, traces.power, 0.0) / rays.power


def transmission_of_ball(opacity: float) -> float:
    """Give the mean transmission of a bare ball; it has a closed form.

    Args:
        opacity: What a beam through the middle loses in it, as a share of its power.
    """
    if opacity >= 1:
        return 1 / (3 * opacity**2)
    return 1 - 2 * opacity / 3


def calibrate(
    parts: Callable[[float], Sequence[Part]], wanted: float, rays: Rays, most: float
) -> float:
    """Find what foliage has to take.

    Args:
        parts: Give a plant whose foliage takes so much.
        wanted: The mean transmission.
        rays: From ``bundle``.
        most: What is taken at most; it is halved from there.

    Raises:
        ValueError: If even the most takes too little, or nothing at all too much.
    """
    low, high = 0.0, most
    reached = [float(transmission(parts(end), rays).mean()) for end in (low, high)]
    if not reached[0] >= wanted >= reached[1]:
        raise ValueError(f"transmission from {reached}, expected {wanted:.4f} between")
    while high - low > ACCURACY * high:
        middle = (low + high) / 2
        if transmission(parts(middle), rays).mean() > wanted:
            low = middle
        else:
            high = middle
    return (low + high) / 2
