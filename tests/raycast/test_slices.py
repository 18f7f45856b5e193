"""Level rays find in a slice of a scene what they find in the whole scene."""

import sys
import time
from concurrent.futures import ThreadPoolExecutor
from types import FrameType
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from parts import brick

from radarsim.raycast import embree
from radarsim.raycast.rays import RADAR, RayClass, Rays, Traces
from radarsim.raycast.tracer import Tracer
from radarsim.scene import shapes
from radarsim.scene.material import Material
from radarsim.scene.scene import Part

MATERIALS = (
    Material("foliage", density=0.05),
    Material("concrete"),
    Material("metal", radar_mirror=True),
)
REFLECTED = (RayClass(RADAR, max_reflections=2),)
BALL = shapes.sphere(5.0)
RAYS_AT_ONCE = embree.RAYS_PER_SLICE // 2  # for which the whole scene gets no slice


def forest(rng: np.random.Generator) -> list[Part]:
    """Create balls and boxes of all materials; half of them stand on one plane."""
    parts = []
    for i in range(60):
        material = MATERIALS[i % 3]
        vertices, faces = shapes.sphere(1.0) if i % 2 else shapes.box(1.0, 2.0, 1.5)
        z = 0.75 if i % 4 < 2 else rng.uniform(-2.0, 3.0)
        at = np.array([*rng.uniform(-20.0, 20.0, 2), z])
        parts.append(Part(f"{material.name} {i}", material, vertices + at, faces))
    leaf = np.array([[5.0, -1.0, -1.0], [5.0, 1.0, -1.0], [5.0, 0.0, 4.0]])
    sheet = Material("leaf", density=0.0, sheet_loss=0.2)
    parts.append(Part("leaf", sheet, leaf, np.array([[0, 1, 2]], np.int32)))
    return parts


def level_rays(rng: np.random.Generator, parts: list[Part], z: float, n: int) -> Rays:
    """Cast level rays from anywhere, half of them through the edges of triangles."""
    corners = np.vstack([part.vertices for part in parts])
    origins = np.column_stack([rng.uniform(-22.0, 22.0, (n, 2)), np.full(n, z)])
    ends = rng.uniform(-22.0, 22.0, (n, 2))
    ends[::2] = corners[rng.integers(len(corners), size=len(ends[::2])), :2]
    directions = np.zeros((n, 3))
    directions[:, :2] = ends - origins[:, :2]
    directions[::10] = [[-1.0, 0.0, 0.0]]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rays = Rays.uniform(origins, directions, max_range=60.0, ray_classes=REFLECTED)
    rays.power[:] = rng.choice([0.5, 1.0, np.inf], n)
    return rays


def results(traces: Traces) -> list[bytes]:
    return [column.tobytes() for column in traces]


def check_slices(
    rng: np.random.Generator, parts: list[Part], rays_a_height: int
) -> int:
    """Trace level rays with and without a slice; return how many met something."""
    corners = np.vstack([part.vertices for part in parts])
    sliced, hits = Tracer(parts), 0
    # Between vertices; at the vertices of one part; at level faces; above everything.
    for z in (0.3, float(rng.choice(corners[:, 2])), 0.0, 1.5, 50.0):
        for _ in range(2):
            sliced.trace(level_rays(rng, parts, z, 2 * embree.RAYS_PER_SLICE))
        whole_scene = Tracer(parts)
        for _ in range(rays_a_height // RAYS_AT_ONCE):
            rays = level_rays(rng, parts, z, RAYS_AT_ONCE)
            whole = whole_scene.trace(rays, events=True, incidence=True)
            found = sliced.trace(rays, events=True, incidence=True)
            assert results(found) == results(whole)
            met = int(np.count_nonzero(np.isfinite(whole.ranges)))
            assert not (met and z == 50.0)
            hits += met
            whole_scene = Tracer(parts)  # before it gets a slice of its own
    return hits


@pytest.mark.parametrize("seed", range(3))
def test_traces_are_the_same_bytes_with_and_without_a_slice(seed: int) -> None:
    rng = np.random.Generator(np.random.PCG64(seed))
    assert check_slices(rng, forest(rng), RAYS_AT_ONCE) > RAYS_AT_ONCE


def test_tilted_rays_search_the_whole_scene() -> None:
    floor = brick(Material("concrete"), (20.0, 20.0, 1.0), (0.0, 0.0, -5.0))
    tracer = Tracer([floor, brick(Material("wood"), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0))])
    from_left = np.full((1, 3), [-8.0, 0.0, 0.2])
    ahead = np.repeat(from_left, 2 * embree.RAYS_PER_SLICE, axis=0), np.eye(3)[[0]]
    level = Rays.uniform(ahead[0], np.repeat(ahead[1], len(ahead[0]), 0), max_range=20)
    for _ in range(2):
        assert tracer.trace(level).ranges.tolist() == [7.5] * len(ahead[0])
    down = Rays.uniform(from_left, np.array([[0.0, 0.0, -1.0]]), max_range=20)
    assert tracer.trace(down).ranges.tolist() == pytest.approx([4.7])


def test_slice_is_added_once_rays_have_paid_for_it() -> None:
    scene = embree.EmbreeScene([BALL])
    rising = np.linspace(0.0, 0.19, 3 * embree.MAX_SLICES).tolist()
    for height in rising:  # as of a robot that flies, once at each height
        scene.count_unsliced(height, embree.RAYS_PER_SLICE // 2)
        scene.count_unsliced(0.2, 2)
    assert scene.handle.heights.tolist()[1:] == []
    scene.count_unsliced(0.2, 2 * embree.RAYS_PER_SLICE)
    assert scene.handle.heights.tolist()[1:] == [0.2]
    assert 0 < len(scene.handle.sliced) < len(scene.triangles) / 2


def test_number_of_slices_is_limited() -> None:
    scene = embree.EmbreeScene([BALL])
    for height in np.linspace(-1.0, 1.0, 3 * embree.MAX_SLICES):
        scene.count_unsliced(height, 10 * embree.RAYS_PER_SLICE)
    assert len(scene.handle.heights) == embree.MAX_SLICES + 1


def test_large_slice_that_has_most_triangles_is_the_whole_scene() -> None:
    vertices, faces = shapes.box(1.0, 1.0, 1.0)
    many = np.tile(faces, (2 * embree.SMALL_SLICE // len(faces), 1))
    scene = embree.EmbreeScene([(vertices, many)])
    scene.add_slice(0.0)
    assert scene.handle.addresses[1] == scene.handle.addresses[0]
    assert len(scene.handle.sliced) == 0


def slivers(rng: np.random.Generator, count: int, z: float) -> Part:
    """Create triangles that hardly reach the height z, or are nearly level there."""
    corners = np.zeros((count, 3, 3))
    corners[:, :, :2] = rng.uniform(-9.0, 9.0, (count, 1, 2))
    corners[:, :, :2] += rng.uniform(-1.0, 1.0, (count, 3, 2))
    heights = 10.0 ** rng.uniform(-17.0, 0.0, (count, 3))
    corners[:, :, 2] = z + heights * rng.choice([-1.0, 0.0, 1.0], (count, 3))
    sheet = Material("leaf", density=0.0, sheet_loss=0.01)
    faces = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    return Part("leaves", sheet, corners.reshape(-1, 3), faces)


@pytest.mark.parametrize("z", [0.0, 0.346, 1e-6])
def test_triangles_that_hardly_reach_the_height_are_found_in_a_slice(z: float) -> None:
    rng = np.random.Generator(np.random.PCG64(7))
    parts = [slivers(rng, 3000, z)]
    sliced = Tracer(parts)
    for _ in range(3):
        sliced.trace(level_rays(rng, parts, z, 2 * embree.RAYS_PER_SLICE))
    rays = level_rays(rng, parts, z, embree.RAYS_PER_SLICE // 2)
    whole = Tracer(parts).trace(rays, events=True)
    assert len(whole.events) > 10 * embree.RAYS_PER_SLICE
    assert results(sliced.trace(rays, events=True)) == results(whole)


@settings(max_examples=40)
@given(
    corners=st.lists(st.floats(-5, 5), min_size=9, max_size=9),
    low=st.floats(-4, 4),
    depth=st.floats(0, 3),
)
def test_box_of_a_clipped_triangle_has_all_its_points_between_the_heights(
    corners: list[float], low: float, depth: float
) -> None:
    whole, high = np.array(corners).reshape(3, 3), low + depth
    assume(whole[:, 2].min() <= high and whole[:, 2].max() >= low)
    lower, upper, _ = embree.clip_to_slab(whole.reshape(1, 9), low, high).reshape(3, 3)
    assert (lower <= upper).all()
    points = np.random.Generator(np.random.PCG64(0)).dirichlet([0.5] * 3, 500) @ whole
    points = points[(points[:, 2] >= low) & (points[:, 2] <= high)]
    assert (points >= lower - 1e-12).all()
    assert (points <= upper + 1e-12).all()
    assert (lower >= whole.min(axis=0) - 1e-12).all()
    assert (upper <= whole.max(axis=0) + 1e-12).all()


def switch_threads(frame: FrameType, *_: Any) -> Any:
    """Let other threads run after each line of ``EmbreeScene.add_slice``."""
    if frame.f_code is embree.EmbreeScene.add_slice.__code__:
        time.sleep(1e-4)
        return switch_threads
    return None


def test_threads_that_add_slices_at_once_do_not_mix_them() -> None:
    scene = embree.EmbreeScene([BALL])
    heights = np.linspace(-4.5, 4.5, 40).tolist()
    with ThreadPoolExecutor(
        8, initializer=lambda: sys.settrace(switch_threads)
    ) as pool:
        list(pool.map(scene.add_slice, heights))
    handle = scene.handle
    assert len(handle.heights) > 1
    built = {each.address: each for each in scene.hierarchies}
    slices = [built[address] for address in handle.addresses[1:].tolist()]
    ends = [each.first_sliced for each in slices[1:]] + [len(handle.sliced)]
    for height, each, end in zip(handle.heights[1:], slices, ends, strict=True):
        triangles = scene.triangles[handle.sliced[each.first_sliced : end]]
        z = triangles[:, 2::3]
        assert (z.min(axis=1) <= height + 1e-4).all()
        assert (z.max(axis=1) >= height - 1e-4).all()
        np.testing.assert_array_equal(each.triangles, triangles)
