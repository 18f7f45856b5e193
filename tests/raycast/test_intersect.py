import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from parts import brick, rays_ahead

from radarsim.engine import engine
from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.raycast.rays import LASER, RADAR, Boxes, RayClass, Rays
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material

WALL, LEAF = Material("wall"), Material("leaf", density=1.0)
ROOM = brick(WALL, (10, 10, 10), (0, 0, 0))


def is_hidden(
    tracer: Tracer,
    place: Floats,
    radius: float,
    medium: int = RADAR,
    boxes: Boxes | None = None,
    carrier_id: int = -1,
) -> list[bool]:
    """Return which rays are replaced that start to the right and left of a sensor."""
    apart = np.array([-radius, 0.0, radius])[:, None, None] * [0.0, 1.0, 0.0]
    nodes = engine.structures["NodeTable"].pack(
        directions=np.tile([1.0, 0.0, 0.0], (3, 1, 1)),
        starts=apart,
        edges=np.zeros(2),
        sides=np.array([-1, 0, 1], np.int8),
    )
    fields = rays_ahead().pack().fields | {"table": nodes, "radius": radius}
    fields |= {"origins": np.zeros((0, 3)), "directions": np.zeros((0, 3))}
    source = engine.structures["RaySource"].pack(**fields)
    places = np.array([[*place, 0.0, 0.0, 0.0, carrier_id]])
    drawn, sides = np.zeros(3, np.int16), np.zeros(3, np.int8)
    scans = places, np.zeros((1, 0)), drawn, sides
    tracer.trace_scans(source, (RayClass(medium), RayClass(medium)), scans, boxes)
    assert drawn.tolist() == [1 + side for side in sides.tolist()]
    assert sides[1] == 0
    return [sides[0] == 0, sides[2] == 0]


@settings(max_examples=40)
@given(x=st.floats(-6, 6), y=st.floats(-4, 4), radius=st.floats(0.01, 3))
def test_ray_is_replaced_if_a_wall_is_before_its_start(
    x: float, y: float, radius: float
) -> None:
    assume(abs(abs(x) - 5) > 1e-3)
    tracer, inside = Tracer([ROOM]), abs(x) < 5
    assume(abs(radius - (5 - y)) > 1e-3 < abs(radius - (5 + y)))
    expected = [inside and radius > 5 + y, inside and radius > 5 - y]
    assert is_hidden(tracer, np.array([x, y, 0.0]), radius) == expected


@pytest.mark.parametrize(("medium", "hidden"), [(RADAR, False), (LASER, True)])
def test_foliage_is_opaque_only_to_lasers(medium: int, hidden: bool) -> None:
    tracer = Tracer([ROOM, brick(LEAF, (1, 1, 1), (1, 0, 0))])
    place = np.array([1.0, -0.6, 0.0])
    assert is_hidden(tracer, place, 0.2, medium) == [False, hidden]


def test_other_robots_are_opaque_and_the_carrier_is_not() -> None:
    tracer = Tracer([ROOM])
    boxes = Boxes(np.array([[1.0, 0, 0, -1, 1, 0.3, 0.2, 7]]))
    place = np.array([1.0, -0.25, 0.0])
    assert is_hidden(tracer, place, 0.1, boxes=boxes) == [False, True]
    assert is_hidden(tracer, place, 0.1, boxes=boxes, carrier_id=7) == [False] * 2
    assert is_hidden(tracer, place - 2.0, 0.1, boxes=boxes) == [False] * 2


@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**32),
    count=st.sampled_from([1, 8, 150]),
    far=st.sampled_from([0.0, 50.0, 1e9]),
)
def test_boxes_hide_the_starts_that_a_ray_to_them_does_not_reach(
    seed: int, count: int, far: float
) -> None:
    rng = np.random.Generator(np.random.PCG64(seed))
    rows = rng.uniform([-3, -3, -3, -1, 0, 0.1, 0.1], [3, 3, 3, 0, 1, 1, 1], (count, 7))
    rows[1::9, 0] += far
    boxes, tracer = Boxes(np.column_stack([rows, np.arange(count)])), Tracer([])
    for place in rng.uniform(-3, 3, (10, 3)) * [1.0, 1.0, 0.2]:
        for radius in (0.1, 2.0):
            aside = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
            rays = Rays.uniform(np.tile(place, (2, 1)), aside, max_range=radius)
            rays.carrier_id[:] = 1
            expected = np.isfinite(tracer.trace(rays, boxes).ranges).tolist()
            found = is_hidden(tracer, place, radius, boxes=boxes, carrier_id=1)
            assert found == expected


def test_pose_that_is_not_finite_is_rejected() -> None:
    with pytest.raises(
        EngineError, match=r"^pose \[nan, 0.0, 0.0, 0.0, 0.0, 0.0\], ex"
    ):
        is_hidden(Tracer([ROOM]), np.array([np.nan, 0.0, 0.0]), 0.1)
