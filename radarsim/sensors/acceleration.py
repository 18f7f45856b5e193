"""What accelerometers and inertial measurement units read.

Velocities are those of the body's last tick. An acceleration is the change of velocity
since the last reading, as the original has it, along the axes of the sensor at its end.
Rates are the changes of roll, pitch and yaw, and not those about the axes of the body.
"""

import math
from typing import Final

import numpy as np

from radarsim.geometry import Floats, Pose3
from radarsim.jit import Int, njit_inline

GRAVITY: Final = 9.81  # m/s2
# Numbers of a sensor: its axes in the body frame, row by row; time of the last reading,
# s; velocity then, m/s, map frame; roll, pitch and yaw then, rad; and the rates of that
# reading, rad/s.
AXES, READ_TIME, VELOCITY, ATTITUDE, RATES = 0, 9, 10, 13, 16


def new_acceleration(mount: Pose3, time: float, yaw: float) -> Floats:
    """Return the numbers of a sensor on a robot that stands still.

    Args:
        mount: Pose of the sensor in the body frame.
        time: s.
        yaw: Yaw of the body, rad.
    """
    axes = mount.rotation().T.ravel()
    return np.concatenate([axes, [time, *[0.0] * 5, yaw, 0.0, 0.0, 0.0]])


@njit_inline
def read_acceleration(
    numbers: Floats,
    place: Int,
    time: float,
    motion: tuple[float, float, float],
    attitude: tuple[float, float, float],
    gravity: float,
    out: Floats,
    at: Int,
) -> float:
    """Write the acceleration along the axes of a sensor, m/s2.

    Args:
        numbers: Numbers of all sensors of the robot.
        place: Place from which on those of the sensor are.
        time: s.
        motion: Velocity of the body, m/s, map frame.
        attitude: Its roll, pitch and yaw, rad.
        gravity: What is added downwards, m/s2.
        out: For the three numbers.
        at: Place of the first of them.

    Returns:
        The time since the last reading, s; accelerations are 0 if it is 0.
    """
    x, y, z = motion
    roll, pitch, yaw = attitude
    elapsed = time - numbers[place + READ_TIME]
    along, across, up = 0.0, 0.0, 0.0
    if elapsed > 1e-6:
        velocity = place + VELOCITY
        more_x, more_y = (
            (x - numbers[velocity]) / elapsed,
            (y - numbers[velocity + 1]) / elapsed,
        )
        c, s = math.cos(yaw), math.sin(yaw)
        along, across = c * more_x + s * more_y, c * more_y - s * more_x
        up = (z - numbers[velocity + 2]) / elapsed
        numbers[velocity], numbers[velocity + 1] = x, y
        numbers[velocity + 2] = z
        numbers[place + READ_TIME] = time
    up -= gravity
    if roll != 0.0 or pitch != 0.0:
        c, s = math.cos(pitch), math.sin(pitch)
        along, up = c * along - s * up, s * along + c * up
        c, s = math.cos(roll), math.sin(roll)
        across, up = c * across + s * up, c * up - s * across
    for axis in range(3):
        row = place + AXES + 3 * axis
        level = numbers[row] * along + numbers[row + 1] * across
        out[at + axis] = level + numbers[row + 2] * up
    return float(elapsed)


@njit_inline
def read_rotation(
    numbers: Floats,
    place: Int,
    elapsed: float,
    attitude: tuple[float, float, float],
    out: Floats,
    at: Int,
) -> None:
    """Write rates, their changes, and angles of the body: nine numbers.

    Args:
        numbers: Numbers of all sensors of the robot.
        place: Place from which on those of the sensor are.
        elapsed: Time since the last reading, s.
        attitude: Roll, pitch and yaw of the body, rad.
        out: For roll, pitch and yaw: rates, rad/s, accelerations, rad/s2, angles, rad.
        at: Place of the first of them.
    """
    for axis in range(3):
        angle, last = attitude[axis], place + ATTITUDE + axis
        out[at + axis], out[at + 3 + axis], out[at + 6 + axis] = 0.0, 0.0, angle
        if elapsed > 1e-6:
            turn = angle - numbers[last]
            if turn > math.pi:
                turn -= 2 * math.pi
            elif turn < -math.pi:
                turn += 2 * math.pi
            rate = turn / elapsed
            out[at + axis] = rate
            out[at + 3 + axis] = (rate - numbers[place + RATES + axis]) / elapsed
            numbers[last], numbers[place + RATES + axis] = angle, rate
