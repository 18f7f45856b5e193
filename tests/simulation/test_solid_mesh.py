import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarsim.geometry import Floats
from radarsim.robots.obstacles import slice_parts
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.simulation.flight import Area, SolidMesh


def reaching_into(segments: Floats, area: Area) -> Floats:
    """Return the segments whose bounding boxes reach into an area."""
    low, high = segments.min(axis=1), segments.max(axis=1)
    x_min, x_max, y_min, y_max = area
    inside = (low <= [x_max, y_max]) & (high >= [x_min, y_min])
    reaching: Floats = segments[inside.all(axis=1)]
    return reaching


@settings(max_examples=20)
@given(
    x=st.floats(-12, 12),
    y=st.floats(-12, 12),
    size=st.floats(0, 8),
    height=st.floats(-0.5, 6),
)
def test_a_slice_is_that_of_all_parts_in_the_same_order(
    foliage_room: Scene, x: float, y: float, size: float, height: float
) -> None:
    area = x, x + size, y, y + size
    solid = [part for part in foliage_room.parts if part.material.solid]
    expected = reaching_into(slice_parts(solid, height), area)
    found = SolidMesh(foliage_room.parts).slice(area, height)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("solid", [True, False])
def test_parts_that_are_not_solid_are_left_out(solid: bool) -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1]])
    faces = np.array([[0, 1, 2]], np.int32)
    part = Part("p", Material("m", 1.0, 1.0, solid=solid), corners, faces)
    found = SolidMesh([part]).slice((-1, 2, -1, 2), 0.5)
    assert found.shape == (int(solid), 2, 2)


def test_sorting_takes_little_memory() -> None:
    count = 400_000
    corners = np.zeros((3, 3))
    faces = np.tile(np.arange(3, dtype=np.int32), (count, 1))
    part = Part("p", Material("m"), corners, faces)
    tracemalloc.start()
    try:
        SolidMesh([part])
        assert tracemalloc.get_traced_memory()[1] < 120 * count  # bytes
    finally:
        tracemalloc.stop()
