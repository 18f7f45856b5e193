"""Touches of a robot that last, or that are where one was before."""

import math
from dataclasses import dataclass

from radarsim.geometry import Pose2, wrap_angle
from radarsim.server.host import Host, HostObserver
from radarsim.simulation.clock import TICK

PUSH = 1.0  # s; a longer touch is a push
SAME_PLACE = 0.15  # m between two touches at the same place,
SAME_YAW = math.radians(20)  # and between their headings


@dataclass(slots=True)
class Contact:
    """A touch: the pose of the robot when it began, and how long it has lasted, s."""

    pose: Pose2
    duration: float = 0.0

    def repeats(self, earlier: "Contact") -> bool:
        """Return whether it is at the place of an earlier one."""
        pose, other = self.pose, earlier.pose
        apart = math.hypot(pose.x - other.x, pose.y - other.y)
        turned = abs(wrap_angle(pose.yaw - other.yaw))
        return apart < SAME_PLACE and turned < SAME_YAW


class Contacts(HostObserver):
    """The touches of the only robot of a host, which it watches at every tick."""

    def __init__(self, host: Host) -> None:
        self.found: list[Contact] = []
        self._simulation = host.simulation
        self._touches = False
        host.add_observer(self)

    def step(self, *, passes: bool) -> None:  # noqa: ARG002 - time always passes here
        for vehicle in self._simulation.vehicles:
            touches = vehicle.robot.touched
            if touches and not self._touches:
                self.found.append(Contact(vehicle.robot.pose))
            if touches:
                self.found[-1].duration += TICK
            self._touches = touches

    @property
    def pushes(self) -> int:
        """How many contacts lasted, or were where there had been one before."""
        return sum(
            each.duration > PUSH or any(map(each.repeats, self.found[:k]))
            for k, each in enumerate(self.found)
        )
