"""The motion of a robot that steers as a car does: the kinematic bicycle model.

Theory of operation
===================
Both wheels of an axle count as one in its middle, and no wheel slips sideways. With the
angles f and r of the front and the rear wheels, and the axles at the distances a before
and b behind the centre, the centre moves at the angle s to the heading::

    tan s = (b tan f + a tan r) / (a + b)

and the robot turns by (tan f - tan r) / (a + b) for each metre along its heading
(Rajamani, Vehicle Dynamics and Control, 2.2). The driven rear wheels roll as fast as is
commanded, so that the part of the speed along the heading is theirs times cos r.
"""

import math
from itertools import product
from typing import NamedTuple, Self

from radarsim.presets.robots import RobotModel


class Bicycle(NamedTuple):
    """The axles of a robot.

    Attributes:
        front: Distance of the front axle before the centre, m.
        rear: Distance of the rear axle behind the centre, m.
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
        """Return the angles that wheels take of those that are commanded, rad."""
        return (
            max(-self.max_front, min(self.max_front, front)),
            max(-self.max_rear, min(self.max_rear, rear)),
        )

    def motion(
        self, spin: float, front: float, rear: float
    ) -> tuple[float, float, float]:
        """Return what makes a robot move as a bicycle.

        Args:
            spin: Speed of the wheels, rad/s.
            front: Angle of the front wheels, rad, left positive.
            rear: Angle of the rear wheels, rad.

        Returns:
            Speeds of left and right wheels, rad/s, as of skid steering, and the angle
            from the heading to the motion of the centre, rad.
        """
        base = self.front + self.rear
        slope = (self.rear * math.tan(front) + self.front * math.tan(rear)) / base
        along = spin * math.cos(rear)
        # What the wheels of a side roll more or less: the robot turns by it.
        more = along * (math.tan(front) - math.tan(rear)) / base * self.track / 2
        return along - more, along + more, math.atan(slope)

    def extremes(self, spin: float) -> list[tuple[float, float, float]]:
        """Return the motions with wheels at their limits, at a speed in rad/s."""
        fronts, rears = (self.max_front, 0.0), (self.max_rear, 0.0, -self.max_rear)
        return [self.motion(spin, *angles) for angles in product(fronts, rears)]
