"""One robot on the floor: its commands, its pose, its wheels and its battery."""

import math
from dataclasses import dataclass
from typing import TypeAlias

from radarsim.geometry import Pose2, Pose3
from radarsim.presets.robots import RobotModel
from radarsim.robots.collision import (
    MAX_DISPLACEMENT_RATIO,
    CollisionResolver,
    MovingBody,
)
from radarsim.robots.footprint import Footprint
from radarsim.robots.obstacles import Obstacles
from radarsim.robots.skid_steer import WheelDrive, advance

Others: TypeAlias = tuple[MovingBody, ...]

_MAX_SWEEP = 0.05  # m; a longer step is split, so that no obstacle is jumped over


@dataclass(frozen=True, slots=True)
class Battery:
    """A battery that drains with time only, whatever the robot does.

    Attributes:
        life: Time that a full charge lasts, s.
        runs_out: Whether it ever gets empty. One that does not stays at its last
            second, because clients pause a robot whose battery reads 0.
    """

    life: float
    runs_out: bool = False

    def seconds_left(self, elapsed: float) -> int:
        """Return what is left ``elapsed`` s after the spawn, whole s, rounded down."""
        # rounded first: the rounding error of a sum of ticks must not cost a second
        left = int(max(0.0, self.life - round(elapsed, 6)))
        return left if self.runs_out else max(1, left)

    def is_empty(self, elapsed: float) -> bool:
        """Return whether the battery is empty ``elapsed`` s after the spawn."""
        return self.seconds_left(elapsed) == 0


class Robot:
    """A robot that drives at its latched wheel speeds.

    The wheels turn at their set-points even while something blocks the robot, as those
    of the original do, whose motors are stronger than their grip: odometry then counts
    a distance that was not driven.

    Attributes:
        name: Name given by its client.
        model: Robot class.
        wheel_drive: Conversion of drive commands to wheel speeds.
        light: Whether its headlight is on.
        footprint: Rectangle that it occupies on the floor.
        top_speed: Highest speed of its centre, pushes included, m/s.
    """

    def __init__(
        self,
        name: str,
        model: RobotModel,
        pose: Pose2,
        *,
        obstacles: Obstacles,
        wheel_drive: WheelDrive,
    ) -> None:
        self.name = name
        self.model = model
        self.wheel_drive = wheel_drive
        self.light = False
        self.footprint = Footprint(model.length, model.width)
        fastest = wheel_drive.max_spin_rad_s * model.wheel_radius
        self.top_speed = MAX_DISPLACEMENT_RATIO * max(
            self._sweep_rate(fastest, fastest), self._sweep_rate(-fastest, fastest)
        )
        self._pose = pose
        self._floor = obstacles.floor
        self._normalized = False
        self._left = self._right = 0.0  # rad/s
        self._left_angle = self._right_angle = 0.0  # rad
        self._resolver = CollisionResolver(self, obstacles)

    @property
    def pose(self) -> Pose2:
        """Pose on the floor, map frame."""
        return self._pose

    @property
    def body(self) -> Pose3:
        """Pose of the body frame, map frame."""
        pose = self._pose
        z = self._floor + self.model.origin_height
        return Pose3(pose.x, pose.y, z, 0.0, 0.0, pose.yaw)

    @property
    def touched(self) -> bool:
        """Whether the last step was blocked, or something touches the robot."""
        return self._resolver.blocked or self._resolver.touching()

    @property
    def side_angles(self) -> tuple[float, float]:
        """Angles that the left and right wheels turned forward since the spawn, rad."""
        return (self._left_angle, self._right_angle)

    @property
    def wheel_angles(self) -> tuple[float, ...]:
        """Angle that each wheel turned forward since the spawn, rad, in wire order."""
        left, right = self.side_angles
        return tuple(left if side == "left" else right for side in self.model.wheels)

    def drive(
        self,
        left: float | None = None,
        right: float | None = None,
        *,
        normalized: bool | None = None,
        light: bool | None = None,
    ) -> None:
        """Apply a drive command; values that it omits stay unchanged.

        Args:
            left: Speed of the left wheels in the unit of ``wheel_drive``, forward
                positive. A command for one side only changes neither.
            right: Speed of the right wheels, likewise.
            normalized: Whether this command and later ones are percentages.
            light: Whether the headlight is on.

        Raises:
            ValueError: If a speed is not finite.
        """
        if not all(math.isfinite(speed) for speed in (left or 0, right or 0)):
            raise ValueError(
                f"wheel speeds {left!r}, {right!r}, expected finite numbers"
            )
        self._normalized = self._normalized if normalized is None else normalized
        self.light = self.light if light is None else light
        if left is None or right is None:
            return
        spin = self.wheel_drive.spin
        self._left = spin(left, normalized=self._normalized)
        self._right = spin(right, normalized=self._normalized)

    def halt(self) -> None:
        """Stop the wheels."""
        self._left = self._right = 0.0

    def step(self, dt: float, others: Others = ()) -> None:
        """Drive for one time step.

        Args:
            dt: Time step, s.
            others: All robots on the floor, with or without this one, each stepped
                once by the same ``dt``; a new tuple whenever the robots change.
        """
        if not self._left and not self._right:
            self._resolver.rest(others)
            return
        self._left_angle += self._left * dt
        self._right_angle += self._right * dt
        left = self._left * self.model.wheel_radius
        right = self._right * self.model.wheel_radius
        sweep = self._sweep_rate(left, right) * dt
        substeps = max(1, math.ceil(sweep / _MAX_SWEEP))
        for _ in range(substeps):
            wanted = advance(
                self._pose, left, right, track=self.model.track, dt=dt / substeps
            )
            self._pose = self._resolver.move(
                wanted, others, sweep=sweep / substeps, dt=dt / substeps
            )

    def _sweep_rate(self, left: float, right: float) -> float:
        """Return an upper bound of the speed of the robot's fastest point, m/s."""
        turn = abs(right - left) / self.model.track
        return abs(left + right) / 2 + turn * self.footprint.radius
