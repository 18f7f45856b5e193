"""Ranges of sonars against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mountings import mounting, robot_at

from radarsim.geometry import Floats, Pose3
from radarsim.presets.robots import Item
from radarsim.presets.sensors import item_settings
from radarsim.raycast.rays import Boxes
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import box, cylinder, sphere
from radarsim.sensors.sonar import Sonars, SonarSettings

HALF_ANGLE = math.radians(10)
STEP = math.radians(1)  # between two level rays
AHEAD = Pose3(0, 0, 0)
WALL = Material("wall")


def part(
    shape: tuple[Floats, np.ndarray], pose: Pose3, material: Material = WALL
) -> Part:
    vertices, faces = shape
    placed = pose.position() + vertices @ pose.rotation().T
    return Part(material.name, material, placed, faces)


def wall(distance: float, angle: float = 0.0, material: Material = WALL) -> Part:
    """Return a high wall whose near face is at a distance in some direction."""
    middle = Pose3(0, 0, 0, yaw=angle).compose(Pose3(distance + 0.05, 0, 0))
    return part(box(0.1, 40, 40), middle, material)


def ranges(
    parts: list[Part],
    mounts: tuple[Pose3, ...] = (AHEAD,),
    *,
    body: Pose3 = AHEAD,
    boxes: Boxes | None = None,
    **settings: float,
) -> list[float]:
    each, robot = item_settings("Sonar", SonarSettings, **settings), robot_at(body)
    items = [
        Item(
            type="Sonar",
            name="F1",
            position=(pose.x, pose.y, pose.z),
            rotation_deg=(0, 0, math.degrees(pose.yaw)),
        )
        for pose in mounts
    ]
    sonars = Sonars(*(mounting(item, each, robot=robot) for item in items))
    traces = Tracer(parts).trace(sonars.rays(), boxes, incidence=True)
    (report,) = sonars.read(0.0, traces)
    return [measured for _, measured in report.ranges]


@given(distance=st.floats(0.2, 4.9), angle=st.floats(-0.6, 0.6))
def test_wall_is_as_far_as_its_nearest_point_in_the_cone(
    distance: float, angle: float
) -> None:
    aside = max(abs(angle) - HALF_ANGLE, 0)  # from the normal to the nearest ray
    nearest = min(distance / math.cos(aside), 5)
    (measured,) = ranges([wall(distance, angle)])
    farthest = distance / math.cos(aside + (STEP / 2 if aside == 0 else 0))
    assert nearest - 1e-6 <= measured <= min(farthest, 5) + 1e-6


@given(
    distance=st.floats(0.5, 4.8),
    radius=st.floats(0.045, 0.4),
    angle=st.floats(-HALF_ANGLE, HALF_ANGLE),
)
def test_pole_in_the_cone_is_found_wherever_it_stands(
    distance: float, radius: float, angle: float
) -> None:
    place = Pose3(distance * math.cos(angle), distance * math.sin(angle), 0)
    (measured,) = ranges([part(cylinder(radius, 3), place)])
    nearest = max(distance - radius, 0.1)
    if distance > 2 * radius:
        assert nearest - 2e-3 * radius <= measured < distance


def test_pole_on_the_axis_is_as_far_as_its_surface() -> None:
    (measured,) = ranges([part(cylinder(0.1, 3), Pose3(2, 0, 0))])
    assert measured == pytest.approx(1.9, abs=1e-3)


def test_pole_beside_the_cone_is_not_found() -> None:
    aside = Pose3(2 * math.cos(0.25), 2 * math.sin(0.25), 0)
    assert ranges([part(cylinder(0.1, 3), aside)]) == [5]


def test_what_is_only_above_or_below_the_sonar_is_found() -> None:
    for height in (0.35, -0.35):
        ball = part(sphere(0.1), Pose3(2, 0, height))
        (measured,) = ranges([ball])
        assert 1.9 <= measured < 2.1


@pytest.mark.parametrize("height", [0.05, 0.12, 0.15, 0.5])
def test_floor_below_a_level_cone_sends_nothing_back(height: float) -> None:
    floor = part(box(40, 40, 0.1), Pose3(0, 0, -height - 0.05))
    assert ranges([floor]) == [5]
    assert ranges([floor, wall(2)]) == pytest.approx([2], abs=1e-6)


def test_surface_on_the_axis_counts_however_oblique_it_is() -> None:
    angle = math.radians(85)
    (measured,) = ranges([wall(0.3, angle)], max_incidence_deg=10)
    assert measured == pytest.approx(0.3 / math.cos(angle), abs=1e-6)


def test_nothing_in_the_cone_reads_the_maximum_range() -> None:
    assert ranges([wall(5.5)]) == [5]
    assert ranges([]) == [5]
    assert ranges([wall(5.5)], max_range=6) == pytest.approx([5.5], abs=1e-6)


def test_too_near_reads_the_minimum_range() -> None:
    assert ranges([wall(0.04)]) == [0.1]
    assert ranges([wall(0.04)], min_range=0) == pytest.approx([0.04], abs=1e-6)


def test_each_sonar_looks_in_its_own_direction_from_its_own_place() -> None:
    room = part(box(8, 6, 4), Pose3(0, 0, 0))
    mounts = tuple(
        Pose3(0.2 * math.cos(yaw), 0.2 * math.sin(yaw), 0, yaw=yaw)
        for yaw in np.radians([0, 90, 180, -90]).tolist()
    )
    body = Pose3(1, 0.5, 0, yaw=math.pi / 2)  # ahead is y
    measured = ranges([room], mounts, body=body)
    assert measured == pytest.approx([2.3, 4.8, 3.3, 2.8], abs=1e-6)


@pytest.mark.parametrize(
    ("material", "is_seen"),
    [
        pytest.param(Material("concrete"), True, id="concrete"),
        pytest.param(Material("foliage", density=0.7), True, id="foliage"),
        pytest.param(Material("leaves", sheet_loss=0.1), True, id="leaves"),
        pytest.param(
            Material("glass", laser_density=0.0, radar_mirror=True), True, id="glass"
        ),
        pytest.param(
            Material("metal", radar_mirror=True, laser_mirror=True), True, id="metal"
        ),
        pytest.param(Material("black", laser_absorption_db=math.inf), True, id="black"),
        pytest.param(
            Material("grass", density=0.1, solid=False), True, id="tall grass"
        ),
        pytest.param(
            Material("smoke", density=0.0, laser_density=0.5, solid=False),
            False,
            id="smoke",
        ),
    ],
)
def test_what_stops_robots_or_light_is_seen(material: Material, is_seen: bool) -> None:
    near = part(box(1, 4, 4), Pose3(2, 0, 0), material)
    expected = 1.5 if is_seen else 4.0
    assert ranges([near, wall(4)]) == pytest.approx([expected], abs=1e-6)


def test_sonar_in_smoke_reads_what_is_behind_it() -> None:
    smoke = Material("smoke", density=0.0, laser_density=0.5, solid=False)
    cloud = part(sphere(3), Pose3(0, 0, 0), smoke)
    assert ranges([cloud, wall(4)]) == pytest.approx([4], abs=1e-6)


def test_other_robots_are_seen_and_the_own_is_not() -> None:
    own = [0, 0, 0, -0.1, 0.3, 0.25, 0.25, 1]
    other = [2, 0, 0, -0.1, 0.3, 0.25, 0.25, 2]
    boxes = Boxes(np.array([own, other], np.float64))
    assert ranges([], boxes=boxes) == pytest.approx([1.75])
