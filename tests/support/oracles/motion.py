"""One robot after the other in plain Python and NumPy, as the engine moves them."""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import shapely

from radarsim.geometry import Floats, Pose2, wrap_angle
from radarsim.presets.robots import RobotModel
from radarsim.robots.footprint import MARGIN, NO_SEGMENTS, Footprint
from radarsim.robots.obstacles import Obstacles

CONTACT_GAP = 1e-3  # m left between the robot and what it runs into
TOUCH_RANGE = 2e-3  # m; anything closer touches the robot
MAX_DISPLACEMENT_RATIO = 2.0

_MAX_SWEEP = 0.05
_CACHE_RANGE = 0.5  # m beyond the robot's circle within which walls are cached
_OUTLINE_RANGE = 0.1  # m between two robots' circles below which their outlines matter
_MAX_PUSHES = 8  # out of two walls in turn; more would not get out of a wedge


@dataclass
class ReferenceRobot:
    """A robot that is moved by the reference."""

    model: RobotModel
    pose: Pose2
    obstacles: Obstacles
    spins: tuple[float, float] = (0.0, 0.0)  # rad/s
    angles: tuple[float, float] = (0.0, 0.0)  # rad
    top_speed: float = 0.0
    odometry: Pose2 = field(default_factory=lambda: Pose2(0.0, 0.0))
    footprint: Footprint = field(init=False)
    resolver: "CollisionResolver" = field(init=False)

    def __post_init__(self) -> None:
        self.footprint = Footprint(self.model.length, self.model.width)
        self.resolver = CollisionResolver(self, self.obstacles)

    @property
    def touched(self) -> bool:
        return self.resolver.blocked or self.resolver.touching()

    def step(self, dt: float, others: "tuple[ReferenceRobot, ...]") -> None:
        left, right = self.spins
        if not left and not right:
            self.resolver.rest(others)
            return
        before = self.angles
        self.angles = (before[0] + left * dt, before[1] + right * dt)
        self._integrate(self.angles[0] - before[0], self.angles[1] - before[1])
        left, right = left * self.model.wheel_radius, right * self.model.wheel_radius
        turn = abs(right - left) / self.model.track
        sweep = (abs(left + right) / 2 + turn * self.footprint.radius) * dt
        parts = max(1, math.ceil(sweep / _MAX_SWEEP))
        for _ in range(parts):
            wanted = advance(
                self.pose, left, right, track=self.model.track, dt=dt / parts
            )
            self.pose = self.resolver.move(
                wanted, others, sweep=sweep / parts, dt=dt / parts
            )

    def _integrate(self, left: float, right: float) -> None:
        left *= self.model.wheel_radius
        right *= self.model.wheel_radius
        turn = (right - left) / self.model.wheel_separation
        half = turn / 2
        chord = (left + right) / 2
        chord *= math.sin(half) / half if half else 1
        heading = self.odometry.yaw + half
        self.odometry = Pose2(
            self.odometry.x + chord * math.cos(heading),
            self.odometry.y + chord * math.sin(heading),
            self.odometry.yaw + turn,
        )


def advance(
    pose: Pose2, left: float, right: float, *, track: float, dt: float
) -> Pose2:
    turn = (right - left) / track * dt
    half = turn / 2
    chord = (left + right) / 2 * dt * (math.sin(half) / half if half else 1.0)
    return Pose2(
        pose.x + chord * math.cos(pose.yaw + half),
        pose.y + chord * math.sin(pose.yaw + half),
        wrap_angle(pose.yaw + turn),
    )


class Contact(NamedTuple):
    gap: float
    away_x: float = 0.0
    away_y: float = 0.0


def find_contact(footprint: Footprint, pose: Pose2, segments: Floats) -> Contact:
    if not len(segments):
        return Contact(math.inf)
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    middle = _to_local((segments[:, 0] + segments[:, 1]) / 2 - (pose.x, pose.y), c, s)
    half = _to_local((segments[:, 1] - segments[:, 0]) / 2, c, s)
    gaps = _gaps(footprint, middle, half)
    nearest = int(gaps.max(axis=0).argmin())
    axis = int(gaps[:, nearest].argmax())
    x, y = _axis(axis, half[nearest])
    toward = x * middle[nearest, 0] + y * middle[nearest, 1]
    x, y = (-x, -y) if toward > 0 else (x, y)
    return Contact(float(gaps[axis, nearest]), c * x - s * y, s * x + c * y)


def _to_local(points: Floats, c: float, s: float) -> Floats:
    # not a matrix product: how BLAS rounds differs from machine to machine
    x, y = points.T
    return np.stack([x * c + y * s, y * c - x * s], axis=1)


def _gaps(footprint: Footprint, middle: Floats, half: Floats) -> Floats:
    x, y = footprint.length / 2, footprint.width / 2
    extent = np.abs(half)
    along = np.abs(middle) - extent - (x, y)
    across = np.abs(middle[:, 0] * half[:, 1] - middle[:, 1] * half[:, 0])
    across -= x * extent[:, 1] + y * extent[:, 0]
    across /= np.hypot(half[:, 0], half[:, 1])
    return np.stack([along[:, 0], along[:, 1], across])


def _axis(axis: int, half: Floats) -> tuple[float, float]:
    if axis < 2:
        return (1.0, 0.0) if axis == 0 else (0.0, 1.0)
    length = math.hypot(half[0], half[1])
    return float(half[1]) / length, -float(half[0]) / length


def outline(footprint: Footprint, pose: Pose2) -> Floats:
    c, s = math.cos(pose.yaw), math.sin(pose.yaw)
    x, y = footprint.length / 2, footprint.width / 2
    corners = np.array([[x, y], [-x, y], [-x, -y], [x, -y]])
    corners = _to_local(corners, c, -s) + np.array([pose.x, pose.y])
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


class CollisionResolver:
    """Moves one robot; keeps lower bounds of its clearance between moves.

    Attributes:
        blocked: Whether the last move did not end at the wanted pose.
    """

    def __init__(self, robot: ReferenceRobot, obstacles: Obstacles) -> None:
        self.blocked = False
        self._robot = robot
        self._footprint: Footprint = robot.footprint
        self._obstacles = obstacles
        self._walls = NO_SEGMENTS  # those near ``_cache_centre``
        self._cache_centre = (math.inf, math.inf)
        self._wall_gap = 0.0  # m; no wall is closer
        self._robot_gap = 0.0  # m; no other robot is closer
        self._others: tuple[ReferenceRobot, ...] = ()
        self._closing_speed = 0.0  # m/s; top speed of the fastest of the others
        self._rejected: tuple[Pose2, Pose2] | None = None  # start and wanted pose

    def move(
        self,
        wanted: Pose2,
        others: tuple[ReferenceRobot, ...],
        *,
        sweep: float,
        dt: float,
    ) -> Pose2:
        """Return the pose that the robot reaches when it moves towards another.

        Args:
            wanted: Pose to which its wheels would take it.
            others: All robots, in any order; the robot itself may be one of them. It is
                fastest to pass the same tuple at every move.
            sweep: Largest distance that any point of the robot travels, m; at most a
                fraction of its width, or it could pass through obstacles.
            dt: Duration of the move, s.
        """
        self._wall_gap -= sweep
        self._robot_gap -= sweep + self._closing_speed * dt
        if self._robot_gap > MARGIN and others is self._others:
            # Nothing can be in reach yet (rules 1 and 2).
            if self._wall_gap > MARGIN:
                self.blocked = False
                return wanted
            pose = self._robot.pose
            if (pose, wanted) == self._rejected:  # still pushing against the same wall
                self.blocked = True
                return pose
        return self._move_checked(wanted, others, sweep)

    def rest(self, others: tuple[ReferenceRobot, ...]) -> None:
        """Stand still for one step while others move."""
        self._others = others
        # Others may approach meanwhile: the next move measures the gap to them anew.
        self._robot_gap = 0.0

    def touching(self) -> bool:
        """Return whether something solid is as close as after a contact."""
        if min(self._wall_gap, self._robot_gap) > TOUCH_RANGE:
            return False
        pose = self._robot.pose
        return self._measure(pose, self._lines_near(pose, self._others)) <= TOUCH_RANGE

    def _move_checked(
        self, wanted: Pose2, others: tuple[ReferenceRobot, ...], sweep: float
    ) -> Pose2:
        """Move with a check of all obstacles."""
        self._others = others
        lines = self._lines_near(wanted, others)
        self.blocked = self._measure(wanted, lines) <= MARGIN
        if not self.blocked:
            return wanted
        pose = self._robot.pose
        reached = self._avoid(wanted, lines, sweep)
        if _is_same(reached, pose):
            reached = pose
            # Walls stay; a robot in the way may be gone at the next move.
            self._rejected = (pose, wanted) if lines is self._walls else None
        self._measure(reached, lines)
        return reached

    def _measure(self, pose: Pose2, lines: Floats) -> float:
        """Return the gap at a pose, and update the known gaps."""
        gap = self._gap(pose, lines)
        offset = math.dist((pose.x, pose.y), self._cache_centre)
        # Walls that are not in the cache are at least this far away.
        self._wall_gap = min(gap, _CACHE_RANGE - offset)
        if lines is not self._walls:  # the lines include outlines of others
            self._robot_gap = min(gap, self._robot_gap)
        return gap

    def _lines_near(self, pose: Pose2, others: tuple[ReferenceRobot, ...]) -> Floats:
        """Return the lines near a pose; robots farther away set ``_robot_gap``."""
        position = (pose.x, pose.y)
        if math.dist(position, self._cache_centre) > _CACHE_RANGE / 2:
            self._cache_centre = position
            reach, walls = (
                self._footprint.radius + _CACHE_RANGE,
                self._obstacles.segments,
            )
            lines = shapely.linestrings(walls)
            near = shapely.distance(lines, shapely.Point(position)) <= reach
            self._walls = walls[near]
        outlines = self._outlines_near(pose, others)
        return np.concatenate([self._walls, *outlines]) if outlines else self._walls

    def _outlines_near(
        self, pose: Pose2, others: tuple[ReferenceRobot, ...]
    ) -> list[Floats]:
        """Return the outlines of the other robots that are close."""
        self._robot_gap, self._closing_speed = math.inf, 0.0
        outlines = []
        for other in others:
            if other is self._robot:
                continue
            self._closing_speed = max(self._closing_speed, other.top_speed)
            footprint = other.footprint
            gap = math.hypot(other.pose.x - pose.x, other.pose.y - pose.y)
            gap -= footprint.radius + self._footprint.radius
            if gap < _OUTLINE_RANGE:
                outlines.append(outline(footprint, other.pose))
            else:
                self._robot_gap = min(self._robot_gap, gap)
        return outlines

    def _avoid(self, wanted: Pose2, lines: Floats, sweep: float) -> Pose2:
        """Return the pose to take instead of a wanted pose that is not free."""
        pose = self._robot.pose
        gap = self._gap(pose, lines)
        # A robot nearer than ``CONTACT_GAP`` slides on; it is not pushed back first.
        clearance = max(2 * MARGIN, min(CONTACT_GAP, gap))
        # Without the turn second: beside a wall it may be the turn that is blocked.
        for target in (wanted, Pose2(wanted.x, wanted.y, pose.yaw)):
            freed = self._push_out(target, lines, clearance)
            moved = math.hypot(freed.x - pose.x, freed.y - pose.y) if freed else 0.0
            if freed is not None and moved <= MAX_DISPLACEMENT_RATIO * sweep:
                return freed
        turned = Pose2(pose.x, pose.y, wanted.yaw)
        if self._gap(turned, lines) > MARGIN:
            return turned
        # A robot that was placed inside an obstacle may leave it.
        return wanted if self._gap(wanted, lines) > gap else pose

    def _push_out(self, pose: Pose2, lines: Floats, clearance: float) -> Pose2 | None:
        """Push a pose out of all obstacles; return None if that fails."""
        for _ in range(_MAX_PUSHES):
            contact = find_contact(self._footprint, pose, lines)
            if contact.gap > MARGIN:
                return pose
            push = clearance - contact.gap
            x, y = pose.x + push * contact.away_x, pose.y + push * contact.away_y
            pose = Pose2(x, y, pose.yaw)
        return None

    def _gap(self, pose: Pose2, lines: Floats) -> float:
        return find_contact(self._footprint, pose, lines).gap


def _is_same(one: Pose2, other: Pose2) -> bool:
    """Return whether two poses differ by no more than rounding."""
    difference = abs(one.x - other.x) + abs(one.y - other.y) + abs(one.yaw - other.yaw)
    return difference < 1e-9
