"""What a simulation notes for its pictures: where robots were, and what they saw."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Pose2

if TYPE_CHECKING:
    from collections.abc import Iterable

    from radarsim.local.robot import LocalRobot
    from radarsim.presets.robots import RobotModel
    from radarsim.simulation.simulation import Simulation

NOTED_TICKS: Final = 10  # between two moments
MOST_MOMENTS: Final = 20_000  # beyond, every second one is forgotten


class SeenPoints(NamedTuple):
    """Where beams of one scanner ended: (N, 2) m, map frame, and by which medium."""

    medium: str
    points: NDArray[np.float32]


class Moment(NamedTuple):
    """A moment of a simulation.

    Attributes:
        time: s.
        robots: Class and true pose of each robot, by name.
        seen: The newest scan of each scanner of the program's own robots.
    """

    time: float
    robots: dict[str, tuple[RobotModel, Pose2]]
    seen: list[SeenPoints]

    @classmethod
    def of(cls, simulation: Simulation, own: Iterable[LocalRobot]) -> Moment:
        """Note a simulation as it is."""
        return cls(
            simulation.time,
            {v.robot.name: (v.model, v.robot.pose) for v in simulation.vehicles},
            [
                SeenPoints(scan.medium, scan.points("map").astype(np.float32))
                for robot in own
                for scan in robot.scans
            ],
        )


class History:
    """The moments of a simulation so far, ten in a second of the first half hour."""

    def __init__(self) -> None:
        self.moments: list[Moment] = []
        self._interval = NOTED_TICKS

    def add(self, simulation: Simulation, own: Iterable[LocalRobot]) -> None:
        """Note a simulation as it is, if it is time; to be called in every tick."""
        if simulation.ticks % self._interval:
            return
        self.moments.append(Moment.of(simulation, own))
        if len(self.moments) > MOST_MOMENTS:
            self.moments = self.moments[1::2]  # ticks of twice the interval
            self._interval *= 2
