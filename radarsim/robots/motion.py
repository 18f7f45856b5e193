"""Drive all robots for a step: wheels, arcs and collisions, as machine code.

Robots move one after the other, in the order of spawning, so that a robot meets those
before it where they have gone and those after it where they still are.
"""

import math
from typing import Any, Final

from radarsim.jit import njit_cached, njit_inline
from radarsim.robots.collision import avoid_collision, is_rejected, is_touching
from radarsim.robots.fleet_columns import (
    BLOCKED,
    LEFT_ANGLE,
    LEFT_SPIN,
    RADIUS,
    RIGHT_ANGLE,
    RIGHT_SPIN,
    ROBOT_GAP,
    TOUCHED,
    TRACK,
    UNKNOWN,
    WALL_GAP,
    WHEEL_RADIUS,
    X,
    pose_of,
)
from radarsim.robots.footprint import MARGIN
from radarsim.robots.odometry import integrate_odometry
from radarsim.robots.robot_grid import MAX_SPEED, enter_robots
from radarsim.robots.skid_steer import advance, sweep_rate

_MAX_SWEEP: Final = (
    0.05  # m; a longer step is split, so that no obstacle is jumped over
)


@njit_cached
def drive_robots(around: Any, order: Any, odometry: Any, dt: Any) -> Any:
    """Drive all robots for one time step.

    Args:
        around: The ``Surroundings``.
        order: (R,) slots of the robots, in the order in which they move.
        odometry: (M, 7) table of the odometry of some of them.
        dt: Time step, s.
    """
    robots = around.robots
    enter_robots(around.grid, robots, order, dt)
    for i in range(len(order)):
        slot = order[i]
        robots[slot, TOUCHED] = UNKNOWN
        left, right = robots[slot, LEFT_SPIN], robots[slot, RIGHT_SPIN]
        if left == 0.0 and right == 0.0:
            # Others may approach meanwhile: the next move measures the gap anew.
            robots[slot, ROBOT_GAP] = 0.0
            continue
        robots[slot, LEFT_ANGLE] += left * dt
        robots[slot, RIGHT_ANGLE] += right * dt
        left *= robots[slot, WHEEL_RADIUS]
        right *= robots[slot, WHEEL_RADIUS]
        track, radius = robots[slot, TRACK], robots[slot, RADIUS]
        sweep = sweep_rate(left, right, track, radius) * dt
        parts = max(1, math.ceil(sweep / _MAX_SWEEP))
        for _ in range(parts):
            wanted = advance(pose_of(robots, slot), left, right, track, dt / parts)
            _move(around, slot, wanted, sweep / parts, dt / parts)
    integrate_odometry(odometry, robots)


@njit_inline
def _move(around: Any, slot: Any, wanted: Any, sweep: Any, dt: Any) -> Any:
    """Move a robot towards a pose, as far as it is free."""
    robots = around.robots
    closing = around.grid.limits[MAX_SPEED] * dt
    robots[slot, WALL_GAP] -= sweep
    robots[slot, ROBOT_GAP] -= sweep + closing
    # Nothing can be in reach before the gaps are used up (rules 1 and 2 of collisions).
    robots_are_far = robots[slot, ROBOT_GAP] > MARGIN
    if robots_are_far and robots[slot, WALL_GAP] > MARGIN:
        robots[slot, BLOCKED] = False
    elif robots_are_far and is_rejected(robots, slot, wanted):
        robots[slot, BLOCKED] = True  # still pushing against the same wall
        return
    else:
        wanted = avoid_collision(around, slot, wanted, sweep)
    for axis in range(3):
        robots[slot, X + axis] = wanted[axis]


@njit_cached
def find_touched(around: Any, order: Any, slots: Any) -> Any:
    """Find which robots were blocked in their last move, or touch something.

    Args:
        around: The ``Surroundings``.
        order: (R,) slots of all robots.
        slots: (K,) slots of those that are asked for.
    """
    robots = around.robots
    enter_robots(around.grid, robots, order, 0.0)
    for i in range(len(slots)):
        slot = slots[i]
        if robots[slot, TOUCHED] == UNKNOWN:
            is_touched = robots[slot, BLOCKED] != 0.0 or is_touching(around, slot)
            robots[slot, TOUCHED] = 1.0 if is_touched else 0.0


@njit_cached
def drive_on(
    around: Any, order: Any, odometry: Any, dt: Any, steps: Any, touched: Any
) -> Any:
    """Drive robots for several time steps.

    Args:
        around: The ``Surroundings``.
        order: (R,) slots of the robots, in the order in which they move.
        odometry: (M, 7) table of the odometry of some of them.
        dt: Time step, s.
        steps: Number of time steps.
        touched: (R,) bool; set for robots that are touched after any of the steps.
    """
    for _ in range(steps):
        drive_robots(around, order, odometry, dt)
        find_touched(around, order, order)
        for i in range(len(order)):
            touched[i] |= around.robots[order[i], TOUCHED] == 1.0


@njit_cached
def drive_each_alone(
    around: Any, order: Any, odometry: Any, dt: Any, steps: Any, touched: Any
) -> Any:
    """Drive robots for several time steps as if no others were there.

    Arguments as of ``drive_on``.
    """
    for i in range(len(order)):
        alone = slice(i, i + 1)
        drive_on(around, order[alone], odometry, dt, steps, touched[alone])
