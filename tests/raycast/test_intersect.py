from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.geometry import Floats
from radarsim.raycast.aimed_rays import NodeTable, SensorRays, UnaimedScans
from radarsim.raycast.rays import LASER, RADAR, RayClass, Rays, columns_of
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import box

WALL, LEAF = Material("wall"), Material("leaf", density=1.0)
ROOM = Part("room", WALL, *box(10, 10, 10))


def are_clear(
    tracer: Tracer,
    places: Floats,
    radius: float,
    medium: int = RADAR,
    boxes: Boxes | None = None,
    carrier_ids: Sequence[int] = (-1,),
) -> list[bool]:
    """Return at which places scans of a sensor are traced whose rays start apart."""
    ahead, aside = np.array([[[1.0, 0, 0]]]), np.array([[[0, radius, 0]]])
    table = NodeTable(ahead, aside, np.zeros(0), np.zeros(1, np.int8))
    ray = Rays.uniform(np.zeros((1, 3)), ahead[0], max_range=9.0)
    ray_class = RayClass(medium)
    rows = np.zeros((len(places), 7))
    rows[:, :3], rows[:, 6] = places, carrier_ids
    sensor = SensorRays(table, radius, columns_of(ray), (ray_class, ray_class), 1)
    scans = UnaimedScans(sensor, np.zeros((1, 0)), rows)
    traced = tracer.trace_scans(scans, boxes)
    clear: list[bool] = traced.clear.tolist()
    assert traced.crowded == clear.count(False)
    return clear


def is_clear(
    tracer: Tracer,
    place: Floats,
    radius: float,
    medium: int = RADAR,
    boxes: Boxes | None = None,
    carrier_id: int = -1,
) -> bool:
    return are_clear(tracer, place[None], radius, medium, boxes, [carrier_id])[0]


def bush(x: float) -> Part:
    vertices, faces = box(1, 1, 1)
    return Part("bush", LEAF, vertices + np.array([x, 0, 0]), faces)


@given(x=st.floats(-6, 6), y=st.floats(-4, 4), radius=st.floats(0.01, 3))
def test_point_is_clear_if_no_wall_is_within_the_radius(
    x: float, y: float, radius: float
) -> None:
    tracer = Tracer([ROOM])
    gap = min(abs(5 - abs(x)), 5 - abs(y), 5)
    clear = is_clear(tracer, np.array([x, y, 0.0]), radius)
    if gap < radius:
        assert not clear
    elif gap > radius + 1e-3:
        assert clear


@pytest.mark.parametrize(("medium", "clear"), [(RADAR, True), (LASER, False)])
def test_foliage_is_opaque_only_to_lasers(medium: int, clear: bool) -> None:
    tracer = Tracer([ROOM, bush(1)])
    place = np.array([0.45, 0.0, 0.0])
    assert is_clear(tracer, place, 0.1, medium) is clear


def test_other_robots_are_opaque_and_the_carrier_is_not() -> None:
    tracer = Tracer([ROOM])
    boxes = Boxes(np.array([[1.0, 0, 0, -1, 1, 0.3, 0.2, 7]]))
    place = np.array([0.6, 0.0, 0.0])
    assert not is_clear(tracer, place, 0.1, boxes=boxes)
    assert is_clear(tracer, place, 0.1, boxes=boxes, carrier_id=7)
    assert is_clear(tracer, place - 2.0, 0.1, boxes=boxes)
