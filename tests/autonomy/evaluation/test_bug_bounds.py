import math

import pytest
from bug_bounds import BugBounds, bug_bounds
from parts import slab

from radarsim.geometry import Pose3
from radarsim.scene.scene import Part, Scene, StartPose

GROWN = 1.0  # m, at a safety distance of 0.5 m


def field(*parts: Part, start: Pose3 | None = None) -> Scene:
    starts = (StartPose("RobotStart1", start),) if start else ()
    return Scene("field", "DM-Field", parts, starts)


def close_to(perimeter: float) -> object:
    return pytest.approx(perimeter, rel=1e-3)


def test_obstacle_is_grown_and_crossed_on_both_sides() -> None:
    bounds = bug_bounds(field(slab(0, 0, (3, 2))), (-5, 0), (5, 0), 0.5)
    (ring,) = bounds.boundaries
    assert (bounds.direct, ring.crossings) == (10, 2)
    assert ring.perimeter == close_to(2 * (3 + 2) + 2 * math.pi * GROWN)
    assert bounds.bug1 == pytest.approx(10 + 1.5 * ring.perimeter)
    assert bounds.bug2 == pytest.approx(10 + ring.perimeter)


def test_obstacles_that_touch_when_grown_are_one() -> None:
    scene = field(slab(0, 2, (1, 2)), slab(0, -2, (1, 2)))
    (ring,) = bug_bounds(scene, (-5, 0), (5, 0), 0.6).boundaries
    assert ring.crossings == 2
    assert len(bug_bounds(scene, (-5, 0), (5, 0), 0.4).boundaries) == 2


def test_obstacle_beside_the_line_counts_for_bug1_alone() -> None:
    bounds = bug_bounds(field(slab(3, 3, (1, 1))), (-5, 0), (5, 0), 0.5)
    (ring,) = bounds.boundaries
    assert ring.crossings == 0
    assert bounds.bug1 > bounds.bug2 == bounds.direct


def test_obstacle_farther_from_the_goal_than_the_start_does_not_count() -> None:
    scene = field(slab(-9, 0, (1, 1)), slab(17, 0, (1, 1)))
    assert bug_bounds(scene, (-5, 0), (5, 0), 0.5) == BugBounds(10, ())


@pytest.mark.parametrize(("x", "crossings"), [(-3.0, 0), (-4.3, 1)])
def test_start_in_a_room_counts_the_inside_of_its_walls(
    x: float, crossings: int
) -> None:
    """Also one that is a little too near to a wall."""
    scene = field(slab(0, 0, (10, 8)), start=Pose3(x, 0, 0))
    (ring,) = bug_bounds(scene, (x, 0), (3, 0), 0.5).boundaries
    assert ring.crossings == crossings
    assert ring.perimeter == close_to(2 * (8 + 6))


def test_bug2_circles_an_obstacle_around_the_goal_completely() -> None:
    bounds = bug_bounds(field(slab(0, 0, (3, 2))), (-5, 0), (0, 0), 0.5)
    (ring,) = bounds.boundaries
    assert ring.crossings == 1
    assert bounds.bug2 == pytest.approx(5 + ring.perimeter)


@pytest.mark.parametrize(
    ("start", "size"),
    [
        pytest.param((-1.0, 0.0), (6.0, 1.9), id="narrow room"),
        pytest.param((-2.8, 0.0), (6.0, 6.0), id="at the wall"),
    ],
)
def test_start_within_the_safety_distance_is_an_error(
    start: tuple[float, float], size: tuple[float, float]
) -> None:
    scene = field(slab(0, 0, size), start=Pose3(*start, 0))
    expected = r"start \(-[0-9.]+, 0.0\), expected a place 1 m from everything"
    with pytest.raises(ValueError, match=expected):
        bug_bounds(scene, start, (1, 0), 0.5)
