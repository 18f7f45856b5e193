"""The parameters of plants, and their wood, grown towards the ends of the twigs."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats

WOOD: Final = "Wood"  # material names in mesh files
LEAVES: Final = "Leaves"


@dataclass(frozen=True, slots=True)
class PlantParameters:
    """Parameters of a plant, in m unless stated otherwise.

    The crown is an ellipsoid above the origin, which is on the ground. All leaves and
    all twigs end in it.

    Attributes:
        crown_centre: Height of the crown's centre above the ground.
        crown_radius: Horizontal half-axis of the crown.
        crown_half_height: Vertical half-axis of the crown.
        stems: Number of stems that come out of the ground.
        stem_length: Length of the stems before branches grow to the twigs' ends.
        stem_lean_deg: Angle between stems and the vertical, at most.
        clear_height: Height below which nothing branches off.
        stem_radius: Radius of the stems at the ground.
        tip_radius: Radius at the ends of the twigs.
        twigs: Number of twigs' ends in the crown.
        levels: Largest number of branchings from a stem to a twig.
        spread_deg: Largest angle between a branch and its parent, as long as there is
            a point to branch off from.
        directness: 0 uses the least wood, 1 the shortest paths from the ground to each
            twig.
        leaves: Number of leaves.
        leaf_length: Length of a leaf from base to tip.
        leaf_width: Largest width of a leaf.
        cluster: Standard deviation of the leaves' distances from their twig's end,
            along each axis.
    """

    crown_centre: float
    crown_radius: float
    crown_half_height: float
    stems: int
    stem_length: float
    stem_lean_deg: float
    clear_height: float
    stem_radius: float
    tip_radius: float
    twigs: int
    levels: int
    spread_deg: float
    directness: float
    leaves: int
    leaf_length: float
    leaf_width: float
    cluster: float

    @property
    def centre(self) -> Floats:
        """Centre of the crown, (3,) m."""
        return np.array([0.0, 0.0, self.crown_centre])

    @property
    def half_axes(self) -> Floats:
        """Half-axes of the crown, (3,) m."""
        r = self.crown_radius
        return np.array([r, r, self.crown_half_height])


SHRUB: Final = PlantParameters(
    crown_centre=0.9,
    crown_radius=1.0,
    crown_half_height=1.0,
    stems=6,
    stem_length=0.35,
    stem_lean_deg=25,
    clear_height=0.1,
    stem_radius=0.022,
    tip_radius=0.003,
    twigs=90,
    levels=4,
    spread_deg=65,
    directness=0.35,
    leaves=6000,
    leaf_length=0.14,
    leaf_width=0.09,
    cluster=0.13,
)

TREE: Final = PlantParameters(
    crown_centre=4.2,
    crown_radius=1.9,
    crown_half_height=2.4,
    stems=1,
    stem_length=5.2,
    stem_lean_deg=2,
    clear_height=1.7,
    stem_radius=0.14,
    tip_radius=0.007,
    twigs=140,
    levels=4,
    spread_deg=75,
    directness=0.4,
    leaves=3600,
    leaf_length=0.24,
    leaf_width=0.15,
    cluster=0.22,
)

YOUNG_TREE: Final = PlantParameters(
    crown_centre=1.9,
    crown_radius=0.8,
    crown_half_height=1.4,
    stems=1,
    stem_length=2.6,
    stem_lean_deg=3,
    clear_height=0.5,
    stem_radius=0.04,
    tip_radius=0.004,
    twigs=60,
    levels=3,
    spread_deg=70,
    directness=0.3,
    leaves=1300,
    leaf_length=0.16,
    leaf_width=0.09,
    cluster=0.13,
)


CANDIDATES: Final = 12  # random positions for each twig's end
END_REGION: Final = 0.95  # share of the crown with twigs' ends; leaves extend further
SEGMENTS: Final = 4  # of a branch
SHARP_ANGLE_COST: Final = 3.0  # m
BEND: Final = 0.35  # share of a branch that continues in its parent's direction
WOBBLE: Final = 0.04  # deviation of a stem from its line, as a share of its length


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The centre lines of a plant's wood.

    Attributes:
        points: (N, 3) m.
        parents: (N,) index of the point before each one, lower than its own; -1 on the
            ground.
        tips: (T,) indices of the twigs' ends; other branches may start there.
        radii: (N,) radius of the wood at each point, m.
    """

    points: Floats
    parents: NDArray[np.int64]
    tips: NDArray[np.int64]
    radii: Floats


class _Wood:
    """A skeleton under construction; lists with an entry for each point."""

    def __init__(self) -> None:
        self.points: list[Floats] = []
        self.parents: list[int] = []
        self.directions: list[Floats] = []  # unit vectors
        self.levels: list[int] = []
        self.lengths: list[float] = []  # along the wood to the ground, m

    def add(self, point: Floats, direction: Floats, parent: int, level: int) -> int:
        """Add a point; return its index."""
        length = 0.0
        if parent >= 0:
            step = float(np.linalg.norm(point - self.points[parent]))
            length = self.lengths[parent] + step
        self.points.append(point)
        self.directions.append(direction)
        self.parents.append(parent)
        self.levels.append(level)
        self.lengths.append(length)
        return len(self.points) - 1


def grow(parameters: PlantParameters, rng: np.random.Generator) -> Skeleton:
    """Grow the wood of one plant."""
    wood = _Wood()
    _grow_stems(parameters, wood, rng)
    ends = _place_ends(parameters, rng)
    order = np.argsort(np.linalg.norm(ends - wood.points[0], axis=1), kind="stable")
    tips = [_grow_branch(parameters, wood, end) for end in ends[order]]
    points, parents = np.array(wood.points), np.array(wood.parents)
    radii = _radii(parameters, points, parents)
    return Skeleton(points, parents, np.array(tips), radii)


def _grow_stems(
    parameters: PlantParameters, wood: _Wood, rng: np.random.Generator
) -> None:
    """Grow slightly bent stems around the origin."""
    several = parameters.stems > 1
    first = rng.uniform(0, 2 * math.pi)
    steps = max(SEGMENTS, round(parameters.stem_length / 0.5))
    for number in range(parameters.stems):
        azimuth = first + 2 * math.pi * number / parameters.stems + rng.normal(0, 0.2)
        lean = math.radians(parameters.stem_lean_deg) * rng.uniform(0.5, 1.0)
        out = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
        direction = out * math.sin(lean) + np.array([0.0, 0.0, math.cos(lean)])
        foot = out * (2.0 * parameters.stem_radius if several else 0.0)
        last = wood.add(foot, direction, -1, 0)
        for step in range(1, steps + 1):
            offset = rng.normal(0, WOBBLE * parameters.stem_length / steps, 3) * [
                1,
                1,
                0,
            ]
            point = foot + direction * parameters.stem_length * step / steps + offset
            last = wood.add(point, direction, last, 0)


def _place_ends(parameters: PlantParameters, rng: np.random.Generator) -> Floats:
    """Spread the ends of the twigs over the crown, (T, 3) m."""
    ends = np.full((parameters.twigs, 3), np.inf)
    for number in range(parameters.twigs):
        candidates = (
            parameters.centre
            + END_REGION * parameters.half_axes * in_unit_ball(rng, CANDIDATES)
        )
        distances = np.linalg.norm(candidates[:, None] - ends[None, :number], axis=2)
        ends[number] = candidates[distances.min(axis=1, initial=np.inf).argmax()]
    return ends


def in_unit_ball(rng: np.random.Generator, count: int) -> Floats:
    """Draw points uniformly from the unit ball, (count, 3)."""
    directions = rng.standard_normal((count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.asarray(directions * rng.random((count, 1)) ** (1 / 3))


def _grow_branch(parameters: PlantParameters, wood: _Wood, end: Floats) -> int:
    """Grow a branch to an end, along a Bézier curve; return its last point's index."""
    start = _choose_start(parameters, wood, end)
    foot, level = wood.points[start], wood.levels[start]
    length = float(np.linalg.norm(end - foot))
    control = foot + wood.directions[start] * BEND * length
    last = start
    for share in np.linspace(0, 1, SEGMENTS + 1)[1:].tolist():
        on_first, on_second = (
            foot + share * (control - foot),
            control + share * (end - control),
        )
        point = on_first + share * (on_second - on_first)
        last = wood.add(point, _unit(on_second - on_first), last, level + 1)
    return last


def _choose_start(parameters: PlantParameters, wood: _Wood, end: Floats) -> int:
    points, directions = np.array(wood.points), np.array(wood.directions)
    gaps = end - points
    distances = np.linalg.norm(gaps, axis=1)
    along = np.einsum("ij,ij->i", gaps, directions) / np.maximum(distances, 1e-9)
    too_sharp = along < math.cos(math.radians(parameters.spread_deg))
    costs = (
        distances
        + parameters.directness * np.array(wood.lengths)
        + SHARP_ANGLE_COST * too_sharp
    )
    excluded = np.array(wood.levels) >= parameters.levels
    excluded |= points[:, 2] < min(parameters.clear_height, points[:, 2].max())
    return int(np.where(excluded, np.inf, costs).argmin())


def _radii(
    parameters: PlantParameters, points: Floats, parents: NDArray[np.int64]
) -> Floats:
    """Return the radius of the wood at each point, m."""
    rooted = parents >= 0
    steps = np.zeros(len(points))
    steps[rooted] = np.linalg.norm(points[rooted] - points[parents[rooted]], axis=1)
    beyond = np.zeros(len(points))
    for child in range(len(points) - 1, -1, -1):
        if parents[child] >= 0:
            beyond[parents[child]] += beyond[child] + steps[child]
    shares = 1 + beyond / steps[rooted].mean()
    thickest = shares.max()
    exponent = math.log(parameters.stem_radius / parameters.tip_radius) / math.log(
        thickest
    )
    return np.asarray(parameters.tip_radius * shares**exponent)


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-12))
