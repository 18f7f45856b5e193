import math

import numpy as np
import pytest
from bug_bounds import Boundary, BugBounds, bug_bounds

from radarsim.geometry import Pose3
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene, StartPose
from radarsim.scene.shapes import box, cylinder

STONE = Material("stone")
GROWN = 1.0  # m, at a safety distance of 0.5 m


def block(x: float, y: float, size: tuple[float, float]) -> Part:
    vertices, faces = box(*size, 2.0)
    return Part("block", STONE, vertices + np.array([x, y, 0.0]), faces)


def field(*parts: Part, start: Pose3 | None = None) -> Scene:
    starts = (StartPose("RobotStart1", start),) if start else ()
    return Scene("field", "DM-Field", parts, starts)


def close_to(perimeter: float) -> object:
    return pytest.approx(perimeter, rel=1e-3)


def test_obstacle_is_grown_and_crossed_on_both_sides() -> None:
    bounds = bug_bounds(field(block(0, 0, (3, 2))), (-5, 0), (5, 0), 0.5)
    (ring,) = bounds.boundaries
    assert (bounds.direct, ring.crossings) == (10, 2)
    assert ring.perimeter == close_to(2 * (3 + 2) + 2 * math.pi * GROWN)
    assert bounds.bug1 == pytest.approx(10 + 1.5 * ring.perimeter)
    assert bounds.bug2 == pytest.approx(10 + ring.perimeter)


def test_perimeter_of_a_disc_is_that_of_the_grown_disc() -> None:
    scene = field(Part("silo", STONE, *cylinder(1.5, 2.0)))
    (ring,) = bug_bounds(scene, (-5, 0), (5, 0), 0.5).boundaries
    assert ring.perimeter == close_to(2 * math.pi * (1.5 + GROWN))


def test_obstacles_that_touch_when_grown_are_one() -> None:
    scene = field(block(0, 2, (1, 2)), block(0, -2, (1, 2)))
    (ring,) = bug_bounds(scene, (-5, 0), (5, 0), 0.6).boundaries
    assert ring.crossings == 2
    assert len(bug_bounds(scene, (-5, 0), (5, 0), 0.4).boundaries) == 2


def test_obstacle_beside_the_line_counts_for_bug1_alone() -> None:
    bounds = bug_bounds(field(block(3, 3, (1, 1))), (-5, 0), (5, 0), 0.5)
    (ring,) = bounds.boundaries
    assert ring.crossings == 0
    assert bounds.bug1 > bounds.bug2 == bounds.direct


def test_obstacle_farther_from_the_goal_than_the_start_does_not_count() -> None:
    scene = field(block(-9, 0, (1, 1)), block(17, 0, (1, 1)))
    assert bug_bounds(scene, (-5, 0), (5, 0), 0.5) == BugBounds(10, ())


def test_edge_of_the_floor_is_no_obstacle() -> None:
    assert bug_bounds(field(), (-500, 0), (500, 0), 0.5).boundaries == ()


def test_start_in_a_room_counts_the_inside_of_its_walls() -> None:
    scene = field(block(0, 0, (10, 8)), start=Pose3(-3, 0, 0))
    (ring,) = bug_bounds(scene, (-3, 0), (3, 0), 0.5).boundaries
    assert ring.crossings == 0
    assert ring.perimeter == close_to(2 * (8 + 6))


def test_bug2_circles_an_obstacle_around_the_goal_completely() -> None:
    bounds = bug_bounds(field(block(0, 0, (3, 2))), (-5, 0), (0, 0), 0.5)
    (ring,) = bounds.boundaries
    assert ring.crossings == 1
    assert bounds.bug2 == pytest.approx(5 + ring.perimeter)


def test_each_pair_of_crossings_counts_one_perimeter() -> None:
    bounds = BugBounds(7.0, (Boundary(20.0, 4), Boundary(10.0, 3), Boundary(5.0, 0)))
    assert bounds.bug1 == 7 + 1.5 * 35
    assert bounds.bug2 == 7 + 2 * 20 + 2 * 10


def test_start_too_near_to_an_obstacle_belongs_to_the_nearest_component() -> None:
    scene = field(block(0, 0, (10, 8)), start=Pose3(-4.3, 0, 0))
    (ring,) = bug_bounds(scene, (-4.3, 0), (3, 0), 0.5).boundaries
    assert ring.crossings == 1
    assert ring.perimeter == close_to(2 * (8 + 6))


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
    scene = field(block(0, 0, size), start=Pose3(*start, 0))
    expected = r"start \(-[0-9.]+, 0.0\), expected a place 1 m from everything"
    with pytest.raises(ValueError, match=expected):
        bug_bounds(scene, start, (1, 0), 0.5)
