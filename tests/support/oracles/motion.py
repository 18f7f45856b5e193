"""One robot after the other in plain Python and NumPy, as the engine moves them.

The reference measures the gap to everything near at each move; it keeps nothing.
"""

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import shapely

from radarsim.geometry import Floats, Pose2, wrap_angle
from radarsim.presets.robots import RobotModel
from radarsim.robots.footprint import MARGIN, Footprint
from radarsim.robots.obstacles import Obstacles

CONTACT_GAP = 1e-3  # m left between the robot and what it runs into
TOUCH_RANGE = 2e-3  # m; anything closer touches the robot
MAX_DISPLACEMENT_RATIO = 2.0

_MAX_SWEEP = 0.05
_WALL_RANGE = 0.5  # m beyond the robot's circle
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
    odometry: Pose2 = field(default_factory=lambda: Pose2(0.0, 0.0))
    blocked: bool = False  # whether the last move did not end at the wanted pose

    def __post_init__(self) -> None:
        self.footprint = Footprint(self.model.length, self.model.width)
        self.others: tuple[ReferenceRobot, ...] = ()

    @property
    def touched(self) -> bool:
        return self.blocked or self._gap(self.pose, self._lines()) <= TOUCH_RANGE

    def step(self, dt: float, others: "tuple[ReferenceRobot, ...]") -> None:
        self.others = tuple(other for other in others if other is not self)
        left, right = self.spins
        if not left and not right:
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
            lines = self._lines(wanted)
            self.blocked = self._gap(wanted, lines) <= MARGIN
            reached = self._avoid(wanted, lines, sweep / parts)
            if not (self.blocked and _is_same(reached, self.pose)):
                self.pose = reached

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

    def _lines(self, pose: Pose2 | None = None) -> Floats:
        """Return the walls near a pose, and the outlines of the other robots there."""
        pose = pose or self.pose
        reach = self.footprint.radius + _WALL_RANGE
        walls = self.obstacles.segments
        away = shapely.distance(
            shapely.linestrings(walls), shapely.Point(pose.x, pose.y)
        )
        lines = [walls[away <= reach]]
        for other in self.others:
            gap = math.hypot(other.pose.x - pose.x, other.pose.y - pose.y)
            if gap - other.footprint.radius - self.footprint.radius < _OUTLINE_RANGE:
                lines.append(outline(other.footprint, other.pose))
        return np.concatenate(lines)

    def _avoid(self, wanted: Pose2, lines: Floats, sweep: float) -> Pose2:
        """Return the pose to take instead of a wanted pose if that is not free."""
        if not self.blocked:
            return wanted
        pose = self.pose
        gap = self._gap(pose, lines)
        # A robot nearer than ``CONTACT_GAP`` slides on; it is not pushed back first.
        clearance = max(2 * MARGIN, min(CONTACT_GAP, gap))
        # Without the turn second: near a wall it may be the turn that is blocked.
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
            contact = find_contact(self.footprint, pose, lines)
            if contact.gap > MARGIN:
                return pose
            push = clearance - contact.gap
            x, y = pose.x + push * contact.away_x, pose.y + push * contact.away_y
            pose = Pose2(x, y, pose.yaw)
        return None

    def _gap(self, pose: Pose2, lines: Floats) -> float:
        return find_contact(self.footprint, pose, lines).gap


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


def _is_same(one: Pose2, other: Pose2) -> bool:
    """Return whether two poses differ by no more than rounding."""
    difference = abs(one.x - other.x) + abs(one.y - other.y) + abs(one.yaw - other.yaw)
    return difference < 1e-9
