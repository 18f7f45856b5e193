import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from flat_world import rectangle

from radarsim.geometry import Pose2
from radarsim.robots.footprint import Footprint
from radarsim.robots.obstacles import Obstacles, finish
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene

ROBOT = Footprint(0.6, 0.4)
SMALL = Footprint(0.1, 0.1)


@dataclass(frozen=True)
class StandingBody:
    pose: Pose2
    footprint: Footprint = ROBOT


def sheet(low: float, high: float, *, x: float = 1.0, solid: bool = True) -> Part:
    """Return an upright sheet across x, 4 m wide."""
    corners = [[x, -2, low], [x, 2, low], [x, 2, high], [x, -2, high]]
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    return Part("sheet", Material("stuff", solid=solid), np.array(corners), faces)


@pytest.mark.parametrize(
    ("part", "blocks"),
    [
        pytest.param(sheet(0, 3), True, id="wall"),
        pytest.param(sheet(0, 0.07), True, id="as high as the bumpers"),
        pytest.param(sheet(0, 0.04), False, id="kerb"),
        pytest.param(sheet(0.4, 3), True, id="hanging low"),
        pytest.param(sheet(0.5, 3), False, id="hanging high"),
        pytest.param(sheet(0, 3, solid=False), False, id="smoke"),
    ],
)
def test_which_parts_are_obstacles(part: Part, blocks: bool) -> None:
    obstacles = Obstacles.from_scene(Scene("room", "room", (part,)))
    assert obstacles.clear(ROBOT, Pose2(0, 0))
    assert obstacles.clear(ROBOT, Pose2(1, 0)) is not blocks


def test_bumper_heights_count_from_the_floor() -> None:
    scene = Scene("hall", "DM-Hall", parts=(sheet(0, 3), sheet(4.9, 5.2, x=2)))
    upstairs = Obstacles.from_scene(scene, floor=5.0)
    assert upstairs.floor == 5.0
    assert upstairs.clear(ROBOT, Pose2(1, 0))
    assert not upstairs.clear(ROBOT, Pose2(2, 0))


def test_floor_without_solid_parts_is_clear() -> None:
    obstacles = Obstacles.from_scene(Scene("void", "DM-Void"))
    assert obstacles.clear(ROBOT, Pose2(3, 4, 5))
    assert obstacles.segments.shape == (0, 2, 2)


def test_obstacles_are_surfaces_and_bodies_are_filled() -> None:
    room = Obstacles(rectangle(-1, -1, 1, 1))
    assert room.clear(ROBOT, Pose2(0, 0))
    post = Obstacles(rectangle(-0.01, -0.01, 0.01, 0.01))
    assert not post.clear(ROBOT, Pose2(0, 0))


@pytest.mark.parametrize(
    ("other", "free"),
    [
        pytest.param(StandingBody(Pose2(0.61, 0)), True, id="ahead"),
        pytest.param(StandingBody(Pose2(0.59, 0)), False, id="too near ahead"),
        pytest.param(StandingBody(Pose2(0, 0.41)), True, id="at the side"),
        pytest.param(StandingBody(Pose2(0, 0.39)), False, id="too near at the side"),
        pytest.param(StandingBody(Pose2(0.51, 0, math.pi / 2)), True, id="across"),
        pytest.param(StandingBody(Pose2(0.1, 0), SMALL), False, id="under it"),
        pytest.param(
            StandingBody(Pose2(0.1, 0), Footprint(3, 3)), False, id="around it"
        ),
        pytest.param(StandingBody(Pose2(9, 9)), True, id="far away"),
    ],
)
def test_bodies_do_not_overlap(other: Any, free: bool) -> None:
    assert Obstacles().clear(ROBOT, Pose2(0, 0), [other]) is free


def test_nearest_free_pose_keeps_the_yaw() -> None:
    obstacles = Obstacles(np.array([[[0, -50], [0, 50]]], dtype=float))
    pose = finish(obstacles.search_free_pose(ROBOT, Pose2(-0.2, 7, 0)))
    assert pose is not None
    assert pose.yaw == 0
    assert pose.x < -0.3
    assert math.hypot(pose.x + 0.2, pose.y - 7) < 0.1 + 0.06


def test_nearest_free_pose_avoids_other_bodies() -> None:
    obstacles = Obstacles(np.array([[[0, -50], [0, 50]]], dtype=float))
    statue: Any = StandingBody(Pose2(-0.35, 7))
    here, bodies = Pose2(-0.2, 7), [statue]
    pose = finish(obstacles.search_free_pose(ROBOT, here, lambda: bodies))
    assert pose is not None
    assert obstacles.clear(ROBOT, pose, [statue])


def test_no_free_pose_within_the_radius_is_none() -> None:
    grid = [
        rectangle(x, y, x + 0.3, y + 0.3) for x in range(-3, 3) for y in range(-3, 3)
    ]
    shifted = [sides + 0.5 for sides in grid]
    obstacles = Obstacles(np.concatenate(grid + shifted))
    assert finish(obstacles.search_free_pose(Footprint(1, 1), Pose2(0, 0))) is None


@pytest.mark.parametrize(
    ("within", "found"),
    [pytest.param(0.3, False, id="too short"), pytest.param(0.4, True, id="enough")],
)
def test_search_radius_limits_the_search(within: float, found: bool) -> None:
    obstacles = Obstacles(np.array([[[0, -50], [0, 50]]], dtype=float))
    pose = finish(obstacles.search_free_pose(ROBOT, Pose2(0, 0), within=within))
    assert (pose is not None) is found
