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
AHEAD: Final = 0.5  # m ahead of a mover
ROOM: Final = 0.9  # m around that place, in which a navigator stops it


@dataclass(frozen=True, slots=True)
class Mover:
    """Another robot, which drives to and fro on a straight track."""

    x: float  # m, of its begin
    y: float  # m
    yaw: float  # rad
    length: float  # m
    speed: float  # m/s


class Traffic:
    """Drives movers, each by a connection of its own."""

    def __init__(self, host: Host, movers: Sequence[Mover]) -> None:
        """Create it; its robots come once there is another one."""
        self._host = host
        self._movers = [_DrivenMover(mover) for mover in movers]
        self._links: list[InProcessTransport] = []

    def step(self) -> None:
        """Drive on; to be called after every tick."""
        vehicles = self._host.simulation.vehicles
        if not self._movers or not vehicles:
            return
        if not self._links:
            for driven in self._movers:
                self._links.append(InProcessTransport(self._host))
                self._links[-1].send(driven.spawn())
        first, *others = (vehicle.robot.pose for vehicle in vehicles)
        # they come in the order in which they were asked for
        for driven, link, pose in zip(self._movers, self._links, others, strict=False):
            self._host.take(link.number)  # or what it is sent piles up
            if command := driven.steer(pose, first):
                link.send(command)


class _DrivenMover:
    """Decides how one mover drives."""

    def __init__(self, mover: Mover) -> None:
        self._mover = mover
        self._forward = 1.0  # or -1
        self._spin: float | None = None  # rad/s; of its wheels
        self._wheel_radius = load_robot(ROBOT).wheel_radius

    def spawn(self) -> bytes:
        """Return the command that spawns it."""
        mover = self._mover
        return spawn(ROBOT, pose=Pose2(mover.x, mover.y, mover.yaw)).data

    def steer(self, pose: Pose2, other: Pose2) -> bytes:
        """Return the command to drive as is needed now; nothing if it is unchanged."""
        mover = self._mover
        c, s = math.cos(mover.yaw), math.sin(mover.yaw)
        along = (pose.x - mover.x) * c + (pose.y - mover.y) * s
        if not 0 <= along <= mover.length:
            self._forward = 1.0 if along < 0 else -1.0
        ahead = AHEAD * self._forward
        place = (pose.x + ahead * c, pose.y + ahead * s)
        has_room = math.dist(place, (other.x, other.y)) > ROOM
        spin = self._forward * mover.speed / self._wheel_radius * has_room
        if spin == self._spin:
            return b""
        self._spin = spin
        return drive(spin, spin)
