import heapq
import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from parts import STONE, slab

from radarsim.autonomy.evaluation.shortest_path import shortest_path
from radarsim.geometry import Pose3
from radarsim.scene.scene import Part, Scene, StartPose
from radarsim.scene.shapes import cylinder
from radarsim.simulation.map_warnings import Position, free_space


def field(*parts: Part) -> Scene:
    return Scene("field", "DM-Field", parts)


def length(scene: Scene, start: Position, goal: Position, clearance: float) -> float:
    found = shortest_path(scene, start, goal, clearance)
    assert found is not None
    steps = np.diff(found[1], axis=0)
    assert found[0] == pytest.approx(np.hypot(*steps.T).sum())
    assert tuple(found[1][0]) == start
    assert tuple(found[1][-1]) == goal
    return found[0]


def test_path_without_obstacles_is_straight() -> None:
    scene = field(slab(0, 3, (2, 2)))
    assert length(scene, (-3, 1.4), (4, 1.4), 0.5) == pytest.approx(7)
    assert length(scene, (-3, 0), (-3, 0), 0.5) == 0


def test_path_bends_around_the_corners_of_a_box() -> None:
    r, d = 0.37, math.sqrt(5)
    turn = math.atan2(1, 2) + math.asin(r / d)
    expected = 2 * (math.sqrt(d**2 - r**2) + r * turn) + 2
    found = length(field(slab(0, 0, (2, 2))), (-3, 0), (3, 0), r)
    assert found == pytest.approx(expected, rel=1e-3)
    assert found < expected


def test_path_follows_the_arc_of_a_disc() -> None:
    reach, d = 1.5 + 0.4, 4.0
    arc = math.pi - 2 * math.acos(reach / d)
    expected = 2 * math.sqrt(d**2 - reach**2) + reach * arc
    scene = field(Part("silo", STONE, *cylinder(1.5, 2.0)))
    assert length(scene, (-4, 0), (4, 0), 0.4) == pytest.approx(expected, rel=1e-3)


def test_path_in_a_room_goes_around_the_end_of_a_wall() -> None:
    walls = [slab(x, 0, (0.2, 10)) for x in (-5, 5)]
    walls += [slab(0, y, (10, 0.2)) for y in (-5, 5)]
    scene = field(*walls, slab(0, 1.9, (0.2, 6)))
    r, d = 0.5, math.hypot(0.9, 5.1)
    turn = math.pi / 2 - math.atan2(0.9, 5.1) + math.asin(r / d)
    expected = 2 * (math.sqrt(d**2 - r**2) + r * turn) + 0.2
    assert length(scene, (-1, 4), (1, 4), r) == pytest.approx(expected, rel=1e-3)
    assert shortest_path(scene, (-1, 4), (9, 4), r) is None


def test_path_avoids_a_gap_that_is_too_narrow() -> None:
    scene = field(slab(0, 3, (1, 5)), slab(0, -3, (1, 5)))
    assert length(scene, (-3, 0), (3, 0), 0.49) == pytest.approx(6)
    assert length(scene, (-3, 0), (3, 0), 0.51) > 12


@pytest.mark.parametrize(
    ("start", "goal"),
    [
        pytest.param((-1.4, 0.0), (5.0, 0.0), id="start too near"),
        pytest.param((-5.0, 0.0), (0.0, 1.4), id="goal too near"),
        pytest.param((-5.0, 0.0), (0.0, 0.0), id="goal in a block"),
    ],
)
def test_no_path_from_or_to_blocked_positions(start: Position, goal: Position) -> None:
    assert shortest_path(field(slab(0, 0, (2, 2))), start, goal, 0.5) is None


def test_no_path_out_of_a_closed_box() -> None:
    starts = (StartPose("RobotStart1", Pose3(0, 0, 0)),)
    scene = Scene("house", "DM-House", (slab(0, 0, (6, 6)),), starts)
    assert length(scene, (0, 0), (2, 2), 0.5) == pytest.approx(math.sqrt(8))
    assert shortest_path(scene, (0, 0), (5, 5), 0.5) is None


def exhaustive(
    scene: Scene, start: Position, goal: Position, clearance: float
) -> float:
    """Find the length of the shortest path from all corners to all others."""
    free = free_space(scene, clearance)
    corners = np.array([start, goal, *shapely.get_coordinates(free).tolist()])
    wide = free.buffer(1e-6, join_style="mitre")
    shapely.prepare(wide)
    best = np.full(len(corners), math.inf)
    queue = [(0.0, 0)]
    while queue:
        far, here = heapq.heappop(queue)
        if here == 1:
            return far
        if far >= best[here]:
            continue
        best[here] = far
        ends = np.stack([np.broadcast_to(corners[here], corners.shape), corners], 1)
        seen = shapely.covers(wide, shapely.linestrings(ends))
        steps = np.hypot(*(corners - corners[here]).T)
        for there in np.nonzero(seen & (far + steps < best))[0].tolist():
            heapq.heappush(queue, (far + float(steps[there]), there))
    return math.inf


places = st.tuples(*2 * [st.floats(-4, 4)])
sizes = st.tuples(*2 * [st.floats(0.1, 4)])


@settings(max_examples=15)
@given(
    st.lists(st.tuples(places, sizes), min_size=1, max_size=3),
    st.floats(0.1, 0.8),
)
def test_shortest_path_matches_an_exhaustive_search(
    blocks: list[tuple[Position, tuple[float, float]]], clearance: float
) -> None:
    scene = field(*(slab(x, y, size) for (x, y), size in blocks))
    start, goal = (-8.0, 0.0), (8.0, 0.5)
    assume(all(abs(x) + size[0] / 2 < 7 for (x, _), size in blocks))
    found = length(scene, start, goal, clearance)
    assert found == pytest.approx(exhaustive(scene, start, goal, clearance), abs=1e-4)
    assert found == pytest.approx(length(scene, goal, start, clearance), abs=1e-4)
