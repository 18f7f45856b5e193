import math

import numpy as np
import pytest
import shapely
from parts import STONE, slab
from shapely import Point

from radarsim.geometry import Pose3
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene, StartPose, Trial
from radarsim.scene.shapes import box, cylinder, sphere
from radarsim.simulation.map_warnings import (
    component_around,
    free_space,
    is_connected,
    plan_height,
)

LEAF = Material("leaf", 0.7)
SMOKE = Material("smoke", 0.0, 0.5, solid=False)


def hall(*parts: Part, start: Pose3 | None = None) -> Scene:
    starts = (StartPose("RobotStart1", start),) if start else ()
    return Scene("hall", "DM-Hall", parts, starts)


def is_free(scene: Scene, x: float, y: float, distance: float = 0.1) -> bool:
    return bool(free_space(scene, distance).intersects(Point(x, y)))


def test_box_occupies_its_area_grown_by_the_distance() -> None:
    free = free_space(hall(slab(1, 2, (4, 3))), 0.5)
    (hole,) = free.geoms[0].interiors
    grown = 4 * 3 + 2 * (4 + 3) * 0.5 + math.pi * 0.5**2
    assert shapely.Polygon(hole).area == pytest.approx(grown, rel=1e-4)
    assert hole.centroid.coords[0] == pytest.approx((1, 2))


@pytest.mark.parametrize(
    "part",
    [
        pytest.param(slab(0, 0, (6, 6)), id="box"),
        pytest.param(Part("bush", LEAF, *sphere(2.0)), id="bush"),
        pytest.param(Part("trunk", STONE, *cylinder(2.0, 2.0)), id="trunk"),
    ],
)
def test_closed_objects_are_solid_inside(part: Part) -> None:
    assert not is_free(hall(part), 0, 0)


def test_object_around_a_start_is_a_room() -> None:
    scene = hall(slab(0, 0, (6, 4)), start=Pose3(1, 1, 0))
    room = component_around(free_space(scene, 0.5), (1, 1))
    assert room is not None
    assert room.area == pytest.approx(5 * 3)
    assert not is_connected(scene, (1, 1), (8, 0), 0.1)


def test_walls_of_a_house_are_solid_and_its_room_is_free() -> None:
    outer, faces = box(8, 6, 2)
    inner, _ = box(6, 4, 2)
    vertices = np.concatenate([outer, inner])
    house = Part("house", STONE, vertices, np.concatenate([faces, faces[:, ::-1] + 8]))
    scene = hall(house, start=Pose3(1, 1, 0))
    assert is_free(scene, -2, 0)
    assert not is_free(scene, 3.5, 0)
    assert is_free(scene, 5, 0)


def test_four_walls_enclose_unreachable_floor() -> None:
    walls = [slab(x, 0, (0.1, 4.1)) for x in (-2, 2)]
    walls += [slab(0, y, (4.1, 0.1)) for y in (-2, 2)]
    scene = hall(*walls)
    assert is_free(scene, 0, 0)
    assert is_connected(scene, (-1, -1), (1, 1), 0.5)
    assert not is_connected(scene, (0, 0), (5, 0), 0.01)


def test_gap_is_passable_up_to_half_its_width() -> None:
    room = [slab(x, 0, (0.1, 10)) for x in (-5, 5)]
    room += [slab(0, y, (10, 0.1)) for y in (-5, 5)]
    scene = hall(*room, slab(0, 3, (1, 5)), slab(0, -3, (1, 5)))
    assert is_connected(scene, (-3, 0), (3, 0), 0.49)
    assert not is_connected(scene, (-3, 0), (3, 0), 0.51)


@pytest.mark.parametrize(
    ("part", "free"),
    [
        pytest.param(slab(0, 0, (2, 2), z=-0.1, high=0.2), True, id="floor"),
        pytest.param(slab(0, 0, (2, 2), z=2.0), True, id="bridge"),
        pytest.param(slab(0, 0, (2, 2), z=0.9), False, id="hanging low"),
        pytest.param(Part("cloud", SMOKE, *box(2, 2, 2)), True, id="smoke"),
    ],
)
def test_only_objects_at_bumper_height_are_obstacles(part: Part, free: bool) -> None:
    assert is_free(hall(part), 0, 0) is free


def test_heights_count_from_the_floor_of_the_start() -> None:
    scene = hall(slab(0, 0, (2, 2)), start=Pose3(5, 0, 3))
    assert is_free(scene, 0, 0)


def test_open_surface_is_an_obstacle_on_both_sides() -> None:
    corners = np.array([[0.0, -2, 0], [0, 2, 0], [0, 2, 2], [0, -2, 2]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    scene = hall(Part("sheet", STONE, corners, faces))
    (hole,) = free_space(scene, 0.5).geoms[0].interiors
    area = 4 * 2 * 0.5 + math.pi * 0.5**2
    assert shapely.Polygon(hole).area == pytest.approx(area, rel=2e-3)


def test_floor_includes_all_given_positions() -> None:
    trial = Trial("RobotStart1", (40.0, 0.0), 0.5)
    starts = (StartPose("RobotStart1", Pose3(0, 30, 0)),)
    scene = Scene("field", "DM-Field", (), starts, trial=trial)
    assert free_space(scene, 1.0).bounds == (-11, -11, 51, 41)
    assert is_connected(scene, (-900, 0), (900, 0), 1.0)
    assert free_space(hall(), 1.0, places=[(5, -7)]).bounds == (-11, -18, 16, 11)


def test_positions_too_near_to_an_obstacle_are_not_connected() -> None:
    scene = hall(slab(0, 0, (2, 2)))
    assert is_connected(scene, (-3, 0), (3, 0), 1.9)
    assert not is_connected(scene, (-3, 0), (3, 0), 2.1)
    assert not is_connected(scene, (-9, 0), (3, 0), 2.1)


def test_plans_are_drawn_above_the_floor_of_the_start() -> None:
    assert plan_height(hall()) == 0.35
    assert plan_height(hall(start=Pose3(9, 9, 0.3))) == pytest.approx(0.65)
