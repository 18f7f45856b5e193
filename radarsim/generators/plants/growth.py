"""The wood of plants, grown towards the ends of the twigs."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.generators.plants.species import PlantParameters
from radarsim.geometry import Floats

WOOD: Final = "Wood"  # material names in mesh files
LEAVES: Final = "Leaves"
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
    # Near ends first, so that branches to far ones can start from those to near ones.
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
        # The best of some random candidates keeps ends apart, where plain random ones
        # would bunch.
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
    # From the last to the first: parents come before their children.
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
