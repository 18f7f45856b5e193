"""Trails: marks that robots leave on the floor at the request of their clients.

Only camera pictures show trails; other sensors do not see them.
"""

from collections import deque
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from radarsim.geometry import Floats
from radarsim.robots.robot import Robot
from radarsim.simulation.clock import Clock

MOST_MARKS: Final = 200  # per robot; the oldest marks are removed
LIFT: Final = 0.02  # m; height of a mark above the floor

Colour: TypeAlias = tuple[float, float, float]  # red, green and blue, 0 to 1


@dataclass(slots=True)
class _Trail:
    """The trail of a robot: a mark every ``interval`` ticks, from ``start`` on."""

    robot: Robot
    start: int
    interval: int
    colour: Colour
    marks: deque[tuple[float, ...]]


class Trails:
    """The trails of all robots of a simulation."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._trails: dict[int, _Trail] = {}

    def begin(self, robot: Robot, interval: int, colour: Colour) -> None:
        """Start to leave marks for a robot; its earlier marks stay.

        Args:
            robot: The robot.
            interval: Ticks between two marks, at least one.
            colour: Colour of the marks.
        """
        known = self._trails.get(robot.number)
        marks = known.marks if known else deque(maxlen=MOST_MARKS)
        trail = _Trail(robot, self._clock.ticks, interval, colour, marks)
        self._trails[robot.number] = trail

    def end(self, robot: Robot) -> None:
        """Remove a robot's trail with all its marks, if there is one."""
        self._trails.pop(robot.number, None)

    def step(self) -> None:
        """Add the marks of all trails that are due in this tick."""
        for trail in self._trails.values():
            if (self._clock.ticks - trail.start) % trail.interval == 0:
                pose = trail.robot.pose
                z = float(trail.robot.row["bottom"]) + LIFT
                trail.marks.append((pose.x, pose.y, z, *trail.colour))

    @property
    def marks(self) -> Floats:
        """All marks, (M, 6): x, y, z, m, map frame; red, green, blue from 0 to 1."""
        marks = [mark for trail in self._trails.values() for mark in trail.marks]
        return np.array(marks, np.float64).reshape(-1, 6)
