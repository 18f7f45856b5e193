"""What robots that fly can run into, and what it takes to find that out."""

import gc
import math
import tracemalloc
import weakref

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarsim.geometry import Floats, Pose2
from radarsim.presets.robots import load_robot
from radarsim.raycast.tracer import tracer_of
from radarsim.robots.obstacles import slice_mesh
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.simulation.flight import BAND, TILE, Airspace, Area, SolidMesh
from radarsim.simulation.simulation import SLICING_WORK, Simulation
from radarsim.simulation.vehicle import Vehicle

AIR_ROBOT = load_robot("AirRobot")
REACH = 1.5


@pytest.fixture
def areas(monkeypatch: pytest.MonkeyPatch) -> list[Area]:
    """Areas of all slices that are made."""
    made: list[Area] = []
    original = SolidMesh.near

    def counted(self: SolidMesh, area: Area, *heights: float) -> object:
        made.extend([area] * len(heights))
        return original(self, area, *heights)

    monkeypatch.setattr(SolidMesh, "near", counted)
    return made


def drone(simulation: Simulation, x: float, y: float, z: float) -> Vehicle:
    vehicle = simulation.spawn("D", AIR_ROBOT, Pose2(x, y), z)
    assert vehicle is not None
    return vehicle


def step(simulation: Simulation, ticks: int) -> None:
    for _ in range(ticks):
        simulation.step()


def slices(scene: Scene, height: float) -> Floats:
    """Return the slices of all solid parts at a height, (S, 2, 2) m."""
    solid = [part for part in scene.parts if part.material.solid]
    return np.concatenate([slice_mesh(p.vertices, p.faces, height) for p in solid])


@settings(max_examples=20)
@given(x=st.floats(-9, 9), y=st.floats(-9, 9), z=st.floats(0.2, 5))
def test_all_walls_that_a_robot_can_reach_are_around_it(
    foliage_room: Scene, x: float, y: float, z: float
) -> None:
    airspace = Airspace(foliage_room, tracer_of(foliage_room))
    around = airspace.surroundings(AIR_ROBOT, (x, y, z), REACH)
    bottom = z - AIR_ROBOT.origin_height
    first = math.floor(bottom / BAND + 1e-9)
    last = first + math.ceil(AIR_ROBOT.height / BAND)
    heights = [(number + 0.5) * BAND for number in range(first, last + 1)]
    whole = np.concatenate([slices(foliage_room, height) for height in heights])
    rows = {wall.tobytes(): row for row, wall in enumerate(whole)}
    found = [rows[wall.tobytes()] for wall in around.obstacles.segments]
    assert found == sorted(found)  # the order decides which of two walls counts
    reached = np.abs(whole - [x, y]).max(axis=2).min(axis=1) <= REACH
    lengths = np.hypot(*(whole[:, 1] - whole[:, 0]).T)
    assert set(np.flatnonzero(reached & (lengths > 1e-9))) <= set(found)


def test_a_robot_that_comes_cuts_each_height_around_it_once(
    foliage_room: Scene, areas: list[Area]
) -> None:
    drone(Simulation(foliage_room), -8.0, 0.0, 0.5)
    assert len(areas) == math.ceil(AIR_ROBOT.height / BAND) + 1


def test_a_search_for_a_place_in_the_air_counts_what_is_cut_for_it(
    foliage_room: Scene,
) -> None:
    """So that no tick cuts twice, or cuts and does all of a search as well."""
    simulation = Simulation(foliage_room)
    in_bush = Pose2(-0.2, -2.75)
    steps = list(simulation.spawn_stepwise("D", AIR_ROBOT, in_bush, 0.5))
    assert simulation.vehicles
    assert steps[0] > SLICING_WORK
    assert steps[-1] > SLICING_WORK


def test_a_robot_that_rises_cuts_each_height_around_it_once(
    foliage_room: Scene, areas: list[Area]
) -> None:
    simulation = Simulation(foliage_room)
    vehicle = drone(simulation, -8.0, 0.0, 0.5)
    areas.clear()
    vehicle.robot.fly(up=1.0)
    step(simulation, 100)
    assert vehicle.robot.body.z == pytest.approx(1.5)
    assert len(areas) <= 1.0 / BAND + 2
    assert max(right - left for left, right, *_ in areas) < TILE + 4.0


def test_a_robot_that_is_held_down_cuts_nothing_again(areas: list[Area]) -> None:
    """No ray of its hull meets the pole above it, only a slice does."""
    corners = np.array([[0.2, -0.1, 1], [0.2, 0.1, 1], [0.2, 0, 9]])
    pole = Part("pole", Material("m"), corners, np.array([[0, 1, 2]], np.int32))
    simulation = Simulation(Scene("s", "DM-S", parts=(pole,)))
    under = drone(simulation, 0.0, 0.0, 0.5)
    under.robot.fly(up=1.0)
    step(simulation, 100)
    assert 0.7 < under.robot.body.z < 1.0
    areas.clear()
    step(simulation, 100)
    assert areas == []


def test_robots_that_rise_together_do_not_all_cut_in_the_same_tick(
    foliage_room: Scene, areas: list[Area]
) -> None:
    simulation = Simulation(foliage_room)
    vehicles = [drone(simulation, -8, y, 0.5) for y in (-4, -2, 0, 2)]
    for vehicle in vehicles:
        vehicle.robot.fly(up=1.0)
    step(simulation, 10)
    counts = []
    for _ in range(50):
        areas.clear()
        simulation.step()
        counts.append(len(areas))
    assert sum(counts) >= 4 * 4
    assert max(counts) == 1


def test_robots_that_fly_away_leave_nothing_behind(foliage_room: Scene) -> None:
    simulation, robots = Simulation(foliage_room), []
    for _ in range(8):
        vehicle = drone(simulation, -8.0, 0.0, 0.5)
        vehicle.robot.fly(ahead=2.0, up=2.0)
        step(simulation, 100)
        assert len(vehicle.robot.fleet._floors) < 600
        simulation.remove(vehicle)
        robots.append(weakref.ref(vehicle.robot))
        del vehicle
    gc.collect()
    assert not any(robot() for robot in robots)


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
    expected = reaching_into(slices(foliage_room, height), area)
    mesh = SolidMesh(foliage_room.parts)
    found = slice_mesh(mesh.vertices, mesh.near(area, height), height)
    np.testing.assert_array_equal(reaching_into(found, area), expected)


@pytest.mark.parametrize("solid", [True, False])
def test_parts_that_are_not_solid_are_left_out(solid: bool) -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 1]])
    faces = np.array([[0, 1, 2]], np.int32)
    part = Part("p", Material("m", 1.0, 1.0, solid=solid), corners, faces)
    assert len(SolidMesh([part]).near((-1, 2, -1, 2), 0.5)) == int(solid)


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
