"""Scanners: radar and lasers, alike but for their settings.

A scan is taken in three steps, so that many scans can share one cast: ``plan`` draws
and points the rays, a ``Tracer`` casts them, ``read`` makes readings of what came of
them. ``scan`` does all three for one sensor.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Pose3
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.presets.sensors import load_settings
from radarsim.raycast.attenuation import Outcome
from radarsim.raycast.rays import LASER, RADAR, Rays, Traces
from radarsim.raycast.robot_boxes import Boxes
from radarsim.raycast.tracer import Tracer, tracer_of
from radarsim.scene.scene import Scene
from radarsim.sensors.beams import BeamPattern, SampledRays, Sides, ray_class_of
from radarsim.sensors.measurement import PlannedScan, ScanBuilder
from radarsim.sensors.scan import Scan

NONE: Final = np.zeros(0)
NO_RAIN: Final = np.zeros((2, 0))
SENSOR_HEIGHT = 0.346  # m above the floor, of the scanner on a P3AT


class RangeScanner:
    """A radar or a laser.

    Attributes:
        name: Of its preset.
        settings: All its numbers.
        angles: Of its beams, (N,) rad, counter-clockwise from the right.
    """

    def __init__(self, name: str, settings: SensorSettings) -> None:
        self.name = name
        self.settings = settings
        self._pattern = BeamPattern(settings)
        self.angles = self._pattern.angles
        self._medium = RADAR if settings.medium == "radar" else LASER
        self._reader = ScanBuilder(name, settings, self._pattern)
        nowhere = np.zeros((len(self.angles) * self._pattern.rays, 3))
        self._alike = Rays.uniform(
            nowhere,
            nowhere,
            max_range=settings.max_range,
            power=settings.penetration_power,
        )
        self._kinds = (ray_class_of(settings),)

    @property
    def has_side_rays(self) -> bool:
        """Whether the sensor has more rays than one to a beam."""
        return self.settings.has_side_rays

    @cached_property
    def with_all_echoes(self) -> "RangeScanner":
        """The same scanner, with all echoes where it keeps the last ones alone.

        It draws and reads the same. A radar that keeps the first or the strongest
        echoes knows no others.
        """
        if self.settings.return_mode != "last":
            return self
        together = self.settings.combines_rays
        update = {
            "return_mode": "all",
            "ray_choice": "together" if together else "drawn",
        }
        return RangeScanner(self.name, self.settings.model_copy(update=update))

    def scan(
        self,
        scene: Scene,
        pose: Pose3 | Sequence[float],
        rng: np.random.Generator | None = None,
    ) -> Scan:
        """Scan a scene.

        Args:
            scene: From ``load_map``.
            pose: Of the sensor in the map frame, m and rad: x, y, z, roll, pitch, yaw,
                or x, y, yaw, which puts it 0.346 m above the floor.
            rng: What draws rays and noise; a sensor without either needs none.

        Raises:
            ValueError: If the pose is neither, or there is no rng to draw from.
        """
        tracer = tracer_of(scene)
        plan = self.plan(tracer, sensor_pose(scene, pose), rng)
        traces = tracer.trace(plan.rays, events=plan.events, incidence=plan.incidence)
        return self.read(plan, traces)

    def plan(
        self,
        tracer: Tracer,
        pose: Pose3,
        rng: np.random.Generator | None,
        boxes: Boxes | None = None,
        carrier_id: int = -1,
    ) -> PlannedScan:
        """Draw the rays of one scan and point them.

        What is drawn depends on nothing in the scene but whether it rains there, so
        that nothing that drives around in it changes what is drawn next.

        Args:
            tracer: Of the scene; tells which side rays start behind something opaque,
                so that the centre ray serves.
            pose: Of the sensor, map frame.
            rng: What draws.
            boxes: Of the robots.
            carrier_id: The number of the box that carries the sensor; -1 for none.

        Raises:
            ValueError: If there is no rng to draw from.
        """
        reader = self._reader
        rains = tracer.has_rain and self._medium == RADAR
        draws = self._pattern.draws or reader.chooses or reader.noisy or rains
        if draws and not isinstance(rng, np.random.Generator):
            raise ValueError(f"no rng, expected a Generator for sensor {self.name!r}")
        drawn = self._pattern.draw(rng)
        chance, error, rain = NONE, NONE, NO_RAIN
        if rng is not None and reader.chooses:
            chance = rng.random(len(self.angles))
        if rng is not None and reader.noisy:
            error = rng.standard_normal(len(self.angles))
        if rng is not None and rains:
            rain = rng.standard_exponential((2, len(self.angles)))
        place, width = pose.position(), self._pattern.width
        if width and not tracer.is_clear(place, width, self._medium, boxes, carrier_id):
            hidden = self._hidden(tracer, pose, drawn, boxes, carrier_id)
            drawn = self._pattern.centred(drawn, hidden)
        rays = self._rays(pose, drawn, carrier_id)
        return PlannedScan(
            tracer,
            pose,
            drawn.sides,
            rays,
            chance,
            error,
            rain,
            reader.needs_events or rains,
            reader.needs_incidence,
        )

    def aim_one_ray(self, pose: Pose3, side: int) -> tuple[Sides, Rays]:
        """Point one ray of each beam, whatever it starts behind.

        Args:
            pose: Of the sensor, map frame.
            side: -1 for the right one of three, 0 for the centre, 1 for the left one.

        Raises:
            ValueError: If the beams have not three rays.
        """
        drawn = self._pattern.only(side)
        return drawn.sides, self._rays(pose, drawn, -1)

    def read(self, plan: PlannedScan, traces: Traces) -> Scan:
        """Make a scan of what came of its rays.

        Args:
            plan: Of this scanner.
            traces: Of its rays, with events and incidence where the plan says so.
        """
        return self._reader.read(plan, traces)

    def _rays(self, pose: Pose3, drawn: SampledRays, carrier_id: int) -> Rays:
        fan = self._pattern.aim(pose, drawn)
        same, n = self._alike, len(drawn.nodes)
        if n < len(same.max_range):
            same = same.take(np.arange(n))
        carrier_ids = same.carrier_id if carrier_id < 0 else np.full(n, carrier_id)
        return Rays(
            fan.origins,
            fan.directions,
            same.max_range,
            same.power,
            same.class_index,
            carrier_ids,
            self._kinds,
        )

    def _hidden(
        self,
        tracer: Tracer,
        pose: Pose3,
        drawn: SampledRays,
        boxes: Boxes | None,
        carrier_id: int,
    ) -> NDArray[np.int64]:
        """Find the side rays that start behind something opaque."""
        starts = self._pattern.aim(pose, drawn).origins
        way = starts - pose.position()
        length = np.linalg.norm(way, axis=1)
        moved = np.flatnonzero(length > 0)
        rays = Rays.uniform(
            np.broadcast_to(pose.position(), (len(moved), 3)),
            way[moved] / length[moved, None],
            max_range=0.0,
            medium=self._medium,
            carrier_id=carrier_id,
        )
        traces = tracer.trace(replace(rays, max_range=length[moved]), boxes)
        met = traces.outcomes != Outcome.NOTHING  # also what absorbs
        hidden: NDArray[np.int64] = moved[met]
        return hidden


def load_sensor(name: str, /, **settings: Any) -> RangeScanner:
    """Make a scanner from a preset, with some of its settings changed.

    Raises:
        PresetError: If there is no such preset or setting, or a value does not fit.
    """
    return RangeScanner(name, load_settings(name, **settings))


def sensor_pose(scene: Scene, pose: Pose3 | Sequence[float]) -> Pose3:
    """Read a sensor's pose: x, y, z, roll, pitch, yaw, or x, y, yaw on a P3AT's height.

    Raises:
        ValueError: If it is neither three nor six finite numbers.
    """
    if isinstance(pose, Pose3):
        return pose
    numbers = [float(number) for number in pose]
    if len(numbers) == 3:
        x, y, yaw = numbers
        z = scene.floor_at(x, y) + SENSOR_HEIGHT if math.isfinite(x + y) else 0.0
        numbers = [x, y, z, 0.0, 0.0, yaw]
    if len(numbers) != 6 or not all(math.isfinite(number) for number in numbers):
        raise ValueError(f"pose {list(pose)!r}, expected three or six finite numbers")
    return Pose3(*numbers)
