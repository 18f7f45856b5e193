"""Moving a footprint among obstacles and other robots without ever entering them.

Theory of operation
===================
A move that is free is made as it is. One that would enter something is pushed out again
along the shortest way, so that the robot slides; where that leads nowhere it turns on
the spot, and where that is blocked too it stays. A pose that is taken is always free,
so the way back out of a contact is open.

Rule 1: no point of the robot travels farther in a move than its ``sweep``. Whoever
knows the gap to the nearest wall need not look at walls again before the sweeps add up
to it; that makes the open floor cheap.
Rule 2: a move displaces the centre by at most ``MAX_DISPLACEMENT_RATIO`` sweeps, so the
same holds for the gap to the other robots, which move as well.
"""

import math
from typing import Protocol

import numpy as np

from radarsim.geometry import Floats, Pose2
from radarsim.robots.footprint import MARGIN, NO_SEGMENTS, Footprint
from radarsim.robots.obstacles import Body, Obstacles

CONTACT_GAP = 1e-3  # m that is left when something is run into
TOUCH_RANGE = 2e-3  # m; what is nearer than this touches
MAX_DISPLACEMENT_RATIO = 2.0

_REACH = 0.5  # m beyond the robot's circle within which walls are kept at hand
_MEETING = 0.1  # m between two robots' circles below which their outlines count
_PUSHES = 8  # most of them between two walls; more would not get out of a wedge


class MovingBody(Body, Protocol):
    """A robot among others."""

    @property
    def top_speed(self) -> float:
        """The farthest that its centre gets in a second, pushes included, m."""
        ...


class CollisionResolver:
    """Moves one robot; remembers how much room it has.

    Attributes:
        hindered: Whether the last move did not end where it was to end.
    """

    def __init__(self, robot: MovingBody, obstacles: Obstacles) -> None:
        self.blocked = False
        self._robot = robot
        self._footprint: Footprint = robot.footprint
        self._obstacles = obstacles
        self._walls = (
            NO_SEGMENTS  # all within reach of the place where they were asked for
        )
        self._asked_at = (math.inf, math.inf)
        self._room = 0.0  # m; no wall is nearer
        self._apart = 0.0  # m; no other robot is nearer
        self._others: tuple[MovingBody, ...] = ()
        self._closing = 0.0  # m/s; the fastest of the others
        self._refused: tuple[Pose2, Pose2] | None = None  # from where, where to

    def move(
        self,
        wanted: Pose2,
        others: tuple[MovingBody, ...],
        *,
        sweep: float,
        dt: float,
    ) -> Pose2:
        """Give the pose that the robot gets when it wants another.

        Args:
            wanted: The pose where its wheels would take it.
            others: All robots, in any order; the robot itself may be one of them. The
                same tuple at every move is the cheapest.
            sweep: The farthest that any point of the robot travels, m; at most a
                fraction of its width, or it could jump over things.
            dt: What the move takes, s.
        """
        self._room -= sweep
        self._apart -= sweep + self._closing * dt
        if self._apart > MARGIN and others is self._others:
            if self._room > MARGIN:
                self.blocked = False
                return wanted
            pose = self._robot.pose
            if (pose, wanted) == self._refused:  # it pushes on against the same wall
                self.blocked = True
                return pose
        return self._look(wanted, others, sweep)

    def rest(self, others: tuple[MovingBody, ...]) -> None:
        """Stand for one step while others move."""
        self._others = others
        self._apart = 0.0

    def touching(self) -> bool:
        """Tell whether something solid is as near as after a contact."""
        if min(self._room, self._apart) > TOUCH_RANGE:
            return False
        pose = self._robot.pose
        return self._measure(pose, self._around(pose, self._others)) <= TOUCH_RANGE

    def _look(
        self, wanted: Pose2, others: tuple[MovingBody, ...], sweep: float
    ) -> Pose2:
        """Move with a look at what is there."""
        self._others = others
        around = self._around(wanted, others)
        self.blocked = self._measure(wanted, around) <= MARGIN
        if not self.blocked:
            return wanted
        pose = self._robot.pose
        reached = self._hindered(wanted, around, sweep)
        if _is_same(reached, pose):
            reached = pose
            self._refused = (pose, wanted) if around is self._walls else None
        self._measure(reached, around)
        return reached

    def _measure(self, pose: Pose2, around: Floats) -> float:
        """Give the gap at a pose, and remember how much room it leaves."""
        gap = self._gap(pose, around)
        beyond = math.dist((pose.x, pose.y), self._asked_at)
        self._room = min(gap, _REACH - beyond)
        if around is not self._walls:  # it holds outlines of others too
            self._apart = min(gap, self._apart)
        return gap

    def _around(self, pose: Pose2, others: tuple[MovingBody, ...]) -> Floats:
        """Give the lines that matter near a pose; those left out set ``_apart``."""
        place = (pose.x, pose.y)
        if math.dist(place, self._asked_at) > _REACH / 2:
            self._asked_at = place
            self._walls = self._obstacles.near(*place, self._footprint.radius + _REACH)
        outlines = self._meet(pose, others)
        return np.concatenate([self._walls, *outlines]) if outlines else self._walls

    def _meet(self, pose: Pose2, others: tuple[MovingBody, ...]) -> list[Floats]:
        """Give the outlines of the others that are close."""
        self._apart, self._closing = math.inf, 0.0
        outlines = []
        for other in others:
            if other is self._robot:
                continue
            self._closing = max(self._closing, other.top_speed)
            place, footprint = other.pose, other.footprint
            apart = math.hypot(place.x - pose.x, place.y - pose.y)
            apart -= footprint.radius + self._footprint.radius
            if apart < _MEETING:
                outlines.append(footprint.outline(place))
            else:
                self._apart = min(self._apart, apart)
        return outlines

    def _hindered(self, wanted: Pose2, around: Floats, sweep: float) -> Pose2:
        """Choose where to go instead of a pose that is not free."""
        pose = self._robot.pose
        gap = self._gap(pose, around)
        keep = max(2 * MARGIN, min(CONTACT_GAP, gap))
        for aim in (wanted, Pose2(wanted.x, wanted.y, pose.yaw)):
            freed = self._pushed_out(aim, around, keep)
            moved = math.hypot(freed.x - pose.x, freed.y - pose.y) if freed else 0.0
            if freed is not None and moved <= MAX_DISPLACEMENT_RATIO * sweep:
                return freed
        turned = Pose2(pose.x, pose.y, wanted.yaw)
        if self._gap(turned, around) > MARGIN:
            return turned
        # a robot that was put into something may leave it
        return wanted if self._gap(wanted, around) > gap else pose

    def _pushed_out(self, pose: Pose2, around: Floats, keep: float) -> Pose2 | None:
        """Push a pose out of everything; None if that does not succeed."""
        for _ in range(_PUSHES):
            contact = self._footprint.contact(pose, around)
            if contact.gap > MARGIN:
                return pose
            push = keep - contact.gap
            x, y = pose.x + push * contact.away_x, pose.y + push * contact.away_y
            pose = Pose2(x, y, pose.yaw)
        return None

    def _gap(self, pose: Pose2, around: Floats) -> float:
        return self._footprint.contact(pose, around).gap


def _is_same(one: Pose2, other: Pose2) -> bool:
    """Tell whether two poses differ by no more than rounding."""
    apart = abs(one.x - other.x) + abs(one.y - other.y) + abs(one.yaw - other.yaw)
    return apart < 1e-9
