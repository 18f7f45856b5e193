"""Targets of several robots that explore one map.

Each robot drives to the frontier that is nearest to it, but to none near the target of
another robot. One that finds no other waits until the others have arrived, as there may
be more behind; all are done when nobody finds any target.

Of two robots that are near each other only one moves, the one that was started first,
unless that one waits. The other stands, and so is an obstacle that the first one sees.
Where a robot's map is not on the shared one, it is about where its start pose puts it,
and "near" is as much farther as that may be off.
"""

import math
from typing import Final

import numpy as np

from radarsim.autonomy.exploration.coverage import FULL_TURN, prefer_near
from radarsim.autonomy.exploration.path_follower import (
    MIN_SCANS,
    WAITING,
    ExplorationSettings,
    PathFollower,
)
from radarsim.autonomy.exploration.strategies import is_enclosed
from radarsim.autonomy.exploration.traversability import TraversabilityMap
from radarsim.autonomy.mapping.occupancy_grid import Mask, OccupancyGrid
from radarsim.autonomy.navigation.control import STOP, Twist
from radarsim.autonomy.navigation.observation import Observation
from radarsim.geometry import Point, Pose2, wrap_angle

TARGET_DISTANCE: Final = 2.5  # m between the targets of two robots, at least
NEAR: Final = 1.0  # m between the centers of two robots of which one gives way
START_ERROR: Final = 1.5  # m by which start poses may be off each other
DEADLOCK: Final = 20.0  # s without a target of any robot after which all give up


class TargetBoard:
    """Which robot is where, and drives where.

    Attributes:
        poses: Pose of each robot that is on the shared map, by number.
        rough_poses: Pose of each other robot on its own map, which is about the same.
        moving: Numbers of robots that move.
        targets: Target of each robot that has one, m, by number.
        searching: Numbers of robots that may find a target yet.
    """

    def __init__(self, robots: int) -> None:
        """Begin without targets.

        Args:
            robots: Number of robots.
        """
        self.poses: dict[int, Pose2] = {}
        self.rough_poses: dict[int, Pose2] = {}
        self.moving: set[int] = set()
        self.targets: dict[int, Point] = {}
        self.searching = set(range(robots))
        self._driven = -math.inf  # time when a robot last had a target

    def leave(self, number: int) -> None:
        """Take a robot off, as it drives no more; it stands where it is."""
        self.searching.discard(number)
        self.moving.discard(number)
        self.targets.pop(number, None)

    def note_pose(self, number: int, pose: Pose2, *, is_on_map: bool) -> None:
        """Note where a robot is, on the shared map or on its own."""
        if is_on_map:
            self.rough_poses.pop(number, None)
            self.poses[number] = pose
        else:
            self.poses.pop(number, None)
            self.rough_poses[number] = pose

    def may_move(self, number: int, *, wants_to: bool) -> bool:
        """Note whether a robot wants to move, and return whether it may."""
        # Only those that were started first count, or two robots would both wait.
        blocked = any(
            other < number and self._are_near(number, other) for other in self.moving
        )
        if wants_to and not blocked:
            self.moving.add(number)
        else:
            self.moving.discard(number)
        return number in self.moving

    def _are_near(self, one: int, other: int) -> bool:
        known = {**self.rough_poses, **self.poses}
        # A robot that nobody has seen yet may be anywhere.
        if one not in known or other not in known:
            return True
        a, b = known[one], known[other]
        # where the start poses put them, which are off by up to as much
        is_rough = one in self.rough_poses or other in self.rough_poses
        return math.hypot(a.x - b.x, a.y - b.y) < NEAR + START_ERROR * is_rough

    def other_targets(self, number: int) -> list[Point]:
        """Return the targets of all other robots, m."""
        return [point for each, point in self.targets.items() if each != number]

    def other_robots(self, number: int) -> list[Point]:
        """Return the centers of all other robots on the shared map, m."""
        return [(at.x, at.y) for each, at in self.poses.items() if each != number]

    def is_over(self, time: float) -> bool:
        """Return whether nobody finds a target, or all wait for each other, s."""
        if self.targets or self._driven == -math.inf:
            self._driven = time
        return not self.searching or time > self._driven + DEADLOCK


class SharedTargetStrategy:
    """Strategy of one of several robots.

    Attributes:
        is_done: Whether no robot finds a target any more.
    """

    def __init__(
        self,
        settings: ExplorationSettings,
        board: TargetBoard,
        number: int,
        *,
        fills: bool,
    ) -> None:
        """Create a strategy.

        Args:
            settings: How the robot drives.
            board: Targets of all robots.
            number: Number of this one.
            fills: Whether floor that nobody has seen at short range is a target, too,
                once no frontier is left.
        """
        self._settings = settings
        self._board = board
        self._number = number
        self._fills = fills
        self._path_follower = PathFollower(settings)
        self._doing = "looking"
        self._gives_way = False
        self.is_done = False
        self._start: Pose2 | None = None
        self._radius: float | None = None  # None where walls enclose the area
        self._turn = FULL_TURN
        self._yaw = 0.0
        self._scans = 0

    @property
    def activity(self) -> str:
        """What the robot is doing."""
        return WAITING if self._gives_way else self._doing

    def step(self, observation: Observation, grid: OccupancyGrid) -> Twist:
        """Return the twist until the next scan."""
        self._scans += 1
        if self._start is None:
            self._start, self._yaw = observation.pose, observation.pose.yaw
            self._radius = None if is_enclosed(observation) else self._settings.radius
        self.is_done = self._board.is_over(observation.time)
        if self.is_done or self._scans < MIN_SCANS:
            return STOP
        if self._turn > 0:
            # all round first, so that beams cross the gaps between those of one scan
            self._turn -= abs(wrap_angle(observation.pose.yaw - self._yaw))
            self._yaw = observation.pose.yaw
            twist = Twist(0.0, self._settings.speed_limits.turn)
        else:
            robots = self._board.other_robots(self._number)
            if self._path_follower.update_map(observation, grid, robots):
                self._choose(observation, grid)
            twist = self._path_follower.step(observation)
        is_moving = self._board.may_move(self._number, wants_to=twist != STOP)
        self._gives_way = twist != STOP and not is_moving
        if self._gives_way:
            # Or it would give its target up while another robot passes.
            self._path_follower.pause(observation)
        return twist if is_moving else STOP

    def _choose(self, observation: Observation, grid: OccupancyGrid) -> None:
        """Find a target; tell the others, also that there is none."""
        floor, board, number = self._path_follower.floor, self._board, self._number
        assert floor is not None
        last = self._path_follower.end
        board.targets.pop(number, None)
        is_free = np.ones_like(floor.open)  # of targets of other robots nearby
        for point in board.other_targets(number):
            is_free &= ~floor.disc(*point, TARGET_DISTANCE)
        for targets, activity in self._targets(floor):
            near = prefer_near(floor, targets & is_free, last)
            if self._path_follower.plan(observation, near):
                self._doing = activity
                end = self._path_follower.end
                assert end is not None
                board.targets[number] = end
                board.searching.add(number)
                return
        self._doing = WAITING
        # It searches on if there would be a target were there no other robots.
        floor, find_path = (
            self._settings.traversability(grid),
            self._path_follower.find_path,
        )
        if any(
            find_path(floor, observation.pose, each) for each, _ in self._targets(floor)
        ):
            board.searching.add(number)
        else:
            board.searching.discard(number)

    def _targets(self, floor: TraversabilityMap) -> list[tuple[Mask, str]]:
        found = [(floor.frontiers, "frontier")]
        if self._fills:
            found.append((floor.unvisited, "filling"))
        if self._radius is None or self._start is None:
            return found
        disc = floor.disc(self._start.x, self._start.y, self._radius)
        return [(tiles & disc, name) for tiles, name in found]
