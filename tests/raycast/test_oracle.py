"""The engine against an oracle that shares no code with it.

The oracle cuts a ray at every plane of a triangle that it comes near, by Moeller and
Trumbore, and asks for the middle of each piece which volumes contain it, by the solid
angle of their faces. Too many cuts do no harm. No order of crossings, no winding along
the ray, no tree of boxes, no float32: they share only the physical law.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.raycast.rays import LASER, RADAR, Outcome, Rays
from radarsim.raycast.tracer import Tracer
from radarsim.scene import shapes
from radarsim.scene.material import Material
from radarsim.scene.scene import Part

Place = Sequence[float] | Floats
Solid = tuple[Floats, NDArray[np.int32]]

CONCRETE = Material("concrete")
FOLIAGE = Material("foliage", density=0.7)
HEDGE = Material("hedge", density=0.4)
SMOKE = Material("smoke", density=0.0, laser_density=0.5, solid=False)
GLASS = Material("glass", density=math.inf, laser_density=0.2)
LEAF = Material("leaf", density=0.0, sheet_loss=0.25)
EXACT = 1e-6  # accuracy of float64, grazing rays included


def ball(radius: float, at: Place) -> Solid:
    """Create a sphere of 80 faces."""
    mesh = trimesh.creation.icosphere(1, radius)
    return mesh.vertices + np.asarray(at, float), mesh.faces.astype(np.int32)


def brick(size: Sequence[float], at: Place) -> Solid:
    vertices, faces = shapes.box(*size)
    return vertices + np.asarray(at, float), faces


def inverted(solid: Solid) -> Solid:
    return solid[0], solid[1][:, ::-1].copy()


def concatenate(*solids: Solid) -> Solid:
    """Concatenate shells to one mesh."""
    offsets = np.cumsum([0, *(len(vertices) for vertices, _ in solids[:-1])])
    faces = [f + shift for (_, f), shift in zip(solids, offsets, strict=True)]
    return np.vstack([v for v, _ in solids]), np.vstack(faces).astype(np.int32)


def part(material: Material, solid: Solid) -> Part:
    return Part(material.name, material, *solid)


class Answer(NamedTuple):
    """End of one ray: range, outcome, remaining power, and the parts of walls there."""

    t: float
    outcome: Outcome
    power: float
    walls: frozenset[int] = frozenset()


class Oracle:
    """Answers for one scene and one medium."""

    def __init__(self, parts: Sequence[Part], medium: int = RADAR) -> None:
        name = "laser_density" if medium == LASER else "density"
        self.density = np.array([getattr(p.material, name) for p in parts])
        loss = [p.material.sheet_loss for p in parts]
        self.sheet = np.array([number is not None for number in loss])
        self.loss = np.array([number or 0.0 for number in loss])
        if medium == LASER:
            self.loss[:] = 0.0
        self.each = [p.vertices[p.faces] for p in parts]
        self.bounds = [(c.min(axis=(0, 1)), c.max(axis=(0, 1))) for c in self.each]
        self.corners = np.concatenate(self.each)
        self.owner = np.repeat(np.arange(len(parts)), [len(p.faces) for p in parts])

    def cut(
        self, origin: Floats, direction: Floats
    ) -> tuple[Floats, NDArray[np.bool_], NDArray[np.bool_]]:
        """Return where a ray meets planes, and which triangles it nears or hits."""
        a, b, c = self.corners.transpose(1, 0, 2)
        ab, ac, gap = b - a, c - a, origin - a
        p = np.cross(direction, ac)
        q = np.cross(gap, ab)
        with np.errstate(all="ignore"):
            scale = 1 / np.einsum("ij,ij->i", ab, p)
            u = np.einsum("ij,ij->i", gap, p) * scale
            v = q @ direction * scale
            t = np.einsum("ij,ij->i", ac, q) * scale
            ahead = np.isfinite(t) & (t >= -1e-9)
            near, hit = (
                ahead & (u >= -blur) & (v >= -blur) & (u + v <= 1 + blur)
                for blur in (1e-6, 1e-12)
            )
        return t, near, hit

    def inside(self, index: int, points: Floats) -> NDArray[np.bool_]:
        """Return which points a part contains: the solid angle of its faces."""
        low, high = self.bounds[index]
        answer: NDArray[np.bool_] = ((points > low) & (points < high)).all(axis=1)
        for row in np.flatnonzero(answer):
            a, b, c = (self.each[index] - points[row]).transpose(1, 0, 2)
            la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
            dots = (
                la * lb * lc
                + np.einsum("ij,ij->i", a, b) * lc
                + np.einsum("ij,ij->i", b, c) * la
                + np.einsum("ij,ij->i", c, a) * lb
            )
            triple = np.einsum("ij,ij->i", a, np.cross(b, c))
            answer[row] = np.arctan2(triple, dots).sum() > math.pi
        return answer

    def answer(
        self, origin: Floats, direction: Floats, max_range: float, power: float
    ) -> Answer:
        t, near, hit = self.cut(origin, direction)
        opaque = np.isinf(self.density)[self.owner]
        walls = t[hit & opaque]
        end = float(np.min(walls, initial=np.inf))
        stop = min(end, max_range)
        cuts = np.unique(np.clip(t[near & ~opaque & (t < stop)], 0.0, stop))
        cuts = np.concatenate([[0.0], cuts, [stop]])
        middles = origin + (cuts[:-1] + cuts[1:])[:, None] / 2 * direction
        sheets = near & self.sheet[self.owner] & ~opaque
        costs = np.zeros(len(middles))
        for index in np.flatnonzero(np.isfinite(self.density) & ~self.sheet).tolist():
            if self.density[index]:
                costs += self.density[index] * self.inside(index, middles)
        for start, until, cost in zip(cuts[:-1], cuts[1:], costs, strict=True):
            power -= float(self.loss[self.owner[sheets & (t == start)]].sum())
            if power <= 0.0:
                return Answer(float(start), Outcome.SPENT, 0.0)
            if cost * (until - start) >= power:
                return Answer(float(start + power / cost), Outcome.SPENT, 0.0)
            power -= float(cost * (until - start))
        if end > max_range:
            return Answer(stop, Outcome.NOTHING, power)
        met = self.owner[hit & opaque & (t <= end + EXACT)]
        return Answer(stop, Outcome.HIT, power, frozenset(met.tolist()))


def compare(
    parts: Sequence[Part],
    origins: Floats,
    directions: Floats,
    *,
    power: float = 1.0,
    max_range: float = 80.0,
    medium: int = RADAR,
) -> None:
    """Compare the engine with the oracle, ray by ray."""
    rays = Rays.uniform(
        origins, directions, max_range=max_range, power=power, medium=medium
    )
    traces = Tracer(parts).trace(rays)
    oracle = Oracle(parts, medium)
    for i in range(len(origins)):
        wanted = oracle.answer(origins[i], directions[i], max_range, power)
        t = wanted.t if wanted.outcome != Outcome.NOTHING else math.inf
        story = f"ray {i} from {origins[i].tolist()} along {directions[i].tolist()}"
        assert traces.outcomes[i] == wanted.outcome, story
        assert not wanted.walls or traces.parts[i] in wanted.walls, story
        assert traces.ranges[i] == pytest.approx(t, abs=EXACT), story
        assert traces.power[i] == pytest.approx(wanted.power, abs=EXACT), story


def room() -> Part:
    """Create a room: a brick that is looked at from within."""
    return part(CONCRETE, inverted(brick([16, 12, 6], [0, 0, 0])))


def wall_of_spheres(rng: np.random.Generator) -> list[Part]:
    spheres = [
        part(FOLIAGE, ball(rng.uniform(0.5, 0.9), [rng.uniform(0, 1), y, 0.1]))
        for y in np.linspace(-4, 4, 8)
    ]
    return [room(), *spheres]


def nested(rng: np.random.Generator) -> list[Part]:
    centre = rng.uniform(-0.5, 0.5, 3)
    balls = [
        part(material, ball(radius, centre + rng.uniform(-0.1, 0.1, 3)))
        for radius, material in ((2.5, HEDGE), (1.5, FOLIAGE), (0.7, HEDGE))
    ]
    return [*balls, part(CONCRETE, brick([0.4, 0.4, 0.4], centre))]


def coincident(rng: np.random.Generator) -> list[Part]:
    at = rng.uniform(-1, 1, 3)
    same = [part(m, ball(1.2, at)) for m in (FOLIAGE, HEDGE, FOLIAGE)]
    bricks = [part(m, brick([1, 2, 2], [3, 0, 0])) for m in (HEDGE, FOLIAGE)]
    return [*same, *bricks, part(CONCRETE, brick([1, 1, 1], [5, 0, 0]))]


def touching_walls(rng: np.random.Generator) -> list[Part]:
    poking = part(FOLIAGE, brick([1.5, 2, 2], [7.5, rng.uniform(-1, 1), 0]))
    flush = part(HEDGE, brick([2, 3, 1.5], [-7, 2, 0]))
    return [
        room(),
        part(CONCRETE, brick([1, 4, 4], [4, 0, 0])),
        part(FOLIAGE, brick([1, 4, 4], [3, 0, 0])),
        poking,
        flush,
        part(FOLIAGE, ball(1.5, [0, 6, 0])),
    ]


def shells_in_one_part(rng: np.random.Generator) -> list[Part]:
    overlapping = concatenate(
        *(ball(1, [0, y, 0]) for y in (-1.2, 0, 0.7, rng.uniform(0, 2)))
    )
    hollow = concatenate(ball(1.5, [3, 0, 0]), inverted(ball(0.8, [3.1, 0.2, 0])))
    twice = concatenate(ball(1, [-3, 0, 0]), ball(1, [-3, 0, 0]))
    return [
        part(FOLIAGE, overlapping),
        part(HEDGE, hollow),
        part(FOLIAGE, twice),
        part(CONCRETE, ball(0.3, [3.1, 0.2, 0])),
    ]


def leaves(rng: np.random.Generator) -> list[Part]:
    loose = rng.uniform(-2, 2, (60, 1, 3)) + rng.uniform(-0.6, 0.6, (60, 3, 3))
    faces = np.arange(180, dtype=np.int32).reshape(-1, 3)
    return [
        part(LEAF, (loose.reshape(-1, 3), faces)),
        part(LEAF, ball(0.8, [0, 0, 0])),
        part(FOLIAGE, ball(1.3, [0.4, 0, 0])),
        part(CONCRETE, inverted(brick([12, 12, 12], [0, 0, 0]))),
    ]


def media(rng: np.random.Generator) -> list[Part]:
    return [
        room(),
        part(SMOKE, brick([9, 9, 4], [0, 0, 0])),
        part(GLASS, brick([0.2, 3, 3], [rng.uniform(1, 2), 0, 0])),
        part(FOLIAGE, ball(1, [3, 1, 0])),
        part(SMOKE, ball(2, [-3, -1, 0])),
    ]


Make = Callable[[np.random.Generator], list[Part]]
SCENES: tuple[Make, ...] = (
    *(wall_of_spheres, nested, coincident, touching_walls),
    *(shells_in_one_part, leaves, media),
)


def some_rays(
    rng: np.random.Generator, parts: Sequence[Part], count: int
) -> tuple[Floats, Floats]:
    """Return random rays, half of them level; some start within objects."""
    points = np.vstack([p.vertices for p in parts])
    low, high = points.min(axis=0), points.max(axis=0)
    origins = rng.uniform(low, high, (count, 3))
    ray_directions = rng.uniform(low, high, (count, 3)) - origins
    level = rng.random(count) < 0.3
    ray_directions[level, 2] = 0.0
    return origins, ray_directions / np.linalg.norm(
        ray_directions, axis=1, keepdims=True
    )


@pytest.mark.parametrize("medium", [RADAR, LASER], ids=["radar", "laser"])
@pytest.mark.parametrize("make", SCENES)
def test_scenes_match_the_oracle(make: Make, medium: int) -> None:
    rng = np.random.Generator(np.random.PCG64(7))
    parts = make(rng)
    origins, directions = some_rays(rng, parts, 300)
    compare(parts, origins, directions, medium=medium)


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("make", SCENES)
def test_hundreds_of_thousands_of_rays_match_the_oracle(make: Make, seed: int) -> None:
    rng = np.random.Generator(np.random.PCG64(seed))
    parts = make(rng)
    origins, directions = some_rays(rng, parts, 6000)
    compare(parts, origins, directions)
    compare(parts, origins[:3000], directions[:3000], medium=LASER, power=0.4)


@pytest.mark.parametrize("make", SCENES)
def test_scenes_match_the_oracle_from_a_kilometre_away(make: Make) -> None:
    rng = np.random.Generator(np.random.PCG64(13))
    parts = [
        part(p.material, (p.vertices + np.array([480, 300, 3]), p.faces))
        for p in make(rng)
    ]
    points = np.vstack([p.vertices for p in parts])
    origins = np.array([-480.0, -300, 0]) + rng.uniform(-5, 5, (120, 3))
    ray_directions = points[rng.integers(len(points), size=120)] + rng.normal(
        0, 0.3, (120, 3)
    )
    ray_directions -= origins
    directions = ray_directions / np.linalg.norm(ray_directions, axis=1, keepdims=True)
    compare(parts, origins, directions, max_range=1500.0)


def shuffled(rng: np.random.Generator, parts: Sequence[Part]) -> list[Part]:
    """Shuffle the parts, their triangles, and which corner of one comes first."""
    result = []
    for index in rng.permutation(len(parts)):
        p = parts[index]
        faces = p.faces[rng.permutation(len(p.faces))]
        first = rng.integers(3, size=len(faces))
        faces = np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1)
        result.append(Part(p.object_name, p.material, p.vertices, faces))
    return result


@settings(deadline=None, max_examples=15)
@given(seed=st.integers(0, 2**32 - 1), make=st.sampled_from(SCENES))
def test_order_of_parts_and_triangles_does_not_matter(seed: int, make: Make) -> None:
    rng = np.random.Generator(np.random.PCG64(seed))
    parts = make(rng)
    origins, directions = some_rays(rng, parts, 300)
    rays = Rays.uniform(origins, directions, max_range=80.0, power=1.0)
    one, other = (Tracer(p).trace(rays) for p in (parts, shuffled(rng, parts)))
    np.testing.assert_allclose(other.ranges, one.ranges, rtol=0, atol=EXACT)
    np.testing.assert_allclose(other.power, one.power, rtol=0, atol=EXACT)
    assert other.outcomes.tolist() == one.outcomes.tolist()
