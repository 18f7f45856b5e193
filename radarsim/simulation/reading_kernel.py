"""Compute the numbers of the readings of many robots in one compiled call.

What a robot reports follows from instructions, each of which writes some numbers.
Robots of one class follow the same ones, as what its items need to remember has the
same places in the numbers of each.
"""

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import Int, njit_cached, njit_inline
from radarsim.robots.fleet_columns import (
    BODY_Z,
    LEFT_ANGLE,
    RIGHT_ANGLE,
    TOUCHED,
    YAW,
    X,
    Y,
)
from radarsim.robots.odometry import POSE_X
from radarsim.sensors.motion_readings import (
    ANGLE_ZERO,
    DRAWN,
    INS_DRAWS,
    INS_NUMBERS,
    INS_USED,
    SPEEDS,
    USED,
    count_ticks,
    measure_speeds,
    move_ins,
    read_ins,
)

# Columns of instructions: what is to be done; place of the numbers that it needs; side
# of a wheel, 0 for left and 1 for right; factor of a number.
KIND, PLACE, SIDE, FACTOR = range(4)
# Kinds that write a number: time, s; charge of the battery, s; speed and angle of a
# wheel, as a tachometer measured them; ticks of a wheel; whether the robot is touched.
TIME, CHARGE, WHEEL_SPEED, WHEEL_ANGLE, TICKS, IS_TOUCHED = range(6)
# Kinds that write a pose: that of the body, that which an INS estimates, and x, y, yaw
# that the wheels imply.
BODY_POSE, INS_POSE, WHEEL_POSE = range(6, 9)
# Kinds that write nothing: measure with a tachometer, and let an INS drift.
MEASURE, DRIFT = range(9, 11)

SPENT: Final = 0  # place in the numbers of a robot: 1 if random numbers are used up
# Numbers of a battery: time that it lasts, s; what it holds at least, s; tick of the
# spawn.
LIFE, LEAST, SPAWN_TICK = range(3)


class RobotState(NamedTuple):
    """What readings of a robot follow from.

    Attributes:
        slot: Slot of the robot in the fleet.
        robots: The columns of the fleet.
        odometry: The odometry of the fleet.
        numbers: The numbers of the robot.
        body: (6,) x, y, z, roll, pitch, yaw of the body, map frame.
        ticks: Simulated time in ticks.
    """

    slot: int
    robots: Floats
    odometry: Floats
    numbers: Floats
    body: Floats
    ticks: int


@njit_cached
def fill_readings(
    jobs: NDArray[np.int64],
    instructions: NDArray[np.int64],
    numbers: Floats,
    ticks: int,
    out: Floats,
    *fleet: Floats,
) -> int:
    """Follow instructions for robots, one after the other.

    Args:
        jobs: (J, 3) slot of each robot, the first of its instructions, and that after
            the last.
        instructions: (I, 4), with the columns above.
        numbers: (R, N) numbers of the robots, by slot.
        ticks: Simulated time in ticks.
        out: For what is written.
        fleet: Columns of the fleet, and its odometry.

    Returns:
        The number of robots that have used up some of their random numbers.
    """
    robots, odometry = fleet
    at: Int = 0
    spent, body = 0, np.zeros(6)
    for job in range(len(jobs)):
        slot = jobs[job, 0]
        robot = RobotState(slot, robots, odometry, numbers[slot], body, ticks)
        body[0], body[1] = robots[slot, X], robots[slot, Y]
        body[2], body[5] = robots[slot, BODY_Z], robots[slot, YAW]
        for row in range(jobs[job, 1], jobs[job, 2]):
            kind, place = instructions[row, KIND], instructions[row, PLACE]
            if kind < BODY_POSE:
                number = _number(kind, place, instructions[row, SIDE], robot)
                out[at] = number * instructions[row, FACTOR]
                at += 1
            elif kind < MEASURE:
                at = _write_pose(kind, place, robot, out, at)
            else:
                _update(kind, place, robot)
        spent += robot.numbers[SPENT] != 0.0
    return spent


@njit_inline
def _number(kind: Int, place: Int, side: Int, robot: RobotState) -> float:
    """Return the number that an instruction writes."""
    numbers = robot.numbers
    angle = robot.robots[robot.slot, RIGHT_ANGLE if side else LEFT_ANGLE]
    if kind == TIME:
        return robot.ticks / 100
    if kind == CHARGE:
        return _charge(numbers, place, robot.ticks)
    if kind == WHEEL_SPEED:
        return float(numbers[place + SPEEDS + side])
    if kind == WHEEL_ANGLE:
        return float(angle - numbers[place + ANGLE_ZERO + side])
    if kind == IS_TOUCHED:
        return float(robot.robots[robot.slot, TOUCHED])
    ticks = count_ticks(numbers, place, side, angle)
    if numbers[place + USED] == numbers[place + DRAWN]:
        numbers[SPENT] = 1.0
    return ticks


@njit_inline
def _charge(numbers: Floats, battery: Int, ticks: int) -> float:
    """Return the time that a battery lasts, s, as ``Battery.seconds_left`` does."""
    elapsed = (ticks - numbers[battery + SPAWN_TICK]) / 100
    left = np.trunc(max(0.0, numbers[battery + LIFE] - elapsed))
    return float(max(left, numbers[battery + LEAST]))


@njit_inline
def _write_pose(kind: Int, place: Int, robot: RobotState, out: Floats, at: Int) -> Int:
    """Write the pose that an instruction writes; return the place after it."""
    if kind == INS_POSE:
        read_ins(robot.numbers, place, robot.body, out, at)
        return at + 6
    if kind == BODY_POSE:
        for axis in range(6):
            out[at + axis] = robot.body[axis]
        return at + 6
    for axis in range(3):
        out[at + axis] = robot.odometry[int(robot.numbers[place]), POSE_X + axis]
    return at + 3


@njit_inline
def _update(kind: Int, place: Int, robot: RobotState) -> None:
    """Follow an instruction that writes nothing."""
    numbers, robots, slot = robot.numbers, robot.robots, robot.slot
    if kind == MEASURE:
        left, right = robots[slot, LEFT_ANGLE], robots[slot, RIGHT_ANGLE]
        measure_speeds(numbers, place, robot.ticks / 100, left, right)
        return
    move_ins(numbers, place, robot.body)
    if numbers[place + INS_USED] == INS_NUMBERS - INS_DRAWS:
        numbers[SPENT] = 1.0
