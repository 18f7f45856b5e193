"""Sensors of a robot that stands where a test puts it."""

from typing import Any

import numpy as np

from radarsim.geometry import Pose2, Pose3
from radarsim.presets.robots import Item, load_robot
from radarsim.protocol.dialect import COMPAT, Dialect, WheelDrive
from radarsim.robots.fleet import Fleet
from radarsim.robots.obstacles import Obstacles
from radarsim.robots.robot import Robot
from radarsim.scene.scene import Scene
from radarsim.sensors.readings import ReadingTable, RobotState
from radarsim.sensors.sensor import Mounting

NOWHERE = Scene("nowhere", "nowhere")


def robot_at(body: Pose3) -> Robot:
    """Return a P3AT, number 1 of a fleet of its own."""
    drive, model = WheelDrive(1.0), load_robot("P3AT")
    place = Pose2(0.0, 0.0), Obstacles()
    robot = Fleet().add("R1", model, place[0], obstacles=place[1], wheel_drive=drive)
    move(robot, body)
    return robot


def move(robot: Robot, body: Pose3) -> None:
    """Put the body of a robot somewhere."""
    names = ("x", "y", "body_z", "roll", "pitch", "yaw")
    for name, number in zip(names, body.numbers(), strict=True):
        robot.row[name] = number


def mounting(
    item: Item,
    settings: Any = None,
    *,
    robot: Robot,
    rng: np.random.Generator | None = None,
    scene: Scene = NOWHERE,
    dialect: Dialect = COMPAT,
) -> Mounting:
    """Return what a sensor of a robot is created from."""
    state = RobotState(ReadingTable(robot.fleet), robot.slot)
    rng = rng or np.random.default_rng(0)
    return Mounting(item, settings, robot, state, rng, scene, dialect, 0.0)
