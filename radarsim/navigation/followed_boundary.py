"""The boundary that TangentBug follows: where it is, and what is known of it."""

import math

import numpy as np

from radarsim.navigation.boundary_policy import Landmark, Step, Trail
from radarsim.navigation.controller import Point
from radarsim.navigation.followed_obstacle import FollowedObstacle
from radarsim.navigation.observation import Observation
from radarsim.navigation.standing_obstacle import StandingObstacle
from radarsim.navigation.wall_following import FollowMode, WallFollower


class FollowedBoundary:
    """The boundary that is followed, and what is known of it.

    Attributes:
        mode: How it is followed.
        least: m to be followed before it is left for a place nearer to the goal.
        travelled: m along it.
        reached_at: When the robot came beside it, s.
        goal_distance: Its least distance from the goal so far, m.
        circled: Points of it, to look at them again.
    """

    def __init__(self, follower: WallFollower, mode: FollowMode) -> None:
        self.mode = mode
        self.least = 0.0
        self.reached_at = -math.inf
        self.travelled = 0.0
        self.goal_distance = -math.inf  # so that it is not left before it is reached
        self.circled = StandingObstacle()
        self._follower = follower
        self._obstacle: FollowedObstacle | None = None
        self._trail: Trail | None = None

    @property
    def is_reached(self) -> bool:
        """Whether the robot is beside it."""
        return self._obstacle is not None

    def reach(self, observation: Observation, bearing: float) -> None:
        """Begin beside it, where a bumper is pressed towards a bearing, rad."""
        point = self._follower.hit_point(observation, self.mode, bearing)
        place = point.point_from(observation.pose)
        self._obstacle = FollowedObstacle(place, self._follower)
        self.goal_distance, self.reached_at = math.inf, observation.time

    def look(self, observation: Observation, goal: Point) -> Observation:
        """Return the part of a scan that shows it; note its distance from a goal."""
        assert self._obstacle is not None
        part = self._obstacle.part_of(observation, self.mode)
        if part is not observation:  # else it is out of sight, or another is nearer
            distances = np.hypot(*(part.points() - goal).T)
            nearest = float(distances.min(initial=math.inf))
            self.goal_distance = min(self.goal_distance, nearest)
        return part

    def closes(self, part: Observation, step: float) -> bool:
        """Return whether the robot has come back to where it was on it.

        Args:
            part: The part of the scan that shows it.
            step: m that the robot has driven since the last scan.
        """
        self.travelled += step
        if nearest := self._follower.boundary(part, self.mode):
            self.circled.add(nearest.point_from(part.pose), part.pose.yaw)
        pose, direction = part.pose, self._follower.tangent(part, self.mode)
        if self._trail is None:
            offset = self._follower.target_distance
            hit = Landmark(pose, direction, max_offset=offset)
            self._trail = Trail(hit, offset)
        here = Step(pose, step, direction, free=False)
        return self._trail.closes(here, self.travelled) is not None
