"""Along the boundary of an obstacle, a bumper of one side pressed all the time.

Theory of operation
===================
The rules are the thesis': with a side bumper pressed, go along the boundary; where it
is lost, go towards it; where the front is pressed as well, turn away until it is off.
Before that the robot aligns itself: it turns on the spot until what it has hit is
abeam.

Along means that the nearest place of the boundary is abeam, and that its distance is
the middle of the band. So the robot's way is the boundary, moved outward by that
distance: around an outer corner or the end of a thin wall it is an arc about the
nearest place, and in an inner corner it turns from one wall to the next. In a gap it
keeps to the middle, as long as that is the safety distance from both sides.

Rule 1: everything is computed for a boundary on the left and a robot that goes forward.
For the other side the scan is mirrored, and for going backward it is turned round.
Rule 2: the boundary is where the nearest beam ends, and not the nearest share of beams:
the end of a thin wall has no more than one or two.
Rule 3: what is ahead counts in the direction that the robot is to take, not in the one
that it faces: of all directions in which the next step is clear, the nearest to the
boundary's is taken. So it does not waver in corners.
Rule 4: whoever heads for a goal must not get where a follower would not, or it might
never come by its hit point again. So a follower goes through all gaps that are twice
the safety distance wide, and 0.4 m for turning and noise.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, wrap_angle
from radarsim.navigation.bumpers import Bumpers
from radarsim.navigation.control import SpeedLimits, Twist
from radarsim.navigation.observation import Observation

DISTANCE_GAIN = 1.5  # rad towards the boundary for each m that it is too far
MOST_LEAN = 0.8  # rad
TRIED = math.radians(5.0)  # between directions that are tried
ABEAM = math.pi / 2
ALIGNED = math.radians(15.0)
CORNER = 0.15  # m farther than the nearest place of a boundary, and still at hand
ASIDE = math.radians(10.0)  # from the way, where the other side of a gap begins
FACING = math.radians(60.0)  # from the boundary's direction: still towards it
_SLACK = 0.1  # m beyond the band in which a boundary is not lost yet
_ROUGH = 0.02  # m that a step may come nearer than is allowed
_ALIKE = 0.05  # m within which places of the boundary count as equally near


@dataclass(frozen=True, slots=True)
class FollowMode:
    """How to go along: with the boundary on which hand, and forward or backward."""

    wall_on_left: bool = True
    forward: bool = True

    @property
    def reversed(self) -> "FollowMode":
        """The same boundary on the same hand, the other way along."""
        return FollowMode(self.wall_on_left, not self.forward)

    @property
    def _mirrored(self) -> bool:
        # going backward, what is on the robot's left is on the right of its way
        return self.wall_on_left != self.forward

    def seen(self, observation: Observation) -> Observation:
        """Turn and mirror a scan, so that the boundary is on the left of the way."""
        bearings = (
            observation.bearings if self.forward else observation.bearings + math.pi
        )
        bearings = -bearings if self._mirrored else bearings
        bearings = np.remainder(bearings + math.pi, 2 * math.pi) - math.pi
        return Observation(
            observation.time, observation.pose, bearings, observation.ranges
        )

    def told(self, twist: Twist) -> Twist:
        """Turn and mirror a motion back."""
        speed = twist.speed if self.forward else -twist.speed
        return Twist(speed, -twist.turn if self._mirrored else twist.turn)

    def bearing(self, seen: float) -> float:
        """Turn and mirror a bearing back, rad; any number of turns."""
        seen = -seen if self._mirrored else seen
        return seen if self.forward else seen + math.pi


@dataclass(frozen=True, slots=True)
class Boundary:
    """The nearest place of the boundary: its bearing, rad, and its distance, m."""

    bearing: float
    distance: float


@dataclass(frozen=True, slots=True)
class WallFollower:
    """Goes along boundaries.

    Attributes:
        bumpers: What is sensed by.
        speed_limits: How fast.
    """

    bumpers: Bumpers
    speed_limits: SpeedLimits

    @property
    def wanted(self) -> float:
        """Distance of the boundary that is kept where there is room, m."""
        return self.bumpers.safety_distance + self.bumpers.band / 2

    def step(self, observation: Observation, mode: FollowMode) -> tuple[Twist, bool]:
        """Decide how to move.

        Returns:
            The motion, and whether the boundary is there; where it is not, the motion
            leads towards it.
        """
        seen = mode.seen(observation)
        boundary = self._boundary(seen)
        if boundary is None:
            # the circle that a corner out of sight would ask for
            speed = self.speed_limits.speed
            return mode.told(Twist(speed, speed / self.wanted)), False
        heading = self._clear_heading(seen, self._along(seen, boundary))
        return mode.told(self._move(seen, heading)), True

    def align(
        self, observation: Observation, mode: FollowMode, obstacle: float
    ) -> tuple[Twist, bool]:
        """Turn on the spot until the obstacle is abeam.

        Args:
            observation: What is around.
            mode: How to go along afterwards.
            obstacle: Direction in which the obstacle is, rad from the robot's front.

        Returns:
            The motion, and whether that is done.
        """
        seen = mode.seen(observation)
        ahead = wrap_angle(self._sidelong(seen, mode, obstacle))
        twist = self.speed_limits.towards(ahead)
        return mode.told(Twist(0.0, twist.turn)), abs(ahead) < ALIGNED

    def direction(
        self, observation: Observation, mode: FollowMode, obstacle: float
    ) -> float:
        """Give the direction along an obstacle, rad, map frame; arguments as above."""
        ahead = self._sidelong(mode.seen(observation), mode, obstacle)
        return observation.pose.yaw + mode.bearing(ahead)

    def tangent(self, observation: Observation, mode: FollowMode) -> float:
        """Give the direction along the boundary, rad, map frame; any number of turns.

        Where there is no boundary it is the way ahead.
        """
        boundary = self._boundary(mode.seen(observation))
        ahead = 0.0 if boundary is None else boundary.bearing - ABEAM
        return observation.pose.yaw + mode.bearing(ahead)

    def faces(self, observation: Observation, mode: FollowMode, bearing: float) -> bool:
        """Tell whether a direction leads into the boundary that is followed.

        What is on the other side of a gap is another matter.

        Args:
            observation: What is around.
            mode: How it is followed.
            bearing: The direction, rad from the robot's front.
        """
        seen = mode.seen(observation)
        boundary = self._boundary(seen)
        if boundary is None:
            return False
        side = self._side(seen) & (seen.ranges <= boundary.distance + CORNER)
        apart = seen.bearings[side] - mode.bearing(bearing)  # they undo themselves
        apart = np.remainder(apart + math.pi, 2 * math.pi) - math.pi
        return bool((np.abs(apart) <= FACING).any())

    def _side(self, seen: Observation) -> NDArray[np.bool_]:
        """Tell which beams look ahead or to the left, (N,)."""
        left: NDArray[np.bool_] = seen.bearings >= -ASIDE
        return left | (seen.bearings < self.bumpers.width / 2 - math.pi)

    def _sidelong(self, seen: Observation, mode: FollowMode, obstacle: float) -> float:
        """Give the heading that brings the nearest of what is there abeam, rad."""
        centre = mode.bearing(obstacle)  # turning and mirroring undo themselves
        apart = np.remainder(seen.bearings - centre + math.pi, 2 * math.pi) - math.pi
        # what is ahead of the robot is what it hit; else it is beside its way
        ahead = self.bumpers.towards(seen, centre).blocked
        within = (0.5 if ahead else 1.5) * self.bumpers.width
        ranges = np.where(np.abs(apart) <= within, seen.ranges, math.inf)
        if not np.isfinite(ranges).any():
            return centre - ABEAM
        nearest = ranges <= ranges.min() + _ALIKE
        return _mean_bearing(seen.bearings[nearest]) - ABEAM

    def _boundary(self, seen: Observation) -> Boundary | None:
        """Find what is nearest ahead or on the left."""
        left = self._side(seen)
        ranges, bearings = seen.ranges[left], seen.bearings[left]
        if not len(ranges) or ranges.min() >= self.bumpers.pressed_below + _SLACK:
            return None
        distance = float(ranges.min())
        return Boundary(_mean_bearing(bearings[ranges <= distance + _ALIKE]), distance)

    def _along(self, seen: Observation, boundary: Boundary) -> float:
        """Give the heading that brings the boundary abeam, and to its distance."""
        half = max(self._gap(seen, boundary) / 2, self.bumpers.safety_distance)
        lean = DISTANCE_GAIN * (boundary.distance - min(self.wanted, half))
        lean = max(-MOST_LEAN, min(MOST_LEAN, lean))
        return boundary.bearing - ABEAM + lean

    def _gap(self, seen: Observation, boundary: Boundary) -> float:
        """Give how far what is on the other side is from the boundary's place, m."""
        apart = seen.bearings - boundary.bearing + ABEAM
        apart = np.remainder(apart + math.pi, 2 * math.pi) - math.pi
        other = (apart < -ASIDE) & (apart > ASIDE - math.pi) & np.isfinite(seen.ranges)
        if not other.any():
            return math.inf
        x, y = _places(seen.bearings[other], seen.ranges[other])
        x -= boundary.distance * math.cos(boundary.bearing)
        y -= boundary.distance * math.sin(boundary.bearing)
        return float(np.hypot(x, y).min())

    def _clear_heading(self, seen: Observation, heading: float) -> float:
        """Turn a heading away from the boundary until the next step is clear.

        Clear is a step after which nothing is nearer than the safety distance, or than
        what is already too near.
        """
        near = seen.ranges < self.bumpers.pressed_below
        if not near.any():
            return heading
        x, y = _places(seen.bearings[near], seen.ranges[near])
        least = min(self.bumpers.safety_distance, float(seen.ranges[near].min()))
        tried = heading - TRIED * np.arange(int(2 * math.pi / TRIED))
        step = self.bumpers.band / 2
        apart = np.hypot(
            x - step * np.cos(tried)[:, None], y - step * np.sin(tried)[:, None]
        )
        clear = np.flatnonzero(apart.min(axis=1) >= least - _ROUGH)
        if not len(clear):
            return heading - ABEAM  # walled in: turn, and hope for a way out
        return float(tried[clear[0]])

    def _move(self, seen: Observation, heading: float) -> Twist:
        twist = self.speed_limits.towards(max(-math.pi, min(math.pi, heading)))
        if self.bumpers.towards(seen, 0.0).too_near:
            return Twist(0.0, twist.turn)
        return twist


def _places(bearings: Floats, ranges: Floats) -> tuple[Floats, Floats]:
    """Give x and y of where beams ended, m, from the robot's centre."""
    return ranges * np.cos(bearings), ranges * np.sin(bearings)


def _mean_bearing(bearings: Floats) -> float:
    x, y = float(np.cos(bearings).sum()), float(np.sin(bearings).sum())
    mean = math.atan2(y, x)
    return mean + 2 * math.pi if mean < -ABEAM else mean
