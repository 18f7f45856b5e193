"""The power on the way, against what paper and pencil give."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim import Material, Part
from radarsim.geometry import Floats
from radarsim.plotting.marks import MAX_POWER_DROP, RaySegments, split_rays
from radarsim.raycast.rays import LASER, RADAR, Rays
from radarsim.raycast.tracer import Tracer
from radarsim.scene.shapes import box

WALL = Material("wall")


def slab(material: Material, near: float, far: float) -> Part:
    """Make something across the x axis."""
    vertices, faces = box(far - near, 4, 4)
    middle = np.array([(near + far) / 2, 0, 0])
    return Part(material.name, material, vertices + middle, faces)


def ray(power: float = 1.0, max_range: float = 20.0, medium: int = RADAR) -> Rays:
    return Rays.uniform(
        np.zeros((1, 3)), np.eye(3)[:1], max_range=max_range, power=power, medium=medium
    )


def halfway(segments: RaySegments) -> Floats:
    return np.asarray((segments.starts + segments.ends) / 2)


def assert_they_lie_end_to_end(segments: RaySegments, end: float) -> None:
    assert segments.starts[0] == 0
    assert segments.ends[:-1] == pytest.approx(segments.starts[1:], abs=1e-12)
    assert segments.ends[-1] == pytest.approx(end, abs=1e-9)
    assert np.all(segments.ends > segments.starts)


@given(
    density=st.floats(0.01, 5), thickness=st.floats(0.1, 3), power=st.floats(0.1, 10)
)
def test_power_falls_linearly_in_a_slab(
    density: float, thickness: float, power: float
) -> None:
    hedge = Material("hedge", density=density)
    tracer = Tracer([slab(hedge, 2, 2 + thickness), slab(WALL, 8, 9)])
    segments = split_rays(tracer, ray(power))
    spent = density * thickness >= power
    assert_they_lie_end_to_end(segments, 2 + power / density if spent else 8)
    inside = np.clip(halfway(segments) - 2, 0, thickness)
    assert segments.shares == pytest.approx(1 - density * inside / power, abs=1e-6)
    assert np.all(np.diff(segments.shares) <= 1e-12)


def test_no_segment_loses_more_than_the_maximum_drop() -> None:
    tracer = Tracer([slab(Material("hedge", density=0.9), 2, 3), slab(WALL, 8, 9)])
    segments = split_rays(tracer, ray())
    lengths = segments.ends - segments.starts
    inside = (segments.starts >= 2) & (segments.ends <= 3)
    assert np.sum(lengths[inside]) == pytest.approx(1)
    assert np.all(0.9 * lengths[inside] <= MAX_POWER_DROP + 1e-9)
    assert np.count_nonzero(~inside) == 2  # where nothing falls, nothing is cut


def test_power_falls_from_the_origin_inside_a_volume() -> None:
    hedge = Material("hedge", density=0.5)
    segments = split_rays(Tracer([slab(hedge, -1, 1), slab(WALL, 8, 9)]), ray())
    assert_they_lie_end_to_end(segments, 8)
    assert segments.shares[0] == pytest.approx(1 - 0.5 * halfway(segments)[0])
    assert segments.shares[-1] == pytest.approx(0.5)


LEAVES = Material("leaves", density=0.0, laser_density=0.0, sheet_loss=0.15)


def test_each_sheet_reduces_the_power_of_a_radar_alone() -> None:
    tracer = Tracer([slab(LEAVES, 2, 3), slab(WALL, 8, 9)])
    segments = split_rays(tracer, ray())
    assert_they_lie_end_to_end(segments, 8)
    assert segments.ends == pytest.approx([2, 3, 8])
    assert segments.shares == pytest.approx([1, 0.85, 0.7])
    assert split_rays(tracer, ray(medium=LASER)).shares == pytest.approx([1, 1, 1])


def test_losses_of_a_sheet_inside_a_volume_add_up() -> None:
    hedge = Material("hedge", density=0.1)
    segments = split_rays(Tracer([slab(hedge, 1, 5), slab(LEAVES, 2, 4)]), ray())
    middles = halfway(segments)
    crossed = (middles > 2).astype(int) + (middles > 4)
    expected = 1 - 0.1 * np.clip(middles - 1, 0, 4) - 0.15 * crossed
    assert segments.shares == pytest.approx(expected)
    assert_they_lie_end_to_end(segments, 20)


@pytest.mark.parametrize(
    "power", [pytest.param(np.inf, id="unlimited"), pytest.param(0.0, id="none")]
)
def test_infinite_or_zero_power_has_share_one(power: float) -> None:
    hedge = Material("hedge", density=0.0)
    segments = split_rays(Tracer([slab(hedge, 2, 3), slab(WALL, 8, 9)]), ray(power))
    assert_they_lie_end_to_end(segments, 8)
    assert np.all(segments.shares == 1)


def test_a_ray_that_meets_nothing_goes_to_the_end_of_its_reach() -> None:
    pieces = split_rays(Tracer([]), ray(max_range=7))
    assert (pieces.starts.tolist(), pieces.ends.tolist()) == ([0], [7])


def test_every_ray_has_its_own_segments() -> None:
    origins = np.array([[0.0, 0, 0], [0, 9, 0], [1, 0, 0]])
    rays = Rays.uniform(origins, np.eye(3)[[0, 0, 0]], max_range=20, power=1.0)
    tracer = Tracer([slab(Material("hedge", density=0.5), 2, 3), slab(WALL, 8, 9)])
    segments = split_rays(tracer, rays)
    ends = [segments.ends[segments.rays == i][-1] for i in range(3)]
    assert ends == pytest.approx([8, 20, 7])
    assert [segments.shares[segments.rays == i][-1] for i in range(3)] == [0.5, 1, 0.5]


def test_lines_are_projected_onto_the_floor() -> None:
    way = np.array([[0.6, 0.0, 0.8]])
    rays = Rays.uniform(np.array([[1.0, 2, 3]]), way, max_range=10)
    lines = split_rays(Tracer([]), rays).lines
    assert lines.tolist() == [[[1, 2], [7, 2]]]
