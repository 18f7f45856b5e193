"""Sensors for a robot's true pose, contacts, altitude, heading and acceleration."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from radarsim.engine import engine
from radarsim.protocol import reports
from radarsim.protocol.fields import SensorReport
from radarsim.sensors.readings import Job
from radarsim.sensors.sensor import EngineSensor, Mounting, Reading


class GroundTruthSensor(EngineSensor, types=["GroundTruth"]):
    """Reads the true pose of the robot's body."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        sample = reports.GroundTruth(0.0, self.item.name, self.robot.body)
        self._report(sample, pose=[Job(Reading.BODY_POSE)])


class TouchSensor(EngineSensor, types=["Touch"]):
    """Reads whether an obstacle touches the robot."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        sample = reports.Touch(0.0, self.item.name, touched=False)
        self._report(sample, touched=[Job(Reading.TOUCHED)])


class AltitudeSensor(EngineSensor, types=["AltitudeSensor"]):
    """Reads the height of the robot above its start pose, and above sea level."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        (place,) = self._remember(np.array([self.robot.body.z]))
        sample = reports.Altitude(0.0, self.item.name, 0.0, 0.0)
        # One job writes both altitudes, so only the first attribute lists the job.
        jobs = [Job(Reading.ALTITUDES, place)]
        self._report(sample, above_start=jobs, above_sea=())


class Compass(EngineSensor, types=["MagneticCompass"]):
    """Reads the heading of the robot."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        sample = reports.Compass(0.0, self.item.name, 0.0)
        self._report(sample, heading=[Job(Reading.HEADING)])


class MissionClock(EngineSensor, types=["MissionTime"]):
    """Counts the minutes since the robot was spawned."""

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        start = np.array([round(100 * mounting.time)], np.float64)
        jobs = [Job(Reading.MINUTES, place) for place in self._remember(start)]
        self._report(reports.MissionTime(0.0, self.item.name, 0), minutes=jobs)


class Accelerometer(EngineSensor, types=["Accel"]):
    """Reads the rate of change of velocity along the sensor's axes.

    Attributes:
        reading: The reading that the engine computes.
        report: The type of the report.
        others: Attributes of the report in addition to the acceleration.
    """

    reading: ClassVar[int] = Reading.ACCELERATION
    report: ClassVar[type[SensorReport]] = reports.Acceleration
    others: ClassVar[Sequence[str]] = ()

    def __init__(self, mounting: Mounting) -> None:
        super().__init__(mounting)
        start = np.zeros(1, engine.rows["Accelerometer"])
        start["axes"] = self.item.mount.rotation().T.ravel()
        start["read_at"] = mounting.time
        start["attitude"] = 0.0, 0.0, self.robot.pose.yaw
        jobs = [Job(self.reading, place) for place in self._remember(start)]
        vectors = dict.fromkeys(("acceleration", *self.others), (0.0, 0.0, 0.0))
        sample = self.report(0.0, name=self.item.name, **vectors)  # type: ignore[call-arg]
        # One job writes all readings, so only the first attribute lists the job.
        self._report(sample, acceleration=jobs, **dict.fromkeys(self.others, ()))


class ProperAccelerometer(Accelerometer, types=["AcceleroMeter"]):
    """Reads the proper acceleration, which includes gravity even at rest."""

    reading = Reading.PROPER_ACCELERATION
    report = reports.ProperAcceleration


class InertialUnit(Accelerometer, types=["IMU"]):
    """An inertial measurement unit: reads acceleration, angles and angular rates."""

    reading = Reading.INERTIA
    report = reports.Imu
    others = ("rates", "rate_changes", "angles")
