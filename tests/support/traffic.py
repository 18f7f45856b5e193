"""Other robots that drive to and fro while a navigator runs, and stop before it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from radarsim.client.session import drive, spawn
from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport

ROBOT: Final = "P3AT"
WHEEL_RADIUS: Final = load_robot(ROBOT).wheel_radius  # m
AHEAD: Final = 0.5  # m ahead of a mover
ROOM: Final = 0.9  # m around that place, in which a navigator stops it


@dataclass(slots=True)
class Mover:
    """Another robot, which drives to and fro on a straight track."""

    x: float  # m, of its begin
    y: float  # m
    yaw: float  # rad
    length: float  # m
    speed: float  # m/s
    forward: float = 1.0  # or -1
    spin: float | None = None  # rad/s; of its wheels

    def steer(self, pose: Pose2, other: Pose2) -> bytes:
        """Return the command to drive as is needed now; nothing if it is unchanged."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        along = (pose.x - self.x) * c + (pose.y - self.y) * s
        if not 0 <= along <= self.length:
            self.forward = 1.0 if along < 0 else -1.0
        ahead = AHEAD * self.forward
        place = (pose.x + ahead * c, pose.y + ahead * s)
        has_room = math.dist(place, (other.x, other.y)) > ROOM
        spin = self.forward * self.speed / WHEEL_RADIUS * has_room
        if spin == self.spin:
            return b""
        self.spin = spin
        return drive(spin, spin)


class Traffic:
    """Drives movers, each by a connection of its own."""

    def __init__(self, host: Host, movers: Sequence[Mover]) -> None:
        """Create it; its robots come once there is another one."""
        self._host = host
        self._movers = movers
        self._links: list[InProcessTransport] = []

    def step(self) -> None:
        """Drive on; to be called after every tick."""
        vehicles = self._host.simulation.vehicles
        if not self._movers or not vehicles:
            return
        if not self._links:
            for mover in self._movers:
                self._links.append(InProcessTransport(self._host))
                place = Pose2(mover.x, mover.y, mover.yaw)
                self._links[-1].send(spawn(ROBOT, pose=place).data)
        first, *others = (vehicle.robot.pose for vehicle in vehicles)
        # they come in the order in which they were asked for
        for mover, link, pose in zip(self._movers, self._links, others, strict=False):
            self._host.take(link.number)  # or what it is sent piles up
            if command := mover.steer(pose, first):
                link.send(command)
