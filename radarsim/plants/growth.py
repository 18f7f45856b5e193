"""How wood grows: from stems on the ground towards places all over the crown.

Theory of operation
===================
Ends of twigs are thrown into the crown one after the other, each as far from the others
as the best of a few darts. Then wood reaches for them, the nearest ones first. Each is
reached from the point of the wood so far that costs least: the length of the new piece
and, times ``directness``, the way from there to the ground. Points that branched too
often are out of the question, a sharper turn than ``spread_deg`` costs extra.

A branch is as thick as what grows out of it asks for: its radius to the power of an
exponent is in proportion to the length of all wood beyond, as in Leonardo's rule that
the branches of a tree, put together, are as thick as its trunk.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.plants.forms import PlantForm

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


def grow(form: PlantForm, rng: np.random.Generator) -> Skeleton:
    """Grow the wood of one plant."""
    wood = _Wood()
    _raise_stems(form, wood, rng)
    ends = _throw_ends(form, rng)
    order = np.argsort(np.linalg.norm(ends - wood.points[0], axis=1), kind="stable")
    tips = [_reach(form, wood, end) for end in ends[order]]
    points, parents = np.array(wood.points), np.array(wood.parents)
    radii = _radii(form, points, parents)
    return Skeleton(points, parents, np.array(tips), radii)


def _raise_stems(form: PlantForm, wood: _Wood, rng: np.random.Generator) -> None:
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


def _throw_ends(form: PlantForm, rng: np.random.Generator) -> Floats:
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


def _reach(form: PlantForm, wood: _Wood, end: Floats) -> int:
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


def _choose_start(form: PlantForm, wood: _Wood, end: Floats) -> int:
    points, ways = np.array(wood.points), np.array(wood.ways)
    gaps = end - points
    distances = np.linalg.norm(gaps, axis=1)
    along = np.einsum("ij,ij->i", gaps, ways) / np.maximum(distances, 1e-9)
    too_sharp = along < math.cos(math.radians(form.spread_deg))
    costs = distances + form.directness * np.array(wood.lengths) + DETOUR * too_sharp
    out_of_question = np.array(wood.levels) >= form.levels
    out_of_question |= points[:, 2] < min(form.clear_height, points[:, 2].max())
    return int(np.where(out_of_question, np.inf, costs).argmin())


def _radii(form: PlantForm, points: Floats, parents: NDArray[np.int64]) -> Floats:
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
