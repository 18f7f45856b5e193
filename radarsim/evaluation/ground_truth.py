"""The true robot, as the simulation has it: its path, its collisions, its distances."""

import math

from radarsim.geometry import Pose2
from radarsim.host import Host


class GroundTruthMonitor:
    """Watches the robot of a simulation, tick by tick.

    Attributes:
        collisions: How often the robot began to touch something.
        path_length: Length of the true path of the robot's centre, m.
    """

    def __init__(self, host: Host) -> None:
        self.collisions = 0
        self.path_length = 0.0
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

    def distance(self, goal: tuple[float, float]) -> float:
        """Return the robot's distance from a point, m; ``inf`` without a robot."""
        if self._pose is None:
            return math.inf
        return math.hypot(self._pose.x - goal[0], self._pose.y - goal[1])
