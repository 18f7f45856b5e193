"""What plants look like: numbers of no species."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats

WOOD: Final = "Wood"  # names of materials in mesh files
LEAVES: Final = "Leaves"


@dataclass(frozen=True, slots=True)
class PlantParameters:
    """A plant's measures, in m where nothing else is said.

    The crown is an ellipsoid above the origin, which is on the ground. All leaves and
    all twigs end in it.

    Attributes:
        crown_centre: Its height above the ground.
        crown_radius: In the level plane.
        crown_half_height: The same upward.
        stems: How many come out of the ground.
        stem_length: How long they are before wood reaches out for the crown.
        stem_lean_deg: How far several stems lean outward, off the vertical.
        clear_height: Nothing branches off below.
        stem_radius: At the ground.
        tip_radius: At the ends of the twigs.
        twigs: How many places in the crown wood reaches for.
        levels: How many times wood branches at most, from the stem to a twig.
        spread_deg: The angle between a branch and what it leaves, at most wherever
            there is a place to leave from.
        directness: 0 spends the least wood, 1 goes from the ground to each twig on
            the shortest way.
        leaves: How many.
        leaf_length: From base to tip.
        leaf_width: Where it is widest.
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
        """The middle of the crown, (3,) m."""
        return np.array([0.0, 0.0, self.crown_centre])

    @property
    def half_axes(self) -> Floats:
        """Of the crown, (3,) m."""
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


# Section from plants.growth.
# How wood grows: from stems on the ground towards places all over the crown.
#
# Theory of operation
# ===================
# Ends of twigs are thrown into the crown one after the other, each as far from the
# others
# as the best of a few darts. Then wood reaches for them, the nearest ones first. Each
# is
# reached from the point of the wood so far that costs least: the length of the new
# piece
# and, times ``directness``, the way from there to the ground. Points that branched
# too
# often are out of the question, a sharper turn than ``spread_deg`` costs extra.
#
# A branch is as thick as what grows out of it asks for: its radius to the power of an
# exponent is in proportion to the length of all wood beyond, as in Leonardo's rule
# that
# the branches of a tree, put together, are as thick as its trunk.

DARTS: Final = 12  # for each end of a twig
DEPTH: Final = 0.95  # of the crown, in which the ends are; leaves go on to its border
PIECES: Final = 4  # that a branch is bent in
DETOUR: Final = 3.0  # m that a turn which is too sharp costs
BEND: Final = 0.35  # share of a branch that goes on in the direction of what it leaves
WOBBLE: Final = 0.04  # share of a stem's length by which it is off its line


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The middle lines of a plant's wood.

    Attributes:
        points: (N, 3) m.
        parents: (N,) the point that each one comes from, which stands before it; -1 on
            the ground.
        tips: (T,) the points that it reached for; a twig may go on from there.
        radii: (N,) m.
    """

    points: Floats
    parents: NDArray[np.int64]
    tips: NDArray[np.int64]
    radii: Floats


class _Wood:
    """Wood that grows; lists with an entry for each point."""

    def __init__(self) -> None:
        self.points: list[Floats] = []
        self.parents: list[int] = []
        self.ways: list[Floats] = []  # unit vectors: where it grows
        self.levels: list[int] = []
        self.lengths: list[float] = []  # to the ground, m

    def add(self, point: Floats, way: Floats, parent: int, level: int) -> int:
        """Add a point; gives its number."""
        before = 0.0
        if parent >= 0:
            step = float(np.linalg.norm(point - self.points[parent]))
            before = self.lengths[parent] + step
        self.points.append(point)
        self.ways.append(way)
        self.parents.append(parent)
        self.levels.append(level)
        self.lengths.append(before)
        return len(self.points) - 1


def grow(form: PlantParameters, rng: np.random.Generator) -> Skeleton:
    """Grow the wood of one plant."""
    wood = _Wood()
    _raise_stems(form, wood, rng)
    ends = _throw_ends(form, rng)
    order = np.argsort(np.linalg.norm(ends - wood.points[0], axis=1), kind="stable")
    tips = [_reach(form, wood, end) for end in ends[order]]
    points, parents = np.array(wood.points), np.array(wood.parents)
    radii = _radii(form, points, parents)
    return Skeleton(points, parents, np.array(tips), radii)


def _raise_stems(form: PlantParameters, wood: _Wood, rng: np.random.Generator) -> None:
    """Let stems stand around the origin, a little bent."""
    several = form.stems > 1
    first = rng.uniform(0, 2 * math.pi)
    steps = max(PIECES, round(form.stem_length / 0.5))
    for number in range(form.stems):
        around = first + 2 * math.pi * number / form.stems + rng.normal(0, 0.2)
        lean = math.radians(form.stem_lean_deg) * rng.uniform(0.5, 1.0)
        out = np.array([math.cos(around), math.sin(around), 0.0])
        way = out * math.sin(lean) + np.array([0.0, 0.0, math.cos(lean)])
        foot = out * (2.0 * form.stem_radius if several else 0.0)
        number_of_last = wood.add(foot, way, -1, 0)
        for step in range(1, steps + 1):
            off = rng.normal(0, WOBBLE * form.stem_length / steps, 3) * [1, 1, 0]
            point = foot + way * form.stem_length * step / steps + off
            number_of_last = wood.add(point, way, number_of_last, 0)


def _throw_ends(form: PlantParameters, rng: np.random.Generator) -> Floats:
    """Spread the ends of twigs over the crown, (T, 3) m."""
    ends = np.full((form.twigs, 3), np.inf)
    for number in range(form.twigs):
        darts = form.centre + DEPTH * form.half_axes * in_unit_ball(rng, DARTS)
        gaps = np.linalg.norm(darts[:, None] - ends[None, :number], axis=2)
        ends[number] = darts[gaps.min(axis=1, initial=np.inf).argmax()]
    return ends


def in_unit_ball(rng: np.random.Generator, count: int) -> Floats:
    """Draw points evenly from the ball of radius 1, (count, 3)."""
    ways = rng.standard_normal((count, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    return np.asarray(ways * rng.random((count, 1)) ** (1 / 3))


def _reach(form: PlantParameters, wood: _Wood, end: Floats) -> int:
    """Grow a branch to an end, in a bow; gives the number of its last point."""
    start = _choose_start(form, wood, end)
    foot, way, level = wood.points[start], wood.ways[start], wood.levels[start]
    knee = foot + way * BEND * float(np.linalg.norm(end - foot))
    last = start
    for share in np.linspace(0, 1, PIECES + 1)[1:].tolist():
        on_first, on_second = foot + share * (knee - foot), knee + share * (end - knee)
        point = on_first + share * (on_second - on_first)
        last = wood.add(point, _unit(on_second - on_first), last, level + 1)
    return last


def _choose_start(form: PlantParameters, wood: _Wood, end: Floats) -> int:
    points, ways = np.array(wood.points), np.array(wood.ways)
    gaps = end - points
    distances = np.linalg.norm(gaps, axis=1)
    along = np.einsum("ij,ij->i", gaps, ways) / np.maximum(distances, 1e-9)
    too_sharp = along < math.cos(math.radians(form.spread_deg))
    costs = distances + form.directness * np.array(wood.lengths) + DETOUR * too_sharp
    out_of_question = np.array(wood.levels) >= form.levels
    out_of_question |= points[:, 2] < min(form.clear_height, points[:, 2].max())
    return int(np.where(out_of_question, np.inf, costs).argmin())


def _radii(form: PlantParameters, points: Floats, parents: NDArray[np.int64]) -> Floats:
    """Make wood as thick as what grows out of it asks for."""
    rooted = parents >= 0
    pieces = np.zeros(len(points))
    pieces[rooted] = np.linalg.norm(points[rooted] - points[parents[rooted]], axis=1)
    beyond = np.zeros(len(points))
    for child in range(len(points) - 1, -1, -1):
        if parents[child] >= 0:
            beyond[parents[child]] += beyond[child] + pieces[child]
    shares = 1 + beyond / pieces[rooted].mean()
    thickest = shares.max()
    exponent = math.log(form.stem_radius / form.tip_radius) / math.log(thickest)
    return np.asarray(form.tip_radius * shares**exponent)


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-12))
