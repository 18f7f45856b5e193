"""The path of a car against the rules of the bicycle model, and its footprint."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarsim.geometry import Pose2
from radarsim.presets.robots import RobotModel, load_robot
from radarsim.protocol.dialect import WheelDrive
from radarsim.robots.fleet import Fleet
from radarsim.robots.obstacles import Obstacles
from radarsim.robots.robot import Robot

SEDAN, FRONT, REAR = map(load_robot, ("Sedan", "FrontAckerman", "BasicAckermanRobot"))
CRAB = SEDAN.model_copy(
    update={"steering": SEDAN.steering.model_copy(update={"max_rear_deg": 20.0})}
    if SEDAN.steering
    else {}
)
DT = 0.01
ORIGIN = Pose2(0, 0)


def car(
    model: RobotModel, pose: Pose2 = ORIGIN, walls: Obstacles | None = None
) -> Robot:
    obstacles = walls or Obstacles(np.zeros((0, 2, 2)))
    drive = WheelDrive(30.0)
    return Fleet().add("Car", model, pose, obstacles=obstacles, wheel_drive=drive)


def steps(robot: Robot, count: int) -> list[Pose2]:
    path = [robot.pose]
    for _ in range(count):
        robot.fleet.step(DT)
        path.append(robot.pose)
    return path


def axles(model: RobotModel) -> tuple[float, float]:
    """Return x of the front and the rear axle in the body frame."""
    assert model.steering
    rear = model.steering.rear_axle
    rear = -model.wheel_base / 2 if rear is None else rear
    return rear + model.wheel_base, rear


def along(pose: Pose2, x: float) -> complex:
    """Return a point ahead of the centre in the map."""
    return complex(pose.x, pose.y) + x * complex(math.cos(pose.yaw), math.sin(pose.yaw))


@pytest.mark.parametrize("model", [SEDAN, FRONT, REAR, CRAB])
@settings(max_examples=25)
@given(
    speed=st.floats(-5, 5).filter(lambda value: abs(value) > 0.1),
    front=st.floats(-1, 1),
    rear=st.floats(-1, 1),
    yaw=st.floats(-3, 3),
)
def test_no_axle_slips_sideways(
    model: RobotModel, speed: float, front: float, rear: float, yaw: float
) -> None:
    robot = car(model, Pose2(1, 2, yaw))
    robot.steer(speed, front, rear)
    assert model.steering
    angles = (
        min(math.radians(limit), max(-math.radians(limit), angle))
        for limit, angle in (
            (model.steering.max_front_deg, front),
            (model.steering.max_rear_deg, rear),
        )
    )
    before, middle, after = robot.pose, *steps(robot, 2)[1:]
    for x, angle in zip(axles(model), angles, strict=True):
        moved = along(after, x) - along(before, x)  # a chord, as the path in the middle
        heading = middle.yaw + angle + (math.pi if speed < 0 else 0.0)
        sideways = (moved * np.exp(-1j * heading)).imag
        assert abs(sideways) < 1e-6 * abs(moved)
    rolled = abs(along(after, axles(model)[1]) - along(before, axles(model)[1]))
    assert rolled == pytest.approx(2 * DT * abs(speed) * model.wheel_radius, rel=1e-3)


def test_rear_axle_of_a_car_goes_in_a_circle() -> None:
    robot = car(SEDAN)
    robot.steer(5.0, math.radians(20))
    radius = SEDAN.wheel_base / math.tan(math.radians(20))
    rear = axles(SEDAN)[1]
    centre = along(robot.pose, rear) + 1j * radius
    path = steps(robot, 1000)
    distances = [abs(along(pose, rear) - centre) for pose in path]
    assert max(distances) - min(distances) < 1e-9
    assert distances[0] == pytest.approx(radius)
    turn = 1000 * DT * 5.0 * SEDAN.wheel_radius / radius
    assert path[-1].yaw == pytest.approx(turn)


def test_a_car_parks_where_two_arcs_say() -> None:
    """Backwards, right and then left: both arcs are of the same angle and radius."""
    robot = car(SEDAN)
    rear, angle = axles(SEDAN)[1], math.radians(30)
    radius = SEDAN.wheel_base / math.tan(angle)
    start = along(robot.pose, rear)
    speed = 2.0 * SEDAN.wheel_radius
    count = round(0.6 * radius / speed / DT)
    turn = count * DT * speed / radius
    robot.steer(-2.0, -angle)
    steps(robot, count)
    robot.steer(-2.0, angle)
    end = along(steps(robot, count)[-1], rear)
    moved = -2 * radius * complex(math.sin(turn), (1 - math.cos(turn)))
    assert end - start == pytest.approx(moved, abs=1e-9)
    assert robot.pose.yaw == pytest.approx(0.0, abs=1e-12)


def test_equal_angles_let_a_car_go_sideways() -> None:
    robot = car(CRAB)
    robot.steer(3.0, 0.2, 0.2)
    end = steps(robot, 100)[-1]
    assert math.atan2(end.y, end.x) == pytest.approx(0.2)
    assert end.yaw == 0.0


@pytest.mark.parametrize("side", [1, -1])
def test_tail_swings_out_into_a_wall(side: int) -> None:
    """A car turns away from a wall at its side; its far corner swings out first."""
    assert SEDAN.steering
    radius = SEDAN.wheel_base / math.tan(math.radians(SEDAN.steering.max_front_deg))
    overhang = SEDAN.length / 2 + axles(SEDAN)[1]
    reach = radius + SEDAN.width / 2
    swing = math.hypot(reach, overhang) - reach
    assert swing > 0.05
    for gap, is_touched in ((0.9 * swing, True), (1.1 * swing, False)):
        y = -side * (SEDAN.width / 2 + gap)
        wall = Obstacles(np.array([[[-9.0, y], [9.0, y]]]))
        robot = car(SEDAN, walls=wall)
        robot.steer(2.0, side * math.radians(SEDAN.steering.max_front_deg))
        touched = []
        for _ in range(400):
            robot.fleet.step(DT)
            touched.append(robot.touched)
        assert any(touched) is is_touched
        assert not touched[0]


def test_angles_that_a_command_omits_stay() -> None:
    robot = car(CRAB)
    robot.steer(1.0, 0.1, 0.2)
    robot.steer(2.0)
    assert robot.bicycle
    motion = robot.bicycle.motion(2.0, 0.1, 0.2)
    names = ("left_spin", "right_spin", "sideslip")
    assert tuple(robot.row[name] for name in names) == motion


def test_car_heeds_no_speeds_of_sides_and_stops() -> None:
    robot = car(SEDAN)
    robot.drive(1.0, 1.0)
    assert steps(robot, 1)[-1] == Pose2(0, 0)
    robot.drive(normalized=True)
    robot.steer(50.0)
    assert steps(robot, 100)[-1].x == pytest.approx(15.0 * SEDAN.wheel_radius)
    robot.halt()
    assert len(set(steps(robot, 3))) == 1


def test_no_point_is_faster_than_the_top_speed() -> None:
    for model in (SEDAN, FRONT, REAR, CRAB):
        robot = car(model)
        robot.steer(99.0, 9.0, -9.0)
        there, then = (
            robot.footprint.outline(p).reshape(-1, 2) for p in steps(robot, 1)
        )
        fastest = np.linalg.norm(then - there, axis=1).max() / DT
        assert fastest <= robot.top_speed / 2 * (1 + 1e-9)


def test_only_a_car_steers() -> None:
    with pytest.raises(ValueError, match="P3AT is skid-steered"):
        car(load_robot("P3AT")).steer(1.0)
