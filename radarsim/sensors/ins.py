"""Inertial navigation systems; ``readings.hpp`` explains and computes their drift."""

from typing import Annotated, ClassVar, Final

import numpy as np
from pydantic import BaseModel, Field

from radarsim.engine import engine
from radarsim.geometry import Pose3
from radarsim.protocol import reports
from radarsim.sensors.readings import Job
from radarsim.sensors.sensor import EngineSensor, Mounting, Reading

INS_DRIFT_INTERVAL: Final = 0.2  # s of simulated time between two updates of the drift

# An error as a fraction of the motion; with larger fractions, the estimated pose would
# overflow over time.
_Share = Annotated[float, Field(ge=0, le=10, strict=True)]


class InsSettings(BaseModel, extra="forbid", frozen=True):
    """Drift of an inertial navigation system; if all values are 0, it does not drift.

    Attributes:
        sigma: Standard deviation of the error of a motion, as a fraction of the motion.
        position_bias: Largest mean of the relative error on each axis; the mean is
            drawn once per run.
        angle_bias: Largest mean of the relative error of each angle; the mean is
            drawn once per run.
    """

    sigma: _Share = 0.05
    position_bias: _Share = 0.5e-3
    angle_bias: _Share = 0.5e-6


class Ins(EngineSensor, types=["INS"]):
    """Reads an estimated pose, which drifts away from the true pose.

    Attributes:
        drift: The job that updates the drift, due every ``INS_DRIFT_INTERVAL``.
    """

    settings: ClassVar[type[BaseModel]] = InsSettings

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        noise = mounting.settings
        start = np.zeros(1, engine.rows["Ins"])
        largest = np.repeat([noise.position_bias, noise.angle_bias], 3)
        bias = self._rng.uniform(-1.0, 1.0, 6) * largest
        start["sigma"] = noise.sigma
        start["used"] = np.inf
        (place,) = self._remember(start)
        self.overwrite(self.pose)
        self._memory["bias"] = bias
        self.draw()
        sample = reports.Ins(0.0, self.item.name, self.robot.body)
        self._report(sample, pose=[Job(Reading.INS_POSE, place)])
        self.drift = Job(Reading.DRIFT, place)

    def draw(self) -> None:
        """Draw random numbers for later updates if all previous numbers are used up."""
        ins = self._memory
        draws = ins["draws"]
        if ins["used"] >= draws.size // 6:
            self._rng.standard_normal(out=draws)
            ins["used"] = 0.0

    def overwrite(self, pose: Pose3) -> None:
        """Replace the estimated pose by a given pose, and set the bias to 0."""
        ins, body = self._memory, self.robot.body.numbers()
        ins["estimate"], ins["bias"], ins["body"] = pose.numbers(), 0.0, body
