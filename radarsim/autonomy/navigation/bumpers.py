"""Long-range bumpers: sectors around the robot that are pressed by near obstacles.

Theory of operation
===================
Four to eight bumpers are easier to steer by than hundreds of beams. Each bumper is a
sector around the robot. It is pressed when a share of its beams is shorter than the
safety distance plus half a metre (the band), and too near when that share is shorter
than the safety distance itself.

The literal rule of the thesis is stricter: a bumper is pressed if all of its beams are
between the safety distance s and s + 0.5 m. Of n bumpers, the bumper that faces a flat
wall at the distance d sees ranges from d to d / cos(pi / n), so the rule can hold only
for s <= d <= (s + 0.5) cos(pi / n): with eight bumpers up to s = 6.07 m, with four up
to s = 1.21 m, and never for a pole or a corner. ``too_near`` works with it as well.

Source: a thesis on navigation with a radar in USARSim, section 5.2.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radarsim.autonomy.navigation.observation import Observation, wrap_angles
from radarsim.autonomy.plans import LEAST_SHARE, Rule
from radarsim.geometry import Floats

BAND = 0.5  # m beyond the safety distance in which bumpers are pressed
MOST = 36  # bumpers; with more, sectors contain too few beams

EIGHT = (
    *("front", "front_left", "left", "back_left"),
    *("back", "back_right", "right", "front_right"),
)


@dataclass(frozen=True, slots=True)
class Bumper:
    """The state of one long-range bumper.

    Attributes:
        name: Name of the sector, such as ``front_left``.
        pressed: Whether the bumper is pressed by the rule.
        too_near: Whether a share of the beams is shorter than the safety distance.
        distance: Length of the longest beam in the nearest share, m; ``inf`` without a
            return.
    """

    name: str
    pressed: bool
    too_near: bool
    distance: float

    @property
    def blocked(self) -> bool:
        """Whether the robot must not drive in the direction of the bumper."""
        return self.pressed or self.too_near


@dataclass(frozen=True, slots=True, kw_only=True)
class Bumpers:
    """Long-range bumpers: equal sectors around the robot, the first centred ahead.

    Attributes:
        safety_distance: Safety distance from the robot's centre, m.
        count: Number of bumpers, 4 to 36.
        share: Share of a bumper's beams that press it, above 0 and at most 1.
        rule: The rule by which a bumper is pressed.
    """

    safety_distance: float
    count: int = 8
    share: float = LEAST_SHARE
    rule: Rule = Rule.SHARE

    def __post_init__(self) -> None:
        if not 4 <= self.count <= MOST:
            raise ValueError(f"{self.count} bumpers, expected 4 to {MOST}")
        if not 0 < self.share <= 1:
            raise ValueError(f"share {self.share!r}, expected above 0 and at most 1")
        if not 0 < self.safety_distance < math.inf:
            value = self.safety_distance
            raise ValueError(f"safety_distance {value!r}, expected finite and above 0")

    @property
    def pressed_below(self) -> float:
        """Distance of obstacles, m, below which a bumper may be pressed."""
        return self.safety_distance + BAND

    @property
    def width(self) -> float:
        """Width of a bumper's sector, rad."""
        return 2 * math.pi / self.count

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the bumpers, counter-clockwise from the front."""
        if self.count in (4, 8):
            return EIGHT[:: 8 // self.count]
        return tuple(f"at_{round(360 * k / self.count)}" for k in range(self.count))

    def read(self, observation: Observation) -> tuple[Bumper, ...]:
        """Return the state of all bumpers, in the order of ``names``."""
        sectors = self._sectors(observation.bearings)
        return tuple(
            self._state(name, observation.ranges[sectors == k])
            for k, name in enumerate(self.names)
        )

    def towards(self, observation: Observation, bearing: float) -> Bumper:
        """Return the state of a bumper whose sector is centred on a bearing, rad."""
        offsets = wrap_angles(observation.bearings - bearing)
        within = np.abs(offsets) <= self.width / 2
        return self._state("front", observation.ranges[within])

    def blind(self, angles: Floats) -> tuple[str, ...]:
        """Return the names of bumpers without a beam, from beam angles, (N,) rad."""
        covered = set(self._sectors(angles).tolist())
        return tuple(name for k, name in enumerate(self.names) if k not in covered)

    def _sectors(self, bearings: Floats) -> NDArray[np.int64]:
        # Bearings are shifted by half a sector, since
        # the first one is centred on the front.
        turns = (bearings + self.width / 2) / self.width
        return np.floor(turns).astype(np.int64) % self.count

    def _state(self, name: str, ranges: Floats) -> Bumper:
        if not len(ranges):
            return Bumper(name, pressed=False, too_near=False, distance=math.inf)
        distance = nearest_share(ranges, self.share)
        if self.rule == Rule.SHARE:
            pressed = distance < self.pressed_below
        else:
            # A beam without a return has the range inf,
            # so one such beam releases the bumper.
            least, most = float(ranges.min()), float(ranges.max())
            pressed = self.safety_distance <= least and most <= self.pressed_below
        too_near = distance < self.safety_distance
        return Bumper(name, pressed, too_near, distance)


def nearest_share(ranges: Floats, share: float) -> float:
    """Return the range, m, that the given share of ranges does not exceed.

    Args:
        ranges: (N,) m, at least one.
        share: Above 0 and at most 1; at least one range is counted.
    """
    # The subtraction prevents rounding errors from adding one range to the count.
    count = max(1, math.ceil(share * len(ranges) - 1e-9))
    return float(np.partition(ranges, count - 1)[count - 1])


def pressed_names(bumpers: Sequence[Bumper]) -> tuple[str, ...]:
    """Return the names of the bumpers that are pressed or too near an obstacle."""
    return tuple(bumper.name for bumper in bumpers if bumper.blocked)
