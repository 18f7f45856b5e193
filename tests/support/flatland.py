"""A flat world of line segments for navigators: exact scans, exact moves, no scene."""

import math
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import shapely
from flat_world import cast

from radarsim.autonomy.navigation.bumpers import Bumpers
from radarsim.autonomy.navigation.control import SpeedLimits, Twist
from radarsim.autonomy.navigation.controller import Controller, ControllerSettings
from radarsim.autonomy.navigation.mission import CONTROLLERS
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.plans import Algorithm, GiveUp, Mission
from radarsim.geometry import Floats, Point, Pose2

BEARINGS: Floats = np.radians(np.arange(-180.0, 180.0, 2.0))


def moved(pose: Pose2, twist: Twist, time: float = 0.1) -> Pose2:
    """Return the pose after a motion, whose chord has the heading of its middle."""
    middle, distance = pose.yaw + twist.turn * time / 2, twist.speed * time
    x = pose.x + distance * math.cos(middle)
    y = pose.y + distance * math.sin(middle)
    return Pose2(x, y, pose.yaw + twist.turn * time)


@dataclass
class Flatland:
    """Walls, and a robot that moves exactly as commanded.

    Attributes:
        walls: (S, 2, 2) m.
        pose: Of the robot.
        bearings: Of its beams, rad.
        track: Where it has been.
        nearest: The nearest that it ever was to a wall, m.
        pause: Time between two scans, s.
    """

    walls: Floats
    pose: Pose2
    bearings: Floats = field(default_factory=BEARINGS.copy)
    track: list[Pose2] = field(default_factory=list)
    nearest: float = math.inf
    pause: float = 0.1

    def __post_init__(self) -> None:
        self._lines = shapely.multilinestrings(self.walls)

    @property
    def length(self) -> float:
        """Length of the path so far, m."""
        ends = zip(self.track, self.track[1:], strict=False)
        return sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in ends)

    @property
    def time(self) -> float:
        """Time of the next scan, s."""
        return len(self.track) * self.pause

    def scan(self) -> Observation:
        """Return an exact scan from the robot's centre."""
        ranges = cast(self.walls, self.pose, self.bearings)
        return Observation(self.time, self.pose, self.bearings.copy(), ranges)

    def move(self, twist: Twist) -> None:
        """Move the robot for one step."""
        self.pose = moved(self.pose, twist, self.pause)
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


def flatland(*shapes: shapely.Polygon, at: Pose2) -> Flatland:
    """Return a world of polygons, with the robot at a pose."""
    sides = [outline(shape) for shape in shapes]
    return Flatland(np.concatenate([np.zeros((0, 2, 2)), *sides]), at)


def navigator(
    algorithm: Algorithm,
    *goals: Point,
    wall_on_left: bool = True,
    give_up: GiveUp = GiveUp.HIT_POINT,
    heading: float | None = None,
    **changed: Any,
) -> Controller:
    """Return a controller at speeds that an exact world allows, so that tests end."""
    values = {
        "bumpers": Bumpers(safety_distance=0.5),
        "speed_limits": SpeedLimits(0.6, 1.5),
        **changed,
    }
    side: Literal["left", "right"] = "left" if wall_on_left else "right"
    mission = Mission(
        algorithm=algorithm, goals=goals, heading=heading, side=side, give_up=give_up
    )
    return CONTROLLERS[algorithm](ControllerSettings(mission, **values))
