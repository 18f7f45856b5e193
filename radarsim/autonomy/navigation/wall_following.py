"""Wall following: drive along the boundary of an obstacle at a constant distance.

Theory of operation
===================
The rules are those of the thesis: with a side bumper pressed, drive along the boundary;
after losing the boundary, drive towards it; with the front bumper pressed as well, turn
away until it is released. Before that the robot aligns itself: it turns on the spot
until the obstacle that it hit is at its side.

To drive along a boundary means to keep its nearest point at the robot's side, at a
distance in the middle of the band. So the robot's path is the boundary, offset outward
by that
distance: around an outer corner or the end of a thin wall it is an arc about the
nearest point, and in an inner corner it turns from one wall to the next. In a gap the
robot keeps to the middle, if that is the safety distance from both sides.

Rule 1: everything is computed for a boundary on the left and a robot that goes forward.
For the other side the scan is mirrored, and for going backward it is rotated by pi.
Rule 2: the boundary is where the nearest beam ends, not the nearest share of beams: the
end of a thin wall may reflect only one or two beams. Rule 3: obstacles ahead are judged
in the direction of the next step, not in the direction that the robot faces: of all
directions in which the next step is clear, the closest to the boundary's direction is
chosen. So the robot does not oscillate in corners. Rule 4: a robot that heads for a
goal must not enter a gap that a wall follower would not enter, or it might never pass
its hit point again. So a wall follower drives through all gaps that are twice the
safety distance wide, plus 0.4 m for turning and noise.

The literal method of the thesis follows a boundary by the pressed bumpers alone.

Theory of operation of the literal method
=========================================
While only the bumper on the boundary's side is pressed, the robot drives straight on.
When that bumper is released, the robot is too far from the boundary and turns towards
it. When the front bumper is pressed as well, the robot turns away on the spot until the
back bumper is pressed instead. When the front bumper alone is pressed, the robot turns
until only the side bumper is pressed.

Three rules are added for obstacles that the thesis does not mention: the robot turns
away from a side that is too near, stops to turn if an obstacle ahead is too near, and
ends a turn after a full circle if no bumper ends it.

Source: a thesis on navigation with a radar in USARSim, section 5.2.
"""

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.autonomy.navigation.bumpers import BAND, Bumpers
from radarsim.autonomy.navigation.control import SpeedLimits, Twist
from radarsim.autonomy.navigation.observation import Observation, wrap_angles
from radarsim.autonomy.navigation.open_directions import leads_too_near
from radarsim.geometry import Floats, Point, wrap_angle

DISTANCE_GAIN = 1.5  # rad towards the boundary for each m beyond the target distance
MAX_TURN = 0.8  # rad; largest correction of the heading
HEADING_STEP = math.radians(5.0)  # between two tested directions
ABEAM = math.pi / 2
ALIGNED = math.radians(15.0)
CORNER_DEPTH = 0.15  # m beyond the nearest point that belong to a boundary
SIDE_ANGLE = math.radians(10.0)  # off the heading; the other side of a gap begins there
# A direction at a smaller angle to the nearest point leads into the boundary.
FACING_ANGLE = math.radians(60.0)
_LOST_MARGIN = 0.1  # m beyond the band, after which a boundary is lost
_STEP_TOLERANCE = 0.02  # m of tolerance when a step is checked
_EQUAL_RANGE = 0.05  # m between ranges that count as equally near
_AHEAD: Final = (-math.pi / 4, 0.0, math.pi / 4)  # rad; directions to keep free
_AWAY: Final = 0.5  # share of the highest turn rate, away from a side that is too near


class WallFollower:
    """Computes the motions of a robot along the boundary of an obstacle.

    Attributes:
        bumpers: The bumpers that detect the boundary.
        speed_limits: Highest speeds.
        wall_on_left: Whether the boundary is on the left of a robot that goes forward.
        forward: Whether the robot goes forward.
    """

    def __init__(
        self,
        bumpers: Bumpers,
        speed_limits: SpeedLimits,
        *,
        wall_on_left: bool = True,
    ) -> None:
        self.bumpers = bumpers
        self.speed_limits = speed_limits
        self.wall_on_left = wall_on_left
        self.forward = True

    @property
    def _mirrored(self) -> bool:
        # If the robot drives backward, its left side is on the right of its motion.
        return self.wall_on_left != self.forward

    def _view(self, observation: Observation) -> Observation:
        """Return the scan rotated and mirrored, so that the boundary is on the left."""
        bearings = observation.bearings
        bearings = bearings if self.forward else bearings + math.pi
        bearings = wrap_angles(-bearings if self._mirrored else bearings)
        return Observation(
            observation.time, observation.pose, bearings, observation.ranges
        )

    def _twist(self, speed: float, turn: float) -> Twist:
        """Convert speed and turn rate in the mirrored view to a twist of the robot."""
        speed = speed if self.forward else -speed
        return Twist(speed, -turn if self._mirrored else turn)

    def _bearing(self, bearing: float) -> float:
        """Convert a bearing, rad, from the mirrored view to the robot, or back.

        The conversion is its own inverse, apart from whole turns.
        """
        bearing = -bearing if self._mirrored else bearing
        return bearing if self.forward else bearing + math.pi

    @property
    def target_distance(self) -> float:
        """Distance, m, at which the robot follows the boundary in open space."""
        return self.bumpers.safety_distance + BAND / 2

    def step(
        self, observation: Observation, obstacle: Observation | None = None
    ) -> tuple[Twist, bool]:
        """Return the motion of the robot along the boundary until the next scan.

        Args:
            observation: The newest scan.
            obstacle: The part of the scan with the boundary; by default the whole scan.

        Returns:
            The motion, and whether the boundary is in view; otherwise the motion leads
            towards it.
        """
        view = self._view(observation)
        boundary = self._boundary(view if obstacle is None else self._view(obstacle))
        if boundary is None:
            # The boundary is out of view, so the robot
            # drives an arc around its last corner.
            speed = self.speed_limits.speed
            return self._twist(speed, speed / self.target_distance), False
        # Rule 3: obstacles are judged in the direction of the next step.
        heading = self._clear_heading(view, self._along(view, *boundary))
        # If the robot already faces the heading, but an obstacle there is too near,
        # another heading is chosen. Otherwise the robot would stand forever.
        is_too_near = self.bumpers.towards(view, 0.0).too_near
        if abs(heading) < ALIGNED and is_too_near:
            heading = self._way_out(view, heading)
        # The heading is limited instead of wrapped, since a full turn would wrap to 0.
        twist = self.speed_limits.towards(max(-math.pi, min(math.pi, heading)))
        # The robot does not drive nearer to an obstacle that it turns away from.
        leads_there = leads_too_near(view, self.bumpers.safety_distance)
        speed = 0.0 if is_too_near or leads_there else twist.speed
        return self._twist(speed, twist.turn), True

    def align(self, observation: Observation, obstacle: float) -> tuple[Twist, bool]:
        """Turn the robot on the spot until an obstacle is at its side.

        Args:
            observation: The newest scan.
            obstacle: Bearing of the obstacle, rad from the robot's front.

        Returns:
            The motion, and whether the robot is aligned.
        """
        heading = wrap_angle(self._abeam_heading(self._view(observation), obstacle))
        twist = self.speed_limits.towards(heading)
        return self._twist(0.0, twist.turn), abs(heading) < ALIGNED

    def tangent(self, observation: Observation) -> float:
        """Return the direction along the boundary, rad in the map frame, not wrapped.

        Without a boundary, the direction of motion is returned.
        """
        boundary = self._boundary(self._view(observation))
        heading = 0.0 if boundary is None else boundary[0] - ABEAM
        return observation.pose.yaw + self._bearing(heading)

    def boundary(self, observation: Observation) -> tuple[Point, float] | None:
        """Return the nearest boundary point, m, map frame, and its distance, m.

        None is returned without a boundary.
        """
        boundary = self._boundary(self._view(observation))
        if boundary is None:
            return None
        bearing, distance = boundary
        return observation.pose.point(self._bearing(bearing), distance), distance

    def hit(self, observation: Observation, obstacle: float) -> tuple[Point, float]:
        """Return an obstacle's nearest point, and the direction along its surface.

        The arguments are those of ``align``.

        Returns:
            The point, m, and the direction, rad, map frame.
        """
        heading = self._abeam_heading(self._view(observation), obstacle)
        bearing = self._bearing(heading + ABEAM)
        distance = self.bumpers.towards(observation, bearing).distance
        distance = min(distance, self.bumpers.pressed_below)
        along = observation.pose.yaw + self._bearing(heading)
        return observation.pose.point(bearing, distance), along

    def leads_into_boundary(self, observation: Observation, bearing: float) -> bool:
        """Return whether a robot that drives in a direction would meet the boundary.

        The other side of a gap is ignored.

        Args:
            observation: The newest scan.
            bearing: The direction, rad from the robot's front.
        """
        view = self._view(observation)
        boundary = self._boundary(view)
        if boundary is None:
            return False
        # A corner slightly farther than the nearest point is part of the same boundary.
        side = self._near_side(view) & (view.ranges <= boundary[1] + CORNER_DEPTH)
        offsets = wrap_angles(view.bearings[side] - self._bearing(bearing))
        return bool((np.abs(offsets) <= FACING_ANGLE).any())

    def _near_side(self, view: Observation) -> NDArray[np.bool_]:
        """Return which beams, as (N,) booleans, point ahead or to the left."""
        # Straight behind the robot, bearings jump from pi to -pi. The left side
        # includes some beams beyond this jump.
        left: NDArray[np.bool_] = view.bearings >= -SIDE_ANGLE
        return left | (view.bearings < self.bumpers.width / 2 - math.pi)

    def _abeam_heading(self, view: Observation, obstacle: float) -> float:
        """Return the heading, rad, that puts an obstacle at the robot's side."""
        centre = self._bearing(obstacle)
        # An obstacle that the robot has hit is ahead,
        # and any other obstacle is beside the path.
        ahead = self.bumpers.towards(view, centre).blocked
        half_width = (0.5 if ahead else 1.5) * self.bumpers.width
        within = np.abs(wrap_angles(view.bearings - centre)) <= half_width
        ranges = np.where(within, view.ranges, math.inf)
        if not np.isfinite(ranges).any():
            return centre - ABEAM
        # Several beams are about as short as the shortest one, which changes by noise.
        # The mean of their bearings is steadier.
        nearest = ranges <= ranges.min() + _EQUAL_RANGE
        return _mean_bearing(view.bearings[nearest]) - ABEAM

    def _boundary(self, view: Observation) -> tuple[float, float] | None:
        """Return bearing, rad, and range, m, of the nearest point ahead or left."""
        left = self._near_side(view)
        ranges, bearings = view.ranges[left], view.bearings[left]
        if not len(ranges) or ranges.min() >= self.bumpers.pressed_below + _LOST_MARGIN:
            return None
        distance = float(ranges.min())
        return _mean_bearing(bearings[ranges <= distance + _EQUAL_RANGE]), distance

    def _along(self, view: Observation, bearing: float, distance: float) -> float:
        """Return the heading, rad, that keeps the boundary at the target distance."""
        # The boundary is on the left, so the other side of a gap is on the right.
        offsets = wrap_angles(view.bearings - bearing + ABEAM)
        other = (offsets < -SIDE_ANGLE) & (offsets > SIDE_ANGLE - math.pi)
        # Directions within ``SIDE_ANGLE`` of the boundary are excluded, since the
        # boundary itself is seen there at a flat angle.
        other &= np.isfinite(view.ranges)
        x, y = _end_points(view.bearings[other], view.ranges[other])
        x -= distance * math.cos(bearing)
        y -= distance * math.sin(bearing)
        gap = float(np.hypot(x, y).min(initial=math.inf))
        # In a narrow gap the robot keeps to the middle. If the gap is too narrow for
        # that, the robot keeps the safety distance from the boundary.
        half = max(gap / 2, self.bumpers.safety_distance)
        # A positive value turns to the left, towards the boundary.
        turn = DISTANCE_GAIN * (distance - min(self.target_distance, half))
        return bearing - ABEAM + max(-MAX_TURN, min(MAX_TURN, turn))

    def _clear_heading(self, view: Observation, heading: float) -> float:
        """Return a heading turned from the boundary until the next step is clear.

        A step is clear if afterwards no point is closer than the safety distance, or
        than the nearest point now.
        """
        near = view.ranges < self.bumpers.pressed_below
        if not near.any():
            return heading
        x, y = _end_points(view.bearings[near], view.ranges[near])
        least = min(self.bumpers.safety_distance, float(view.ranges[near].min()))
        # In an inner corner the heading leads along the next wall. Only turns to the
        # right are tried: the first clear heading is the closest to the boundary.
        headings = heading - HEADING_STEP * np.arange(int(2 * math.pi / HEADING_STEP))
        step = BAND / 2
        distances = np.hypot(
            x - step * np.cos(headings)[:, None], y - step * np.sin(headings)[:, None]
        )
        clear = np.flatnonzero(distances.min(axis=1) >= least - _STEP_TOLERANCE)
        if not len(clear):
            return heading - ABEAM  # enclosed: turn until an opening comes into view
        return float(headings[clear[0]])

    def _way_out(self, view: Observation, heading: float) -> float:
        """Return a heading turned from the boundary until nothing ahead is too near.

        A robot whose front bumper is too near does not move.
        """
        for count in range(1, int(2 * math.pi / HEADING_STEP)):
            other = heading - count * HEADING_STEP
            if not self.bumpers.towards(view, other).too_near:
                return other
        return heading - ABEAM


def _end_points(bearings: Floats, ranges: Floats) -> tuple[Floats, Floats]:
    """Return x and y of the end points of beams, m, from the robot's centre."""
    return ranges * np.cos(bearings), ranges * np.sin(bearings)


def _mean_bearing(bearings: Floats) -> float:
    x, y = float(np.cos(bearings).sum()), float(np.sin(bearings).sum())
    mean = math.atan2(y, x)
    # A boundary is on the left or behind, so the mean bearing must not jump there.
    return mean + 2 * math.pi if mean < -ABEAM else mean


class BumperWallFollower(WallFollower):
    """A ``WallFollower`` that uses only the bumpers instead of single ranges."""

    _is_turning = False
    _is_in_corner = False  # whether the side was pressed when the turn began
    _turned = 0.0  # rad; angle turned since the turn began
    _yaw = 0.0  # rad; yaw at the last step

    def align(self, observation: Observation, obstacle: float) -> tuple[Twist, bool]:
        """Turn the robot until only the bumper on the boundary's side is pressed.

        The turn also ends when the obstacle is at the robot's side, since obstacles
        that are not flat may press no bumper. See ``WallFollower.align`` for arguments
        and result.
        """
        self._is_turning = False
        twist, is_abeam = super().align(observation, obstacle)
        return twist, is_abeam or self._has_only_side(self._view(observation))

    def step(
        self, observation: Observation, _: Observation | None = None
    ) -> tuple[Twist, bool]:
        """Return the motion of the robot along the boundary until the next scan.

        Arguments and result are those of ``WallFollower.step``; bumpers do not
        distinguish obstacles, so all beams count.
        """
        view = self._view(observation)
        self._update_turn(view)
        found = self.boundary(observation) is not None
        return self._twist(*self._motion(view)), found

    def _update_turn(self, view: Observation) -> None:
        bumpers, yaw = self.bumpers, view.pose.yaw
        self._turned += abs(wrap_angle(yaw - self._yaw))
        self._yaw = yaw
        front, back = bumpers.towards(view, 0.0), bumpers.towards(view, math.pi)
        if not self._is_turning:
            near = any(bumpers.towards(view, angle).too_near for angle in _AHEAD)
            self._is_turning, self._turned = front.pressed or near, 0.0
            self._is_in_corner = bumpers.towards(view, math.pi / 2).pressed
        elif not front.blocked:
            only_side = not self._is_in_corner and self._has_only_side(view)
            # After a full circle the turn ends, since no bumper has ended it.
            is_over = back.pressed or only_side or self._turned >= 2 * math.pi
            self._is_turning = not is_over

    def _motion(self, view: Observation) -> tuple[float, float]:
        """Return speed, m/s, and turn rate, rad/s, along a boundary on the left."""
        limits = self.speed_limits
        if self._is_turning:
            return 0.0, -limits.turn
        side = self.bumpers.towards(view, math.pi / 2)
        if side.too_near:  # not in the thesis, whose robot would touch the wall
            return limits.speed / 2, -_AWAY * limits.turn
        if side.pressed:
            return limits.speed, 0.0
        return limits.speed, limits.speed / self.target_distance

    def _has_only_side(self, view: Observation) -> bool:
        bumpers = self.bumpers
        others = (0.0, math.pi, -math.pi / 2)
        return bumpers.towards(view, math.pi / 2).pressed and not any(
            bumpers.towards(view, angle).blocked for angle in others
        )
