"""The battery: it drains with time alone, whatever the robot does."""

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


@dataclass(frozen=True, slots=True)
class Battery:
    """A charge that falls by one second of life a second.

    Attributes:
        life: Full charge, s.
        runs_out: Whether it ever gets empty. One that does not stays at its last
            second, because clients pause a robot whose battery reads 0.
    """

    life: float
    runs_out: bool = False

    def seconds_left(self, elapsed: float) -> int:
        """Give what is left ``elapsed`` s after the spawn, whole s, rounded down."""
        # rounded first: a sum of ticks that is a hair too long must not cost a second
        left = int(max(0.0, self.life - round(elapsed, 6)))
        return left if self.runs_out else max(1, left)

    def is_empty(self, elapsed: float) -> bool:
        """Tell whether the robot is dead ``elapsed`` s after the spawn."""
        return self.seconds_left(elapsed) == 0


# Section from robots.robot.
# One robot on the floor: what it was told, where it is, how far its wheels turned.

Others: TypeAlias = tuple[MovingBody, ...]

_LONGEST_SWEEP = 0.05  # m; a longer step is made in parts, so that nothing is jumped


class Robot:
    """A robot that drives by its latched wheel speeds.

    The wheels turn at their set-points even while something holds the robot, as those
    of the original do, whose motors are stronger than their grip: odometry then counts
    a way that was not made.

    Attributes:
        name: As its client calls it.
        model: Its class.
        wheel_drive: What the numbers of drive commands mean.
        light: Whether its headlight is on.
        footprint: What it covers of the floor.
        top_speed: The farthest that its centre gets in a second, pushes included, m.
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
        """Where it stands."""
        return self._pose

    @property
    def body(self) -> Pose3:
        """Where the origin of its body is, map frame."""
        pose = self._pose
        z = self._floor + self.model.origin_height
        return Pose3(pose.x, pose.y, z, 0.0, 0.0, pose.yaw)

    @property
    def touched(self) -> bool:
        """Whether the last step ran into something, or something touches it."""
        return self._resolver.blocked or self._resolver.touching()

    @property
    def side_angles(self) -> tuple[float, float]:
        """How far the left and the right wheels turned forward since the spawn, rad."""
        return (self._left_angle, self._right_angle)

    @property
    def wheel_angles(self) -> tuple[float, ...]:
        """How far each wheel turned forward since the spawn, rad, in wire order."""
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
        """Take a drive command; what it leaves out stays as it is.

        Args:
            left: Speed of the left wheels, in the drive's unit, forward positive. One
                side alone changes neither.
            right: Speed of the right wheels.
            normalized: Whether this command and those after it are percentages.
            light: Whether the headlight is to be on.

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
            dt: s.
            others: All robots on the floor, this one among them or not, each stepped
                once by the same ``dt``; a new tuple whenever they are not the same.
        """
        if not self._left and not self._right:
            self._resolver.rest(others)
            return
        self._left_angle += self._left * dt
        self._right_angle += self._right * dt
        left = self._left * self.model.wheel_radius
        right = self._right * self.model.wheel_radius
        sweep = self._sweep_rate(left, right) * dt
        parts = max(1, math.ceil(sweep / _LONGEST_SWEEP))
        for _ in range(parts):
            wanted = advance(
                self._pose, left, right, track=self.model.track, dt=dt / parts
            )
            self._pose = self._resolver.move(
                wanted, others, sweep=sweep / parts, dt=dt / parts
            )

    def _sweep_rate(self, left: float, right: float) -> float:
        """Give a bound of the speed of the robot's fastest point, m/s."""
        turn = abs(right - left) / self.model.track
        return abs(left + right) / 2 + turn * self.footprint.radius
