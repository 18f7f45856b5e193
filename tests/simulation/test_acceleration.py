"""Accelerometers and inertial measurement units on robots that drive."""

import math

import numpy as np
import pytest
from tick_readings import read, spawn

from radarsim.geometry import Pose2
from radarsim.presets.robots import Item, load_robot
from radarsim.protocol.reports import Acceleration, Imu, ProperAcceleration
from radarsim.scene.scene import Scene
from radarsim.simulation.simulation import Simulation
from radarsim.simulation.vehicle import Vehicle

P3AT = load_robot("P3AT")
ITEMS = (
    Item(type="IMU", name="Imu"),
    Item(type="Accel", name="Level"),
    Item(type="AcceleroMeter", name="Proper"),
    Item(type="Accel", name="Turned", rotation_deg=(0, 0, 90)),
    Item(type="AcceleroMeter", name="Upright", rotation_deg=(0, -90, 0)),
)
DT, TICK = 0.1, 0.01


MODEL = P3AT.model_copy(update={"items": ITEMS})


def values(simulation: Simulation, vehicle: Vehicle) -> dict[str, tuple[float, ...]]:
    """Return the readings of the next ones that are due, by names of items."""
    readings: dict[str, tuple[float, ...]] = {}
    for each in read(simulation, vehicle):
        match each:
            case Imu():
                parts = (each.rates, each.rate_changes, each.angles)
                readings[each.name] = each.acceleration
                names = ("rates", "rate changes", "angles")
                readings |= dict(zip(names, parts, strict=True))
            case Acceleration() | ProperAcceleration():
                readings[each.name] = each.acceleration
            case _:
                pass
    return readings


def test_at_rest_only_gravity_is_felt(empty_room: Scene) -> None:
    readings = values(*spawn(empty_room, Pose2(0, 0, 1.0), MODEL))
    assert readings["Proper"] == pytest.approx((0, 0, -9.81))
    assert readings["Upright"] == pytest.approx((-9.81, 0, 0))
    assert readings["angles"] == (0, 0, 1.0)
    for name in ("Imu", "Level", "Turned", "rates", "rate changes"):
        assert readings[name] == pytest.approx((0, 0, 0))


def test_start_is_felt_once_along_the_axes_of_the_sensor(empty_room: Scene) -> None:
    simulation, vehicle = spawn(empty_room, Pose2(0, 0, 2.0), MODEL)
    vehicle.robot.drive(5.0, 5.0)
    speed = 5.0 * P3AT.wheel_radius
    readings = values(simulation, vehicle)
    assert readings["Imu"] == pytest.approx((speed / DT, 0, 0))
    assert readings["Turned"] == pytest.approx((0, -speed / DT, 0))
    assert readings["Proper"] == pytest.approx((speed / DT, 0, -9.81))
    assert values(simulation, vehicle)["Imu"] == pytest.approx((0, 0, 0), abs=1e-9)


def test_circle_gives_the_change_of_a_velocity_that_turns(empty_room: Scene) -> None:
    pose = Pose2(0, 0, 3.0)  # the yaw passes pi
    simulation, vehicle = spawn(empty_room, pose, MODEL)
    vehicle.robot.drive(3.0, 6.0)
    rate = 3.0 * P3AT.wheel_radius / P3AT.track
    # Of the last tick: its chord, which points half a tick back.
    half = rate * TICK / 2
    speed = 4.5 * P3AT.wheel_radius * math.sin(half) / half
    first = values(simulation, vehicle)
    assert first["rates"] == pytest.approx((0, 0, rate))
    assert first["rate changes"] == pytest.approx((0, 0, rate / DT))
    for _ in range(5):
        readings = values(simulation, vehicle)
        change = speed * (1 - np.exp(-1j * rate * DT)) * np.exp(-1j * half) / DT
        expected = (change.real, change.imag, 0)
        assert readings["Imu"] == pytest.approx(expected, abs=1e-9)
        assert readings["rates"] == pytest.approx((0, 0, rate))
        assert readings["rate changes"] == pytest.approx((0, 0, 0), abs=1e-9)
        assert readings["angles"][2] == pytest.approx(vehicle.robot.pose.yaw)


def test_wall_that_stops_the_robot_is_felt(empty_room: Scene) -> None:
    simulation, vehicle = spawn(empty_room, Pose2(10.0, 0, 0), MODEL)
    vehicle.robot.drive(8.0, 8.0)
    felt = [values(simulation, vehicle)["Imu"][0] for _ in range(5)]
    speed = 8.0 * P3AT.wheel_radius
    assert felt[0] == pytest.approx(speed / DT)
    assert sum(felt) == pytest.approx(0, abs=1e-6)
