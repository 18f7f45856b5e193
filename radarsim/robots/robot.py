"""A robot: access to its row in the table of robots, and its drive commands.

The state of all robots is one table with a row for each, which the engine shares.
"""

import math
from itertools import product
from typing import TYPE_CHECKING, Any, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import engine
from radarsim.geometry import Pose2, Pose3
from radarsim.presets.robots import RobotModel
from radarsim.protocol.dialect import WheelDrive
from radarsim.robots.footprint import Footprint

if TYPE_CHECKING:
    from radarsim.robots.fleet import Fleet

ROBOT: Final = engine.rows["Robot"]  # fields are described in ``robot.hpp``
# Column of each field in the float64 view of the table, which is much faster to read.
COLUMN: Final = {name: at[1] // 8 for name, at in (ROBOT.fields or {}).items()}
_BODY: Final = tuple(
    COLUMN[field] for field in ("x", "y", "body_z", "roll", "pitch", "yaw")
)
ODOMETRY: Final = engine.rows["Odometry"]
FREE: Final = -1.0  # slot of a row without odometry
_SPEEDS: Final = ("left_spin", "right_spin", "aside", "climb")
UNKNOWN: Final = -1.0  # value of ``touched`` until contacts are computed


def new_rows(count: int) -> NDArray[np.void]:
    """Return initial rows for robots, (``count``,) of type ``ROBOT``."""
    rows = np.zeros(count, ROBOT)
    rows["rejected"] = np.nan
    rows["touched"] = UNKNOWN
    return rows


class Bicycle(NamedTuple):
    """The kinematic bicycle model of a robot with car-like steering.

    Both wheels of an axle are modelled as one wheel in the middle, without side slip.
    With the angles f and r of the front and the rear wheels, and the axles at the
    distances a in front of and b behind the centre, the centre moves at the angle s to
    the heading::

        tan s = (b tan f + a tan r) / (a + b)

    and the robot turns by (tan f - tan r) / (a + b) for each metre along its heading
    (Rajamani, Vehicle Dynamics and Control, 2.2). The driven rear wheels roll at the
    commanded speed, so the speed along the heading is this speed times cos r.

    Attributes:
        front: Distance from the centre forward to the front axle, m.
        rear: Distance from the centre back to the rear axle, m.
        max_front: Largest angle of the front wheels to either side, rad.
        max_rear: Largest angle of the rear wheels, rad.
        track: Distance between the left and the right wheels, m.
    """

    front: float
    rear: float
    max_front: float
    max_rear: float
    track: float

    @classmethod
    def of(cls, model: RobotModel) -> Self | None:
        """Return the axles of a robot class; None if it is skid-steered."""
        steering = model.steering
        if steering is None:
            return None
        rear = model.wheel_base / 2
        if steering.rear_axle is not None:
            rear = -steering.rear_axle
        return cls(
            model.wheel_base - rear,
            rear,
            math.radians(steering.max_front_deg),
            math.radians(steering.max_rear_deg),
            model.track,
        )

    def limit(self, front: float, rear: float) -> tuple[float, float]:
        """Limit commanded angles of the front and rear wheels, rad."""
        return (
            max(-self.max_front, min(self.max_front, front)),
            max(-self.max_rear, min(self.max_rear, rear)),
        )

    def motion(
        self, spin: float, front: float, rear: float
    ) -> tuple[float, float, float]:
        """Convert a bicycle command to wheel speeds and a side-slip angle.

        Args:
            spin: Speed of the wheels, rad/s.
            front: Angle of the front wheels, rad, left positive.
            rear: Angle of the rear wheels, rad.

        Returns:
            Speeds of the left and right wheels, rad/s, of an equivalent skid-steered
            robot, and the angle from the heading to the motion of the centre, rad.
        """
        base = self.front + self.rear
        slope = (self.rear * math.tan(front) + self.front * math.tan(rear)) / base
        along = spin * math.cos(rear)
        # Half the speed difference between the right and left wheels turns the robot.
        more = along * (math.tan(front) - math.tan(rear)) / base * self.track / 2
        return along - more, along + more, math.atan(slope)

    def extremes(self, spin: float) -> list[tuple[float, float, float]]:
        """Return the motions at the limits of steering, for a wheel speed, rad/s."""
        fronts, rears = (self.max_front, 0.0), (self.max_rear, 0.0, -self.max_rear)
        return [self.motion(spin, *angles) for angles in product(fronts, rears)]


class Robot:
    """A robot that drives at its latched wheel speeds; a member of a ``Fleet``.

    All speeds and angles of commands must be finite.

    The wheels keep turning at the commanded speeds if an obstacle blocks the robot, as
    in the original server, where the motors are stronger than the grip of the wheels.
    Odometry then counts a distance that was not driven.

    Attributes:
        name: Name given by the client.
        model: Robot class.
        wheel_drive: Conversion of drive commands to wheel speeds.
        light: Whether the headlight is on.
        footprint: Rectangle that the robot occupies on the floor.
        bicycle: Model of car-like steering; None for skid steering.
        fleet: The fleet of the robot; a fleet of its own after its removal.
        slot: Index of the robot's row in the table of the fleet.
    """

    def __init__(
        self,
        name: str,
        model: RobotModel,
        *,
        wheel_drive: WheelDrive,
        fleet: "Fleet",
        slot: int,
    ) -> None:
        """Create a robot; the fleet fills the row.

        Args:
            name: Name given by the client.
            model: Robot class.
            wheel_drive: Conversion of drive commands to wheel speeds.
            fleet: The fleet of the robot.
            slot: Index of the robot's row in the table of the fleet.
        """
        self.name = name
        self.model = model
        self.wheel_drive = wheel_drive
        self.light = False
        self.footprint = Footprint(model.length, model.width)
        self.bicycle = Bicycle.of(model)
        self.fleet = fleet
        self.slot = slot
        self._normalized = False

    @property
    def row(self) -> Any:
        """The robot's row in the table of the fleet, valid until a robot is added."""
        return self.fleet.table[self.slot]

    @property
    def number(self) -> int:
        """The number of the robot in the order of spawning, from 1."""
        return int(self.fleet.columns.item(self.slot, COLUMN["number"]))

    @property
    def pose(self) -> Pose2:
        """Pose on the floor, map frame."""
        first = COLUMN["x"]
        return Pose2(*self.fleet.columns[self.slot, first : first + 3].tolist())

    @property
    def body(self) -> Pose3:
        """Pose of the body frame, map frame."""
        number, slot = self.fleet.columns.item, self.slot
        return Pose3(*[number(slot, column) for column in _BODY])

    @property
    def touched(self) -> bool:
        """Whether the robot was blocked in the last step, or is in contact."""
        known = self.fleet.columns.item(self.slot, COLUMN["touched"])
        if known == UNKNOWN:
            return bool(self.fleet.touched([self.slot])[0])
        return known == 1.0

    @property
    def top_speed(self) -> float:
        """Largest possible speed of the centre, m/s, even when other robots push it."""
        return float(self.fleet.columns.item(self.slot, COLUMN["top_speed"]))

    @property
    def side_angles(self) -> tuple[float, float]:
        """Forward rotation of the left and right wheels since the spawn, rad."""
        row = self.row
        return float(row["left_angle"]), float(row["right_angle"])

    def drive(
        self,
        left: float | None = None,
        right: float | None = None,
        *,
        normalized: bool | None = None,
        light: bool | None = None,
    ) -> None:
        """Apply a drive command; values that are None stay unchanged.

        Args:
            left: Speed of the left wheels in the unit of ``wheel_drive``, forward
                positive. A command for only one side changes no speed.
            right: Speed of the right wheels, in the same unit.
            normalized: Whether this command and later ones are percentages.
            light: Whether the headlight is on.
        """
        # A command without the ``Normalized`` flag keeps the flag's previous value.
        self._normalized = self._normalized if normalized is None else normalized
        self.light = self.light if light is None else light
        # As in the original server, a command needs both speeds; some clients send only
        # one, which is ignored.
        if left is None or right is None or self.bicycle is not None:
            return
        spin = self.wheel_drive.spin
        row, column = self.fleet.columns[self.slot], COLUMN["left_spin"]
        row[column] = spin(left, normalized=self._normalized)
        row[column + 1] = spin(right, normalized=self._normalized)

    def steer(
        self, speed: float, front: float | None = None, rear: float | None = None
    ) -> None:
        """Apply a drive command to a robot with car-like steering.

        Args:
            speed: Speed of the wheels, in the unit of ``drive``.
            front: Angle of the front wheels, rad, left positive, clipped to the limits
                of the robot class. None keeps the current angle.
            rear: Angle of the rear wheels, rad, clipped too. None keeps the current
                angle.

        Raises:
            ValueError: If the robot is skid-steered.
        """
        if self.bicycle is None:
            raise ValueError(f"{self.model.name} is skid-steered, expected drive()")
        row = self.row
        front = float(row["front_steer"]) if front is None else front
        rear = float(row["rear_steer"]) if rear is None else rear
        front, rear = self.bicycle.limit(front, rear)
        spin = self.wheel_drive.spin(speed, normalized=self._normalized)
        row["front_steer"], row["rear_steer"] = front, rear
        motion = self.bicycle.motion(spin, front, rear)
        row["left_spin"], row["right_spin"], row["sideslip"] = motion

    def fly(
        self,
        ahead: float | None = None,
        left: float | None = None,
        up: float | None = None,
        turn: float | None = None,
        *,
        normalized: bool = False,
    ) -> None:
        """Apply a command to a flying robot; None keeps the current speed.

        Args:
            ahead: Forward speed, m/s; all speeds are clipped to the class's limits.
            left: Speed to the left, m/s.
            up: Upward speed, m/s.
            turn: Yaw rate, counter-clockwise, rad/s.
            normalized: Whether all four are percentages of the largest speeds.

        Raises:
            ValueError: If the robot does not fly.
        """
        flight, model = self.model.flight, self.model
        if flight is None:
            raise ValueError(f"{model.name} does not fly, expected drive()")
        speeds = (ahead, left, up, turn)
        row, radius, half_track = self.row, model.wheel_radius, model.track / 2
        before = (
            (row["right_spin"] + row["left_spin"]) / 2 * radius,
            row["aside"],
            row["climb"],
            (row["right_spin"] - row["left_spin"]) / 2 * radius / half_track,
        )
        limits = (
            *(flight.max_linear, flight.max_lateral, flight.max_altitude),
            math.radians(flight.max_turn_deg),
        )
        along, row["aside"], row["climb"], rate = (
            old if speed is None else _limited(speed, limit, normalized=normalized)
            for speed, old, limit in zip(speeds, before, limits, strict=True)
        )
        # As in the original server, a command in percent uses only ``tilt_deg`` percent
        # of the largest tilt.
        tilt = math.radians(flight.tilt_deg)
        tilt *= flight.tilt_deg / 100 if normalized else 1.0
        if ahead is not None:
            row["pitch_wanted"] = math.copysign(tilt, ahead) if ahead else 0.0
        if left is not None:
            row["roll_wanted"] = math.copysign(tilt, -left) if left else 0.0
        row["left_spin"] = (along - rate * half_track) / radius
        row["right_spin"] = (along + rate * half_track) / radius

    def tilt(self, dt: float) -> None:
        """Change roll and pitch of a flying robot towards their targets for one step.

        Args:
            dt: Time step, s.
        """
        flight, row = self.model.flight, self.row
        if flight is None or not flight.tilt_deg:
            return
        step = math.radians(flight.tilt_rate_deg) * dt
        for angle in ("roll", "pitch"):
            more = row[f"{angle}_wanted"] - row[angle]
            row[angle] += max(-step, min(step, more))

    def halt(self) -> None:
        """Stop the wheels; a flying robot hovers."""
        row = self.row
        for name in (*_SPEEDS, "roll_wanted", "pitch_wanted"):
            row[name] = 0.0


def _limited(speed: float, limit: float, *, normalized: bool) -> float:
    """Clip a speed to the limit, after conversion from percent if ``normalized``."""
    wanted = speed * limit / 100 if normalized else speed
    return max(-limit, min(limit, wanted))
