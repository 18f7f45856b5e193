"""Sonars, GPS and encoders of the older robots, in a scene."""

import math
from dataclasses import replace

import numpy as np
import pytest
from tick_readings import read, spawn

from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.reports import Encoder, Gps, Sonar
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.vehicle import Vehicle

NAMES = [f"{side}{i}" for side in "FR" for i in range(1, 9)]
HALF_ANGLE = math.radians(10)


def distance_to_walls(vehicle: Vehicle, name: str) -> float:
    """Return the closed form in a room of 20.8 m by 12.8 m with four walls."""
    (item,) = (item for item in vehicle.model.items if item.name == name)
    pose = vehicle.sensor_pose(item)
    distances = []
    for normal, wall in ((0, 10.4), (90, 6.4), (180, 10.4), (-90, 6.4)):
        turn = math.radians(normal)
        gap = wall - pose.x * math.cos(turn) - pose.y * math.sin(turn)
        off = abs(math.remainder(pose.yaw - turn, 2 * math.pi))
        aside = max(off - HALF_ANGLE, 0)
        incidence = abs(aside)
        if incidence < math.radians(75):
            distances.append(gap / math.cos(aside))
    return min(5, *distances)


@pytest.mark.parametrize("class_name", ["P2AT", "P2DX"])
@pytest.mark.parametrize(
    "pose",
    [
        pytest.param(Pose2(-8, 0), id="far from three walls"),
        pytest.param(Pose2(-9, 5, 0.7), id="in a corner"),
        pytest.param(Pose2(-9, -5, 2.5), id="in another corner"),
    ],
)
def test_sonars_read_the_distance_to_the_walls(
    empty_room: Scene, class_name: str, pose: Pose2
) -> None:
    simulation, vehicle = spawn(empty_room, pose, class_name)
    (sonar,) = (r for r in read(simulation, vehicle, 20) if isinstance(r, Sonar))
    names = NAMES if class_name == "P2AT" else NAMES[:8]
    assert [name for name, _ in sonar.ranges] == names
    for name, measured in sonar.ranges:
        assert measured == pytest.approx(distance_to_walls(vehicle, name), abs=2e-3)


@pytest.mark.parametrize(
    ("dialect", "reports", "sonars"),
    [pytest.param(COMPAT, 5, 16, id="compat"), pytest.param(UDK, 80, 1, id="udk")],
)
def test_sonars_read_five_times_a_second(
    empty_room: Scene, dialect: Dialect, reports: int, sonars: int
) -> None:
    config = SimulationConfig(dialect)
    simulation, vehicle = spawn(empty_room, Pose2(-8, 0), "P2AT", config)
    seen = [r for r in read(simulation, vehicle, 100) if isinstance(r, Sonar)]
    assert len(seen) == reports
    assert {len(r.ranges) for r in seen} == {sonars}
    assert sorted({r.time for r in seen}) == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0])
    assert [r.ranges[0][0] for r in seen[:16]] == (NAMES if sonars == 1 else ["F1"] * 5)


def test_sonars_see_another_robot_where_it_is_now(empty_room: Scene) -> None:
    simulation, vehicle = spawn(empty_room, Pose2(-8, 0), "P2AT")
    other = simulation.spawn("other", load_robot("P2AT"), Pose2(-6, 0))
    assert other is not None
    other.robot.drive(2.0, 2.0)
    seen = [r for r in read(simulation, vehicle, 100) if isinstance(r, Sonar)]
    ahead = [dict(r.ranges)["F4"] for r in seen]
    back_of_other = 2 - 0.25 - 0.24
    expected = [back_of_other + 2.0 * 0.11 * r.time for r in seen]
    assert ahead == pytest.approx(expected, abs=5e-3)


def test_settings_of_one_sonar_change_that_one_alone(empty_room: Scene) -> None:
    config = SimulationConfig(item_settings={"f1": {"max_range": 2}})
    simulation, vehicle = spawn(empty_room, Pose2(0, 0), "P2AT", config)
    (sonar,) = (r for r in read(simulation, vehicle, 20) if isinstance(r, Sonar))
    assert dict(sonar.ranges)["F1"] == 2
    assert {r for name, r in sonar.ranges if name != "F1"} == {5}


def test_gps_follows_the_robot_and_the_origin_of_the_map() -> None:
    exact = {"GPS": {"max_noise": 0, "min_noise": 0}}
    scene = load_map("empty_room")
    simulation, vehicle = spawn(
        scene, Pose2(-8, 3), "P2AT", SimulationConfig(item_settings=exact)
    )
    (gps,) = (r for r in read(simulation, vehicle, 20) if isinstance(r, Gps))
    assert gps.satellites == 11
    assert gps.position is not None
    north, east = np.subtract(gps.position, scene.gps_origin) * [111_200, 71_670]
    assert (north, east) == pytest.approx((-8.1, -3.0), abs=1e-5)


def test_same_seed_gives_the_same_gps_and_another_robot_changes_nothing(
    empty_room: Scene,
) -> None:
    alone, vehicle = spawn(empty_room, Pose2(-8, 3), "P2AT")
    first = [r for r in read(alone, vehicle, 60) if isinstance(r, Gps)]
    aside, same = spawn(empty_room, Pose2(-8, 3), "P2AT")
    aside.spawn("other", load_robot("P2DX"), Pose2(-4, 3))
    assert first == [r for r in read(aside, same, 60) if isinstance(r, Gps)]


@pytest.mark.parametrize("class_name", ["P2AT", "P2DX"])
def test_encoders_of_the_older_robots_count_backward_when_driving_forward(
    empty_room: Scene, class_name: str
) -> None:
    simulation, vehicle = spawn(empty_room, Pose2(-8, 0), class_name)
    vehicle.robot.drive(1.0, 0.5)
    seen = [r for r in read(simulation, vehicle, 100) if isinstance(r, Encoder)]
    assert len(seen) == (10 if class_name == "P2AT" else 5)
    ticks = dict(seen[-1].ticks)
    assert list(ticks) == ["ECLeft", "ECRight"]
    assert ticks["ECLeft"] == pytest.approx(-57, abs=1)
    assert ticks["ECRight"] == pytest.approx(-28, abs=1)
    line = seen[-1].encode(vehicle.dialect)
    assert line.startswith("SEN {Type Encoder} {Name ECLeft Tick -5")


def test_robots_of_the_original_have_neither_sonars_nor_gps(empty_room: Scene) -> None:
    simulation, vehicle = spawn(empty_room, Pose2(-8, 0), "P3AT")
    assert not any(isinstance(r, Sonar | Gps) for r in read(simulation, vehicle, 40))


def test_empty_battery_silences_sonars_and_gps(empty_room: Scene) -> None:
    config = SimulationConfig(replace(UDK, battery_start=0.0))
    simulation, vehicle = spawn(empty_room, Pose2(-8, 0), "P2AT", config)
    assert read(simulation, vehicle, 40) == []
