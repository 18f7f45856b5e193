"""Range scanners: radars and lasers, which differ only in their settings.

A scan is taken in three steps, so that many scans can be traced together: ``plan``
draws and aims the rays, a ``Tracer`` traces them, ``read`` builds the scan.
``RangeScanner.scan`` does all three for one scan, ``scan_batch`` for many.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose3
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
from radarsim.sensors.scan_batch import ScanArrays, scan_poses

EMPTY: Final = np.zeros(0)
NO_RAIN: Final = np.zeros((2, 0))
SENSOR_HEIGHT: Final = 0.346  # m; height of a P3AT's scanner above the floor


class RangeScanner:
    """A radar or a laser.

    Attributes:
        name: Name of its preset.
        settings: All its settings.
        angles: (N,) directions of its beams, rad, counter-clockwise from the right.
        rays_per_scan: Number of rays that are traced for one scan.
    """

    def __init__(self, name: str, settings: SensorSettings) -> None:
        self.name = name
        self.settings = settings
        self._pattern = BeamPattern(settings)
        self.angles = self._pattern.angles
        self._medium = RADAR if settings.medium == "radar" else LASER
        self._builder = ScanBuilder(name, settings, self._pattern)
        self.rays_per_scan = len(self.angles) * self._pattern.rays
        nowhere = np.zeros((self.rays_per_scan, 3))
        self._template = Rays.uniform(
            nowhere,
            nowhere,
            max_range=settings.max_range,
            power=settings.penetration_power,
        )
        self._ray_classes = (ray_class_of(settings),)

    def __repr__(self) -> str:
        settings = self.settings
        return (
            f"<RangeScanner {self.name}: {settings.medium}, {len(self.angles)} beams"
            f" over {settings.fov_deg:g}°, up to {settings.max_range:g} m>"
        )

    @property
    def has_side_rays(self) -> bool:
        """Whether beams can have several rays."""
        return self.settings.has_side_rays

    @cached_property
    def with_all_echoes(self) -> "RangeScanner":
        """The same scanner, listing all echoes where it keeps only the last ones.

        It draws the same random numbers and has the same ranges. A scanner that keeps
        the first or the strongest echoes lists only those.
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
            pose: Pose of the sensor in the map frame, m and rad: x, y, z, roll, pitch,
                yaw; or x, y, yaw at a height of 0.346 m above the floor.
            rng: Source of random rays and noise; None for a sensor without either.

        Raises:
            ValueError: If the pose is invalid, or an rng is needed and missing.
        """
        tracer = tracer_of(scene)
        plan = self.plan(tracer, sensor_pose(scene, pose), rng)
        traces = tracer.trace(plan.rays, events=plan.events, incidence=plan.incidence)
        return replace(self.read(plan, traces), scene=scene)

    def scan_many(
        self,
        scene: Scene,
        poses: Sequence[Pose3 | Sequence[float]] | Floats,
        rng: np.random.Generator | None = None,
    ) -> ScanArrays:
        """Scan a scene from many poses, on all processors.

        Args:
            scene: From ``load_map``.
            poses: M poses as in ``scan``, for example an array (M, 3) or (M, 6).
            rng: Source of random rays and noise; None for a sensor without either.

        Returns:
            The same values as M calls of ``scan`` in this order.

        Raises:
            ValueError: If a pose is invalid, or an rng is needed and missing.
        """
        return scan_poses(self, tracer_of(scene), _sensor_poses(scene, poses), rng)

    def plan(
        self,
        tracer: Tracer,
        pose: Pose3,
        rng: np.random.Generator | None,
        boxes: Boxes | None = None,
        carrier_id: int = -1,
    ) -> PlannedScan:
        """Draw the rays of one scan and aim them.

        Which random numbers are drawn depends on the scene only in whether it rains
        there, so that moving robots do not change the numbers drawn next.

        Args:
            tracer: Tracer of the scene; it finds side rays that start behind an opaque
                surface, which the centre ray replaces.
            pose: Pose of the sensor, map frame.
            rng: Source of randomness.
            boxes: Boxes of the robots.
            carrier_id: Id of the box that carries the sensor; -1 for none.

        Raises:
            ValueError: If an rng is needed and missing.
        """
        builder = self._builder
        is_raining = tracer.has_rain and self._medium == RADAR
        is_random = self._pattern.is_random or builder.is_random or is_raining
        if is_random and not isinstance(rng, np.random.Generator):
            raise ValueError(f"no rng, expected a Generator for sensor {self.name!r}")
        sampled = self._pattern.sample(rng)
        ray_draw, range_error, rain_draw = EMPTY, EMPTY, NO_RAIN
        if rng is not None and builder.selects_ray:
            ray_draw = rng.random(len(self.angles))
        if rng is not None and builder.is_noisy:
            range_error = rng.standard_normal(len(self.angles))
        if rng is not None and is_raining:
            rain_draw = rng.standard_exponential((2, len(self.angles)))
        position, radius = pose.position(), self._pattern.radius
        if radius and not tracer.is_clear(
            position, radius, self._medium, boxes, carrier_id
        ):
            hidden = self._hidden_rays(tracer, pose, sampled, boxes, carrier_id)
            sampled = self._pattern.replace_by_centre(sampled, hidden)
        rays = self._rays(pose, sampled, carrier_id)
        return PlannedScan(
            tracer,
            pose,
            sampled.sides,
            rays,
            ray_draw,
            range_error,
            rain_draw,
            builder.needs_events or is_raining,
            builder.needs_incidence,
        )

    def aim_one_ray(self, pose: Pose3, side: int) -> tuple[Sides, Rays]:
        """Aim the ray on one side of each beam, even if it starts behind a surface.

        Args:
            pose: Pose of the sensor, map frame.
            side: -1 for the right one of three, 0 for the centre, 1 for the left one.

        Raises:
            ValueError: If the beams do not have three rays.
        """
        sampled = self._pattern.one_side(side)
        return sampled.sides, self._rays(pose, sampled, -1)

    def read(self, plan: PlannedScan, traces: Traces) -> Scan:
        """Build a scan from its traced rays.

        Args:
            plan: A scan planned by this scanner.
            traces: Its traced rays, with events and incidence if the plan asks for
                them.
        """
        return self._builder.build(plan, traces)

    def _rays(self, pose: Pose3, sampled: SampledRays, carrier_id: int) -> Rays:
        beams = self._pattern.aim(pose, sampled)
        template, n = self._template, len(sampled.nodes)
        if n < len(template.max_range):
            template = template.take(np.arange(n))
        carrier_ids = template.carrier_id if carrier_id < 0 else np.full(n, carrier_id)
        return Rays(
            beams.origins,
            beams.directions,
            template.max_range,
            template.power,
            template.class_index,
            carrier_ids,
            self._ray_classes,
        )

    def _hidden_rays(
        self,
        tracer: Tracer,
        pose: Pose3,
        sampled: SampledRays,
        boxes: Boxes | None,
        carrier_id: int,
    ) -> NDArray[np.int64]:
        """Return the indices of side rays that start behind an opaque surface."""
        starts = self._pattern.aim(pose, sampled).origins
        offset = starts - pose.position()
        length = np.linalg.norm(offset, axis=1)
        moved = np.flatnonzero(length > 0)
        rays = Rays.uniform(
            np.broadcast_to(pose.position(), (len(moved), 3)),
            offset[moved] / length[moved, None],
            max_range=0.0,
            medium=self._medium,
            carrier_id=carrier_id,
        )
        traces = tracer.trace(replace(rays, max_range=length[moved]), boxes)
        blocked = traces.outcomes != Outcome.NOTHING
        hidden: NDArray[np.int64] = moved[blocked]
        return hidden


def load_sensor(name: str, /, **settings: Any) -> RangeScanner:
    """Create a scanner from a preset, with some of its settings changed.

    Raises:
        PresetError: If there is no such preset or setting, or a value is invalid.
    """
    return RangeScanner(name, load_settings(name, **settings))


def sensor_pose(scene: Scene, pose: Pose3 | Sequence[float]) -> Pose3:
    """Convert a sensor pose: x, y, z, roll, pitch, yaw, or x, y, yaw at default height.

    Raises:
        ValueError: If it is neither three nor six finite numbers.
    """
    if isinstance(pose, Pose3):
        return pose
    numbers = given = [float(number) for number in pose]
    if len(numbers) == 3:
        x, y, yaw = numbers
        z = scene.floor_at(x, y) + SENSOR_HEIGHT if math.isfinite(x + y) else 0.0
        numbers = [x, y, z, 0.0, 0.0, yaw]
    if len(numbers) != 6 or not all(math.isfinite(number) for number in numbers):
        raise ValueError(f"pose {given!r}, expected three or six finite numbers")
    return Pose3(*numbers)


def _sensor_poses(
    scene: Scene, poses: Sequence[Pose3 | Sequence[float]] | Floats
) -> list[Pose3]:
    placed = []
    for i, pose in enumerate(poses):
        try:
            placed.append(sensor_pose(scene, pose))
        except (TypeError, ValueError) as error:
            raise ValueError(f"poses[{i}]: {error}") from None
    return placed
