"""A flat world of line segments for navigators: exact scans, exact moves, no scene."""

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import pytest
import shapely
from flat_world import ranges_of

from radarsim.autonomy.navigation.control import Twist
from radarsim.autonomy.navigation.controller import Controller
from radarsim.autonomy.navigation.observation import Observation
from radarsim.geometry import Floats, Pose2

BEARINGS: Floats = np.radians(np.arange(-180.0, 180.0, 2.0))
STEP = 0.1  # s between two scans
CLEARANCE = 0.371  # m; half the diagonal of a P3AT


@dataclass
class Flatland:
    """Walls, and a robot that moves exactly as commanded.

    Attributes:
        walls: (S, 2, 2) m.
        pose: Of the robot.
        bearings: Of its beams, rad.
        track: Where it has been.
        nearest: The nearest that it ever was to a wall, m.
    """

    walls: Floats
    pose: Pose2
    bearings: Floats = field(default_factory=BEARINGS.copy)
    track: list[Pose2] = field(default_factory=list)
    nearest: float = math.inf

    def __post_init__(self) -> None:
        self._lines = shapely.multilinestrings(self.walls)

    @property
    def length(self) -> float:
        """Length of the path so far, m."""
        ends = zip(self.track, self.track[1:], strict=False)
        return sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in ends)

    def scan(self) -> Observation:
        """Return an exact scan from the robot's centre."""
        nearest = ranges_of(self.walls, self.pose, self.bearings, math.inf)
        time = len(self.track) * STEP
        return Observation(time, self.pose, self.bearings.copy(), nearest)

    def move(self, twist: Twist) -> None:
        """Move the robot for one step."""
        pose, middle = self.pose, self.pose.yaw + twist.turn * STEP / 2
        distance = twist.speed * STEP
        self.pose = Pose2(
            pose.x + distance * math.cos(middle),
            pose.y + distance * math.sin(middle),
            pose.yaw + twist.turn * STEP,
        )
        self.track.append(self.pose)
        place = shapely.Point(self.pose.x, self.pose.y)
        self.nearest = min(self.nearest, float(self._lines.distance(place)))

    def run(self, bug: Controller, *, steps: int = 20_000) -> None:
        """Run a bug until it is done."""
        for _ in range(steps):
            self.move(bug.step(self.scan()))
            if bug.is_done:
                return
        raise AssertionError(f"{bug.activity} after {steps} steps at {self.pose}")


def outline(shape: shapely.Polygon) -> Floats:
    """Return the sides of a polygon and of its holes as segments, (S, 2, 2) m."""
    rings = [shape.exterior, *shape.interiors]
    points = [np.array(ring.coords) for ring in rings]
    return np.concatenate([np.stack([p[:-1], p[1:]], axis=1) for p in points])


class World(Protocol):
    """Makes a flat world of polygons, with the robot at a pose."""

    def __call__(self, *shapes: shapely.Polygon, at: Pose2) -> Flatland: ...


@pytest.fixture
def flatland() -> World:
    """Create a world of polygons, with the robot at a pose."""

    def make(*shapes: shapely.Polygon, at: Pose2) -> Flatland:
        sides = [outline(shape) for shape in shapes]
        walls = np.concatenate([np.full((0, 2, 2), 0.0), *sides])
        return Flatland(walls, at)

    return make
