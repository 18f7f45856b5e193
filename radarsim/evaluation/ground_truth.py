"""The true robot, as the simulation has it: its path, its collisions, its distances."""

import math
from typing import Final, TypeAlias

import numpy as np

from radarsim.geometry import Floats, Pose2
from radarsim.host import Host

Position: TypeAlias = tuple[float, float]  # x, y in m, map frame

STEP: Final = 0.02  # m between two positions of the true path


class GroundTruthMonitor:
    """Watches the robot of a simulation, tick by tick.

    Attributes:
        collisions: How often the robot began to touch something.
        path_length: Length of the true path of the robot's centre, m.
        path: That path, in steps of at least ``STEP``.
    """

    def __init__(self, host: Host) -> None:
        self.collisions = 0
        self.path_length = 0.0
        self.path: list[Position] = []
        self._simulation = host.simulation
        self._touching = False
        self._pose: Pose2 | None = None

    def watch(self) -> None:
        """Update from the simulation; to be called after every tick."""
        for vehicle in self._simulation.vehicles:
            pose, touching = vehicle.robot.pose, vehicle.robot.touched
            self.collisions += touching and not self._touching
            self._touching = touching
            previous = self._pose or pose
            self.path_length += math.hypot(pose.x - previous.x, pose.y - previous.y)
            self._pose = pose
            self._add_to_path(pose)

    @property
    def positions(self) -> Floats:
        """The path up to where the robot is, (N, 2) m, map frame."""
        ends = [] if self._pose is None else [(self._pose.x, self._pose.y)]
        return np.array([*self.path, *ends]).reshape(-1, 2)

    def _add_to_path(self, pose: Pose2) -> None:
        x, y = self.path[-1] if self.path else (math.inf, math.inf)
        if math.hypot(pose.x - x, pose.y - y) >= STEP:
            self.path.append((pose.x, pose.y))

    def distance(self, goal: tuple[float, float]) -> float:
        """Return the robot's distance from a point, m; ``inf`` without a robot."""
        if self._pose is None:
            return math.inf
        return math.hypot(self._pose.x - goal[0], self._pose.y - goal[1])
