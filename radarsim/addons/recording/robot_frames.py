"""Where a robot is, by REP-105 of ROS: its odometry, and its frames.

The parent of the robot's ``base_link`` is its ``odom``, in which it moves without
jumps; the parent of that is ``map``, which corrects what odometry has lost.
"""

import math
from collections.abc import Iterator

import numpy as np

from radarsim.addons.recording.messages import (
    TopicMessage,
    odometry,
    transform,
    transforms,
)
from radarsim.client.robot_info import RobotInfo
from radarsim.geometry import Pose3, wrap_angle
from radarsim.protocol.reports import GroundTruth, Ins, Odometry

MAP = "map"
SOURCES = (Odometry, Ins, GroundTruth)  # of the pose in ``odom``, best first
REFERENCES = (GroundTruth, Ins)  # of the pose in ``map``, best first
# Times the top speed: who is faster has been put there, as by a reset of odometry.
JUMP = 2.0


class RobotFrames:
    """The odometry and the frames of one robot."""

    def __init__(self, name: str, *, own_localization: bool) -> None:
        """Begin with a robot that has sensed nothing.

        Args:
            name: Name of the robot, which its frames and topics begin with; empty for
                none.
            own_localization: Whether the pose of ``odom`` in ``map`` is left out.
        """
        odom = below(name, "odom")
        self._topic = f"/{odom}"
        self._odom, self._base = odom, below(name, "base_link")
        self._own_localization = own_localization
        self._readings: dict[type, tuple[float, Pose3]] = {}
        self._knows_all = False

    def observe(
        self, kind: type, time: float, pose: Pose3, robot: RobotInfo | None
    ) -> Iterator[TopicMessage]:
        """Yield the odometry and the frames that a reading leads to.

        Args:
            kind: Which sensor has read it: one of ``SOURCES``.
            time: Simulated time, s.
            pose: Pose of the robot: in ``odom`` if by odometry, else in ``map``.
            robot: The robot, if it is known.
        """
        before = self._readings.get(kind)
        self._readings[kind] = time, pose
        # A sensor that has nothing better than it must not be taken for the only one.
        self._knows_all |= before is not None and time > before[0]
        source = next(each for each in SOURCES if each in self._readings)
        if kind is not source or not self._knows_all:
            return
        speed, turn = (0.0, 0.0) if before is None else _motion(before, time, pose)
        if robot is not None:
            fastest = abs(speed) + abs(turn) * robot.wheel_separation / 2
            if fastest > JUMP * robot.top_speed:
                speed = turn = 0.0
        frames = [transform(time, self._odom, self._base, pose)]
        message = odometry(time, self._odom, self._base, pose, speed, turn)
        yield TopicMessage(self._topic, message)
        reference = next((r for r in REFERENCES if r in self._readings), None)
        if reference is not None and not self._own_localization:
            # Of the same tick: odometry comes after INS, and that after the truth.
            place = self._readings[reference][1].compose(pose.inverse())
            frames.append(transform(time, MAP, self._odom, place))
        yield TopicMessage("/tf", transforms(frames))


def below(robot: str, *names: str) -> str:
    """Return a frame, or a topic without its first slash, of a robot.

    >>> below("R1", "lms200", "scan"), below("", "odom")
    ('R1/lms200/scan', 'odom')
    """
    return "/".join((robot, *names) if robot else names)


def _motion(
    before: tuple[float, Pose3], time: float, pose: Pose3
) -> tuple[float, float]:
    """Return speed ahead, m/s, and turn rate, rad/s, of an arc between two poses."""
    began, start = before
    turned = wrap_angle(pose.yaw - start.yaw)
    heading = start.yaw + turned / 2
    dx, dy = pose.x - start.x, pose.y - start.y
    chord = dx * math.cos(heading) + dy * math.sin(heading)
    if not time > began:
        return 0.0, 0.0
    arc = chord / float(np.sinc(turned / (2 * math.pi)))
    return arc / (time - began), turned / (time - began)
