"""Scanners: radar and lasers, alike but for their settings.

A scan is taken in three steps, so that many scans can share one cast: ``plan`` draws
and points the rays, a ``Tracer`` casts them, ``read`` makes readings of what came of
them. ``scan`` does all three for one sensor.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose3
from radarsim.presets.sensors import load_settings
from radarsim.presets.settings import SensorSettings
from radarsim.raycast.boxes import Boxes
from radarsim.raycast.penetration import Outcome
from radarsim.raycast.rays import LASER, RADAR, Rays, Traces
from radarsim.raycast.tracer import Tracer
from radarsim.raycast.tracers import tracer_of
from radarsim.scene.scene import Scene
from radarsim.sensors.beams import CENTRE, BeamPattern, Draw

SENSOR_HEIGHT = 0.346  # m above the floor, of the scanner on a P3AT


@dataclass(frozen=True, slots=True, eq=False)
class Scan:
    """One scan.

    Attributes:
        sensor: Name of the preset.
        pose: Of the sensor, map frame.
        angles: (N,) rad from the sensor's forward axis, counter-clockwise.
        ranges: (N,) m; inf where nothing came back, 0 where a laser is blinded.
        rays: (N,) which ray gave the range: -1 right, 0 centre, 1 left; None for a
            sensor without side rays.
        range_min: m; shorter ranges are given all the same.
        range_max: m.
        resolution: Angle between neighbouring beams, rad.
    """

    sensor: str
    pose: Pose3
    angles: Floats
    ranges: Floats
    rays: Draw | None
    range_min: float
    range_max: float
    resolution: float

    def to_dict(self) -> dict[str, Any]:
        """Give numbers and lists that JSON can hold; None where nothing came back."""
        ranges = [r if math.isfinite(r) else None for r in self.ranges.tolist()]
        return {
            "sensor": self.sensor,
            "pose": list(self.pose.numbers()),
            "angle_min": float(self.angles[0]),
            "angle_increment": self.resolution,
            "range_min": self.range_min,
            "range_max": self.range_max,
            "ranges": ranges,
            "rays": None if self.rays is None else self.rays.tolist(),
        }


@dataclass(frozen=True, slots=True)
class Plan:
    """A scan that waits to be cast: where the sensor is, and which rays it drew."""

    pose: Pose3
    sides: Draw
    rays: Rays


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
        nowhere = np.zeros((len(self.angles), 3))
        self._alike = Rays.alike(
            nowhere,
            nowhere,
            reach=settings.max_range,
            power=settings.penetration_power,
            medium=self._medium,
        )

    @property
    def has_side_rays(self) -> bool:
        """Whether the sensor draws among three rays."""
        return self.settings.medium == "radar"

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
            rng: What draws the rays; a sensor without side rays needs none.

        Raises:
            ValueError: If the pose is neither, or there is no rng to draw from.
        """
        tracer = tracer_of(scene)
        plan = self.plan(tracer, sensor_pose(scene, pose), rng)
        return self.read(plan, tracer.trace(plan.rays))

    def plan(
        self,
        tracer: Tracer,
        pose: Pose3,
        rng: np.random.Generator | None,
        boxes: Boxes | None = None,
        own: int = -1,
    ) -> Plan:
        """Draw the rays of one scan and point them.

        Args:
            tracer: Of the scene; tells which side rays start behind something opaque,
                so that the centre ray serves.
            pose: Of the sensor, map frame.
            rng: What draws.
            boxes: Of the robots.
            own: The number of the box that carries the sensor; -1 for none.

        Raises:
            ValueError: If there is no rng to draw from.
        """
        sides = np.zeros(len(self.angles), np.int8)
        if self.has_side_rays:
            if rng is None:
                raise ValueError(
                    f"no rng, expected a Generator for sensor {self.name!r}"
                )
            sides = self._pattern.draw(rng)
            place, width = pose.position(), self._pattern.width
            if width and not tracer.is_open(place, width, self._medium, boxes, own):
                sides[self._hidden(tracer, pose, sides, boxes, own)] = CENTRE
        return Plan(pose, sides, self._rays(pose, sides, own))

    def replan(self, plan: Plan, sides: Draw, own: int = -1) -> Plan:
        """Take other rays of the same beams, whatever they start behind."""
        return Plan(plan.pose, sides, self._rays(plan.pose, sides, own))

    def read(self, plan: Plan, traces: Traces) -> Scan:
        """Make a scan of what came of its rays."""
        ranges = traces.ranges.copy()
        if self.settings.spent_reads == "zero":
            ranges[traces.outcomes == Outcome.SPENT] = 0.0
        return Scan(
            sensor=self.name,
            pose=plan.pose,
            angles=self.angles,
            ranges=ranges,
            rays=plan.sides if self.has_side_rays else None,
            range_min=self.settings.min_range,
            range_max=self.settings.max_range,
            resolution=math.radians(self.settings.resolution_deg),
        )

    def _rays(self, pose: Pose3, sides: Draw, own: int) -> Rays:
        fan = self._pattern.aim(pose, sides)
        same = self._alike
        carried_by = same.own if own < 0 else np.full(len(sides), own)
        return Rays(
            fan.origins,
            fan.directions,
            same.reach,
            same.power,
            same.medium,
            carried_by,
        )

    def _hidden(
        self, tracer: Tracer, pose: Pose3, sides: Draw, boxes: Boxes | None, own: int
    ) -> NDArray[np.int64]:
        """Find the beams whose side ray starts behind something opaque."""
        starts = self._pattern.aim(pose, sides).origins
        way = starts - pose.position()
        length = np.linalg.norm(way, axis=1)
        moved = np.flatnonzero(length > 0)
        rays = Rays.alike(
            np.broadcast_to(pose.position(), (len(moved), 3)),
            way[moved] / length[moved, None],
            reach=0.0,
            medium=self._medium,
            own=own,
        )
        traces = tracer.trace(replace(rays, reach=length[moved]), boxes)
        hidden: NDArray[np.int64] = moved[traces.outcomes == Outcome.HIT]
        return hidden


def load_sensor(name: str, **settings: Any) -> RangeScanner:
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
