import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.raycast.rays import LASER, RADAR
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import box

WALL, LEAF = Material("wall"), Material("leaf", density=1.0)
ROOM = Part("room", WALL, *box(10, 10, 10))


def bush(x: float) -> Part:
    vertices, faces = box(1, 1, 1)
    return Part("bush", LEAF, vertices + np.array([x, 0, 0]), faces)


@given(x=st.floats(-6, 6), y=st.floats(-4, 4), radius=st.floats(0.01, 3))
def test_point_is_clear_if_no_wall_is_within_the_radius(
    x: float, y: float, radius: float
) -> None:
    tracer = Tracer([ROOM])
    gap = min(abs(5 - abs(x)), 5 - abs(y), 5)
    is_clear = tracer.is_clear(np.array([x, y, 0.0]), radius, RADAR, None, -1)
    if gap < radius:
        assert not is_clear
    elif gap > radius + 1e-3:
        assert is_clear


@pytest.mark.parametrize(("medium", "is_clear"), [(RADAR, True), (LASER, False)])
def test_foliage_is_opaque_only_to_lasers(medium: int, is_clear: bool) -> None:
    tracer = Tracer([ROOM, bush(1)])
    place = np.array([0.45, 0.0, 0.0])
    assert tracer.is_clear(place, 0.1, medium, None, -1) is is_clear


def test_other_robots_are_opaque_and_the_carrier_is_not() -> None:
    tracer = Tracer([ROOM])
    boxes = Boxes(np.array([[1.0, 0, 0, -1, 1, 0.3, 0.2, 7]]))
    place = np.array([0.6, 0.0, 0.0])
    assert not tracer.is_clear(place, 0.1, RADAR, boxes, -1)
    assert tracer.is_clear(place, 0.1, RADAR, boxes, 7)
    assert tracer.is_clear(place - 2.0, 0.1, RADAR, boxes, -1)


def test_every_point_of_an_empty_scene_is_clear() -> None:
    assert Tracer([]).is_clear(np.zeros(3), 5.0, RADAR, None, -1)
