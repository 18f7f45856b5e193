"""Kinematics of skid steering: motion from the speeds of the left and right wheels.

Wheels reach their set-points at once: the set-point of a tick is the speed during that
tick. Collisions are not modelled here.
"""

import math
from typing import Any, Final

from radarsim.jit import njit_inline

_TURN: Final = 2 * math.pi


@njit_inline
def advance(pose: Any, left: Any, right: Any, track: Any, dt: Any) -> Any:
    """Return the pose after one time step along the exact circular arc.

    Args:
        pose: x, y and yaw at the start of the step, m, rad.
        left: Ground speed of the left wheels, m/s.
        right: Ground speed of the right wheels, m/s.
        track: Effective distance between the wheel pairs, m; wider than the real one
            if the wheels slip sideways in a turn.
        dt: Time step, s; two half steps give the same pose as one whole step.

    Returns:
        x, y and yaw at the end of the step, the yaw in (-pi, pi].

    Source: geometry of an arc; its chord is 2 (distance / turn) sin(turn / 2), and
    points half a turn off the heading at its start.
    """
    x, y, yaw = pose
    # y points left, so faster right wheels turn the robot counter-clockwise
    turn = (right - left) / track * dt
    half = turn / 2
    chord = (left + right) / 2 * dt * (math.sin(half) / half if half != 0.0 else 1.0)
    return (
        x + chord * math.cos(yaw + half),
        y + chord * math.sin(yaw + half),
        _wrap(yaw + turn),
    )


@njit_inline
def _wrap(angle: Any) -> Any:
    """Wrap an angle, rad, to (-pi, pi]; the same bits as ``geometry.wrap_angle``."""
    # The steps of C's remainder, each of them exact, which numba does not have.
    size = abs(angle)
    if size < math.pi:
        return angle
    rest = size % _TURN
    if rest > _TURN - rest:
        rest -= _TURN
    elif rest == _TURN - rest:  # half a turn: to the even number of turns
        rest -= 2.0 * (0.5 * (size - rest) % _TURN)
    wrapped = math.copysign(1.0, angle) * rest
    return math.pi if wrapped <= -math.pi else wrapped


@njit_inline
def sweep_rate(left: Any, right: Any, track: Any, radius: Any) -> Any:
    """Return an upper bound of the speed of a robot's fastest point, m/s.

    Args:
        left: Ground speed of the left wheels, m/s.
        right: Ground speed of the right wheels, m/s.
        track: Effective distance between the wheel pairs, m.
        radius: Distance of the farthest point from the centre, m.
    """
    turn = abs(right - left) / track
    return abs(left + right) / 2 + turn * radius
