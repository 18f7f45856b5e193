"""The thesis' literal way to follow a boundary: by which bumpers are pressed, no more.

Theory of operation
===================
With only the bumper on the boundary's side pressed, the robot drives straight on. Where
that bumper is released, it has gone too far from the boundary and turns towards it.
Where the front one is pressed as well, it turns away on the spot until the back one is
pressed instead; where the front one alone was, until only the side one is.

Three things are added, without which it would hit what the thesis does not mention: it
turns away from a side that is too near, stops to turn for whatever is too near ahead,
and ends a turn that no bumper ends after a whole circle.

Source: a thesis on navigation with a radar in USARSim, section 5.2.
"""

import math
from typing import Final

from radarsim.geometry import wrap_angle
from radarsim.navigation.control import Twist
from radarsim.navigation.observation import Observation
from radarsim.navigation.wall_following import FollowMode, WallFollower

_AHEAD: Final = (-math.pi / 4, 0.0, math.pi / 4)  # rad; where nothing may be too near
_AWAY: Final = 0.5  # of the greatest turn rate, with which it leaves a side too near


class BumperWallFollower:
    """Follows a boundary as a ``WallFollower`` does, by the states of bumpers alone."""

    def __init__(self, follower: WallFollower) -> None:
        """Create it.

        Args:
            follower: Has bumpers and limits, and aligns where no bumper is pressed.
        """
        self._follower = follower
        self._is_turning = False
        self._is_in_corner = False  # whether the turn began with the side pressed
        self._turned = 0.0  # rad since the turn began
        self._yaw = 0.0  # rad; of the last step

    def align(
        self, observation: Observation, mode: FollowMode, obstacle: float
    ) -> tuple[Twist, bool]:
        """Turn until only the bumper on the boundary's side is pressed.

        Or until the obstacle is abeam: those that are not flat may press none.
        Arguments and result are those of ``WallFollower.align``.
        """
        self._is_turning = False
        twist, is_abeam = self._follower.align(observation, mode, obstacle)
        return twist, is_abeam or self._has_only_side(mode.canonical(observation))

    def step(
        self,
        observation: Observation,
        mode: FollowMode,
        _: Observation | None = None,
    ) -> tuple[Twist, bool]:
        """Compute the motion until the next scan.

        Arguments and result are those of ``WallFollower.step``; bumpers do not tell
        obstacles apart, so all beams count.
        """
        view = mode.canonical(observation)
        self._update_turn(view)
        speed, turn = self._motion(view)
        found = self._follower.boundary(observation, mode) is not None
        return mode.robot_twist(Twist(speed, turn)), found

    def _update_turn(self, view: Observation) -> None:
        """Begin and end turns on the spot."""
        bumpers, yaw = self._follower.bumpers, view.pose.yaw
        self._turned += abs(wrap_angle(yaw - self._yaw))
        self._yaw = yaw
        front, back = bumpers.towards(view, 0.0), bumpers.towards(view, math.pi)
        if not self._is_turning:
            near = any(bumpers.towards(view, angle).too_near for angle in _AHEAD)
            self._is_turning, self._turned = front.pressed or near, 0.0
            self._is_in_corner = bumpers.towards(view, math.pi / 2).pressed
        elif not front.blocked:
            only_side = not self._is_in_corner and self._has_only_side(view)
            is_over = back.pressed or only_side or self._turned >= 2 * math.pi
            self._is_turning = not is_over

    def _motion(self, view: Observation) -> tuple[float, float]:
        """Return speed, m/s, and turn rate, rad/s, for a boundary on the left."""
        limits = self._follower.speed_limits
        if self._is_turning:
            return 0.0, -limits.turn
        side = self._follower.bumpers.towards(view, math.pi / 2)
        if side.too_near:
            return limits.speed / 2, -_AWAY * limits.turn
        if side.pressed:
            return limits.speed, 0.0
        return limits.speed, limits.speed / self._follower.target_distance

    def _has_only_side(self, view: Observation) -> bool:
        bumpers = self._follower.bumpers
        others = (0.0, math.pi, -math.pi / 2)
        return bumpers.towards(view, math.pi / 2).pressed and not any(
            bumpers.towards(view, angle).blocked for angle in others
        )
