import gc
import math
import weakref
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from parts import brick

from radarsim.errors import EngineError
from radarsim.raycast.rays import EVENT, Boxes, EventKind, Outcome, Rays, Traces
from radarsim.raycast.tracer import (
    INITIAL_CAPACITY,
    Tracer,
    check_known_end,
    tracer_of,
)
from radarsim.scene import shapes
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene

AHEAD = (1.0, 0.0, 0.0)
CONCRETE = Material("concrete")


def foliage(density: float) -> Material:
    return Material("foliage", density=density)


def rays(origins: Any, ray_direction: Any = AHEAD, **settings: Any) -> Rays:
    starts = np.asarray(origins, float)
    directions = np.broadcast_to(np.asarray(ray_direction, float), starts.shape)
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    return Rays.uniform(
        starts, directions, **{"max_range": 80.0, "power": 1.0} | settings
    )


def one(
    parts: list[Part], origin: Any = (0, 0, 0), ray_direction: Any = AHEAD, **kind: Any
) -> tuple[float, Outcome, int, float]:
    traces = Tracer(parts).trace(rays([origin], ray_direction, **kind))
    t, left = float(traces.ranges[0]), float(traces.power[0])
    return t, Outcome(traces.outcomes[0]), int(traces.parts[0]), left


def test_ray_in_an_empty_scene_hits_nothing() -> None:
    assert one([]) == (math.inf, Outcome.NOTHING, -1, 1.0)


@settings(deadline=None, max_examples=50)
@given(
    y=st.floats(-1.5, 1.5),
    z=st.floats(-1.5, 1.5),
    yaw=st.floats(-0.2, 0.2),
    at=st.sampled_from([0.0, 100.0, 480.0]),
)
@example(y=0.0, z=0.0, yaw=-5e-324, at=100.0)  # next to nothing, along an edge
def test_chord_of_a_sphere_is_that_of_its_triangles(
    y: float, z: float, yaw: float, at: float
) -> None:
    radius, far = 1.2, 1000.0
    vertices, faces = shapes.sphere(radius)
    ball = Part("ball", foliage(0.1), vertices + np.array([at, at, 3.0]), faces)
    origin = np.array([at - 5, at + y - 5 * math.sin(yaw), 3 + z])
    ray_direction = np.array([math.cos(yaw), math.sin(yaw), 0])
    traces = Tracer([ball]).trace(rays(origin[None], ray_direction, max_range=far))
    gap = np.array([at, at, 3.0]) - origin
    off = float(gap @ gap - (gap @ ray_direction) ** 2)
    chord = (1 - traces.power[0]) / 0.1
    longest = 2 * math.sqrt(max(radius**2 - off, 0.0))
    shortest = 2 * math.sqrt(max((radius * (1 - 0.0047)) ** 2 - off, 0.0))
    assert shortest - 1e-9 <= chord <= longest + 1e-9


def test_part_that_takes_the_last_power_is_reported() -> None:
    bush, tree = (brick(foliage(0.5), (9, 2, 2), (x, 0, 0)) for x in (5.5, 6.0))
    assert one([bush, tree]) == (2.25, Outcome.SPENT, 1, 0.0)


@pytest.mark.parametrize(
    ("max_range", "outcome"), [(4.5, Outcome.HIT), (4.4999, Outcome.NOTHING)]
)
@pytest.mark.parametrize("shift", [0.0, 0.1, 1 / 3, 401.7])
def test_maximum_range_is_inclusive(
    max_range: float, outcome: Outcome, shift: float
) -> None:
    wall = brick(CONCRETE, (1, 4, 4), (5 + shift, 0, 0))
    t, found, _, _ = one([wall], (shift, 0, 0), max_range=max_range)
    assert found == outcome
    assert t == (pytest.approx(4.5) if outcome == Outcome.HIT else math.inf)


@pytest.mark.parametrize("x", [-1.0, np.nextafter(-1, -2), np.nextafter(-1, 0)])
@pytest.mark.parametrize(
    ("ray_direction", "cost"),
    [(AHEAD, 0.2), ((-1.0, 0, 0), 0.0), ((1.0, 1, 0), 0.1 * math.sqrt(2))],
)
def test_ray_from_a_face_is_attenuated_by_what_is_ahead(
    x: float, ray_direction: tuple[float, float, float], cost: float
) -> None:
    bush = brick(foliage(0.1), (2, 2, 2), (0, 0, 0))
    assert one([bush], (x, 0, 0), ray_direction)[3] == pytest.approx(1 - cost, abs=1e-9)


@pytest.mark.parametrize("shift", [0.0, 0.1, 1 / 3, 401.7])
@pytest.mark.parametrize(
    "off",
    [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.3, -1.0), (1.0, 1.0), (-1.0, 1.0)],
)
def test_ray_along_a_face_or_an_edge_is_inside_or_outside_throughout(
    off: tuple[float, float], shift: float
) -> None:
    bush = brick(foliage(0.1), (2, 2, 2), (5, shift, shift))
    origin = (0.0, shift + off[0], shift + off[1])
    cost = 1 - one([bush], origin)[3]
    assert min(abs(cost), abs(cost - 0.2)) < 1e-9


def test_side_by_side_volumes_leave_no_gap_between_them() -> None:
    bushes = [brick(foliage(0.1), (2, 2, 2), (5, y, 0)) for y in (-1, 1)]
    assert one(bushes)[3] == pytest.approx(1 - 0.2)


def test_robots_stop_all_rays_but_their_own() -> None:
    tracer = Tracer([brick(CONCRETE, (1, 9, 9), (9.5, 0, 0))])
    cast = rays(np.zeros((2, 3)))
    cast.carrier_id[:] = 7, -1
    boxes = Boxes(np.array([[3, 0, 0, -1, 1, 1, 1, 7.0], [30, 0, 0, -1, 1, 1, 1, 8]]))
    traces = tracer.trace(cast, boxes)
    assert traces.ranges.tolist() == [9.0, 2.0]
    assert traces.parts.tolist() == [0, 1 + 7]
    assert traces.outcomes.tolist() == [Outcome.HIT, Outcome.HIT]


def test_robot_in_foliage_costs_the_foliage_before_it() -> None:
    tracer = Tracer([brick(foliage(0.1), (8, 9, 9), (5, 0, 0))])
    boxes = Boxes(np.array([[5, 0, 0, -1, 1, 1, 1, 0.0]]))
    traces = tracer.trace(rays([(0, 0, 0)]), boxes)
    assert traces.ranges.tolist() == [4.0]
    assert traces.power.tolist() == [pytest.approx(0.7)]


def sheets(count: int) -> Part:
    """Create so many leaves, one behind the other."""
    leaf = np.array([[0.0, -1, -1], [0, 1, -1], [0, 0, 1]])
    vertices = np.vstack([leaf + np.array([1 + i / 100, 0, 0]) for i in range(count)])
    faces = np.arange(3 * count, dtype=np.int32).reshape(-1, 3)
    green = Material("leaf", density=0.0, sheet_loss=1e-4)
    return Part("leaves", green, vertices, faces)


def test_capacity_for_surfaces_ahead_grows() -> None:
    count = 3 * INITIAL_CAPACITY
    tracer = Tracer([sheets(count)])
    for _ in range(2):  # the second call has the room from the start
        power = tracer.trace(rays([(0, 0, 0)])).power
        assert power == pytest.approx([1 - count * 1e-4])


def test_capacity_for_surfaces_behind_grows() -> None:
    shells = [
        brick(foliage(1e-4), (10, 10, 1 + i / 100), (0, 0, 0)) for i in range(600)
    ]
    power = Tracer(shells).trace(rays([(0, 0, 0)], max_range=2.0)).power[0]
    assert power == pytest.approx(1 - 600 * 2 * 1e-4)


def test_capacity_for_events_grows() -> None:
    events = Tracer([sheets(100)]).explain(rays([(0, 0, 0)] * 20))
    assert [len(found) for found in events] == [101] * 20


def test_explain_returns_events_in_order() -> None:
    parts = [
        brick(foliage(0.1), (2, 2, 2), (0, 0, 0)),
        brick(foliage(0.2), (1, 2, 2), (3, 0, 0)),
        brick(CONCRETE, (1, 2, 2), (6, 0, 0)),
    ]
    start = [(0.0, EventKind.START_INSIDE, 0, 1.0), (1.0, EventKind.LEAVE, 0, 0.9)]
    ahead = [
        (2.5, EventKind.ENTER, 1, 0.9),
        (3.5, EventKind.LEAVE, 1, 0.7),
        (5.5, EventKind.HIT, 2, 0.7),
    ]
    behind = [(80.0, EventKind.OUT_OF_RANGE, -1, 0.9)]
    cast = rays([(0, 0, 0), (0, 0, 0)], np.array([AHEAD, (-1.0, 0, 0)]))
    for events, wanted in zip(
        Tracer(parts).explain(cast), (ahead, behind), strict=True
    ):
        found = [
            (each.t, each.kind, each.part, round(each.power, 9)) for each in events
        ]
        assert found == start + wanted


ENDS = {
    EventKind.HIT: Outcome.HIT,
    EventKind.SPENT: Outcome.SPENT,
    EventKind.OUT_OF_RANGE: Outcome.NOTHING,
}


def forest(rng: np.random.Generator, trees: int) -> list[Part]:
    """Create overlapping balls and bricks in a room that none of them touches."""
    parts = []
    for i in range(trees):
        at = rng.uniform([-40, -40, -3], [40, 40, 3])
        shape = shapes.sphere(rng.uniform(0.5, 3)) if i % 3 else shapes.box(3, 2, 1)
        leaves = foliage(rng.uniform(0.01, 0.1))
        parts.append(Part("tree", leaves, shape[0] + at, shape[1]))
    vertices, faces = shapes.box(100, 100, 20)
    return [*parts, Part("room", CONCRETE, vertices, faces[:, ::-1].copy())]


def scattered(rng: np.random.Generator, parts: list[Part], count: int) -> Rays:
    """Cast rays from anywhere, half of them exactly at a corner of some triangle."""
    origins = rng.uniform([-45, -45, -8], [45, 45, 8], (count, 3))
    corners = np.vstack([part.vertices for part in parts])
    ends = rng.uniform([-45, -45, -8], [45, 45, 8], (count, 3))
    ends[::2] = corners[rng.integers(len(corners), size=len(ends[::2]))]
    return rays(origins, ends - origins, max_range=200.0)


def test_explain_ends_where_trace_ends() -> None:
    rng = np.random.Generator(np.random.PCG64(5))
    parts = forest(rng, 60)
    tracer, cast = Tracer(parts), scattered(rng, parts, 500)
    traces = tracer.trace(cast)
    for i, events in enumerate(tracer.explain(cast)):
        assert [a.t <= b.t for a, b in pairwise(events)] == [True] * (len(events) - 1)
        assert [a.power >= b.power for a, b in pairwise(events)].count(False) == 0
        last = events[-1]
        assert ENDS[last.kind] == traces.outcomes[i]
        end = traces.ranges[i], traces.parts[i], traces.power[i]
        assert (last.t, last.part, last.power) == end


@pytest.mark.parametrize(
    ("trees", "count"),
    [(60, 5_000), pytest.param(400, 1_000_000, marks=pytest.mark.slow)],
)
def test_every_volume_is_entered_as_often_as_left(trees: int, count: int) -> None:
    rng = np.random.Generator(np.random.PCG64(17))
    parts = forest(rng, trees)
    tracer = Tracer(parts)
    for _ in range(max(count // 50_000, 1)):
        n = min(count, 50_000)
        cast = scattered(rng, parts, n)
        cast.power[:] = np.inf
        traces = tracer.trace(cast, events=True)
        events = traces.events
        assert (traces.parts == len(parts) - 1).all(), "every ray ends at the room"
        balance = np.zeros(n * len(parts), np.int64)
        place = events["ray"] * len(parts) + events["part"]
        entered = np.isin(events["kind"], [EventKind.START_INSIDE, EventKind.ENTER])
        np.add.at(balance, place[entered], 1)
        np.add.at(balance, place[events["kind"] == EventKind.LEAVE], -1)
        assert entered.any()
        assert not balance.any()


def test_open_mesh_must_be_opaque_or_a_sheet() -> None:
    vertices, faces = shapes.box(1, 1, 1)
    wall = Part("wall", CONCRETE, vertices + np.array([3, 0, 0]), faces[:-1])
    assert one([wall])[0] == 2.5
    with pytest.raises(EngineError) as caught:
        Tracer([Part("bush", foliage(0.5), vertices, faces[:-1])])
    assert str(caught.value) == (
        "'bush' of 'foliage' has open edges,"
        " expected a closed volume or a material with sheet_loss"
    )


@pytest.mark.parametrize("material", [CONCRETE, foliage(1.0)], ids=["opaque", "volume"])
def test_part_may_have_no_faces(material: Material) -> None:
    nothing = Part("nothing", material, np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    wall = brick(CONCRETE, (1, 1, 1), (3, 0, 0))
    assert one([nothing, wall]) == (2.5, Outcome.HIT, 1, 1.0)


def test_scene_has_one_tracer_which_is_freed_with_it() -> None:
    scene, other = Scene("one", "DM-One"), Scene("one", "DM-One")
    tracer = weakref.ref(tracer_of(scene))
    assert tracer_of(scene) is tracer()
    assert tracer_of(other) is not tracer()
    del scene
    gc.collect()
    assert tracer() is None


@pytest.mark.parametrize(("t", "power"), [(np.inf, 1.0), (3.0, 1.0), (2.9, 0.5)])
def test_unexpected_result_of_the_engine_check_is_rejected(
    t: float, power: float
) -> None:
    end = np.array([t]), np.zeros(1, np.uint8), np.zeros(1, np.int64), np.array([power])
    wrong = Traces(*end, np.zeros(0), np.zeros(0, EVENT))
    with pytest.raises(EngineError) as caught:
        check_known_end(wrong)
    assert str(caught.value) == (
        f"a test ray ends at {t:.6g} m with power {power:.6g}, expected 3 m"
        " and 0.5: the memory layout of this Embree differs from version 4.4"
    )


@pytest.mark.parametrize("spread", [0.02, 1.0, 40.0])
def test_rays_that_start_in_one_of_many_volumes_lose_what_is_above_them(
    spread: float,
) -> None:
    # Blocks of 0.9 m every metre, 2 m high, with the density of their number; rays go
    # up from places that are near the place before, or far from it.
    blocks = [
        brick(foliage(0.001 * (k + 1)), (0.9, 0.9, 2.0), (k + 0.5, 0.0, 1.0))
        for k in range(100)
    ]
    ceiling = brick(CONCRETE, (200.0, 2.0, 0.5), (50.0, 0.0, 5.0))
    rng = np.random.Generator(np.random.PCG64(3))
    x = 50.0 + np.cumsum(rng.uniform(-spread, spread, 2000))
    x = 1.0 + np.abs((x - 1.0) % 196.0 - 98.0)  # there and back
    z = rng.uniform(0.1, 1.9, len(x))
    starts = np.column_stack([x, np.zeros_like(x), z])
    traces = Tracer([*blocks, ceiling]).trace(rays(starts, (0.0, 0.0, 1.0), power=10.0))
    inside = np.abs(x % 1.0 - 0.5) < 0.45
    loss = np.where(inside, 0.001 * (np.floor(x) + 1) * (2.0 - z), 0.0)
    assert inside.any()
    assert not inside.all()
    assert traces.power == pytest.approx(10.0 - loss, abs=1e-9)
