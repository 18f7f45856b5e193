"""Drive all robots for a step: wheels, arcs and collisions, as machine code.

Robots move one after the other, in the order of spawning, so that a robot meets those
before it where they have gone and those after it where they still are.

The kinematics are those of skid steering, from the speeds of the left and right wheels,
and an angle between heading and motion that robots with a steering axle have.

Wheels reach their set-points at once: the set-point of a tick is the speed during that
tick. Collisions are not modelled here.
"""

import math
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose2
from radarsim.jit import Int, njit_cached, njit_inline
from radarsim.robots.collision import (
    MAX_SPEED,
    Surroundings,
    avoid_collision,
    enter_robots,
    is_rejected,
    is_touching,
    pose_of,
)
from radarsim.robots.footprint import MARGIN
from radarsim.robots.robot import (
    ASIDE,
    BLOCKED,
    LEFT_ANGLE,
    LEFT_SPIN,
    RADIUS,
    RIGHT_ANGLE,
    RIGHT_SPIN,
    ROBOT_GAP,
    SIDESLIP,
    TOUCHED,
    TRACK,
    UNKNOWN,
    VELOCITY_X,
    VELOCITY_Y,
    WALL_GAP,
    WHEEL_RADIUS,
    Place,
    X,
    Y,
)

if TYPE_CHECKING:
    from radarsim.robots.robot import Robot

_TURN: Final = 2 * math.pi
_MAX_SWEEP: Final = 0.05  # m; a longer step is split, not to jump over obstacles


@njit_inline
def advance(
    pose: Place, left: float, right: float, track: float, sideslip: float, dt: float
) -> Place:
    """Return the pose after one time step along the exact circular arc.

    Args:
        pose: x, y and yaw at the start of the step, m, rad.
        left: Ground speed of the left wheels, m/s.
        right: Ground speed of the right wheels, m/s.
        track: Effective distance between the wheel pairs, m; wider than the real one
            if the wheels slip sideways in a turn.
        sideslip: Angle from the heading to the motion of the centre, rad; the mean of
            the ground speeds is the part of its speed along the heading.
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
    direction = yaw + half
    if sideslip != 0.0:
        chord /= math.cos(sideslip)
        direction += sideslip
    return (
        x + chord * math.cos(direction),
        y + chord * math.sin(direction),
        _wrap(yaw + turn),
    )


@njit_inline
def _sidestep(pose: Place, wanted: Place, distance: float, turn: float) -> Place:
    """Return a wanted pose moved to the left, on the same arc as ``advance``."""
    half = turn / 2
    chord = distance * (math.sin(half) / half if half != 0.0 else 1.0)
    direction = pose[2] + half
    x, y, yaw = wanted
    return x - chord * math.sin(direction), y + chord * math.cos(direction), yaw


@njit_inline
def _wrap(angle: float) -> float:
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


@njit_cached
def sweep_rate(
    left: float, right: float, track: float, radius: float, sideslip: float = 0.0
) -> float:
    """Return an upper bound of the speed of a robot's fastest point, m/s.

    Args:
        left: Ground speed of the left wheels, m/s.
        right: Ground speed of the right wheels, m/s.
        track: Effective distance between the wheel pairs, m.
        radius: Distance of the farthest point from the centre, m.
        sideslip: As of ``advance``.
    """
    turn = abs(right - left) / track
    speed = abs(left + right) / 2
    if sideslip != 0.0:
        speed /= math.cos(sideslip)
    return speed + turn * radius


@njit_cached
def drive_robots(
    around: Surroundings, order: NDArray[np.int64], odometry: Floats, dt: float
) -> None:
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
        aside = robots[slot, ASIDE]
        if left == 0.0 and right == 0.0 and aside == 0.0:
            # Others may approach meanwhile: the next move measures the gap anew.
            robots[slot, ROBOT_GAP] = 0.0
            robots[slot, VELOCITY_X] = robots[slot, VELOCITY_Y] = 0.0
            continue
        # Also while something blocks the robot: its motors are stronger than its grip,
        # so that wheel odometry drifts there as it does on the original.
        robots[slot, LEFT_ANGLE] += left * dt
        robots[slot, RIGHT_ANGLE] += right * dt
        left *= robots[slot, WHEEL_RADIUS]
        right *= robots[slot, WHEEL_RADIUS]
        track, radius = robots[slot, TRACK], robots[slot, RADIUS]
        slip = robots[slot, SIDESLIP]
        sweep = (sweep_rate(left, right, track, radius, slip) + abs(aside)) * dt
        # In ticks of 10 ms that is one part, unless a point of the robot is
        # faster than 5 m/s. Splitting changes nothing, as arcs are exact.
        parts = max(1, math.ceil(sweep / _MAX_SWEEP))
        x, y = robots[slot, X], robots[slot, Y]
        for _ in range(parts):
            pose = pose_of(robots, slot)
            wanted = advance(pose, left, right, track, slip, dt / parts)
            if aside != 0.0:
                turn = (right - left) / track * dt / parts
                wanted = _sidestep(pose, wanted, aside * dt / parts, turn)
            _move(around, slot, wanted, sweep / parts, dt / parts)
        robots[slot, VELOCITY_X] = (robots[slot, X] - x) / dt
        robots[slot, VELOCITY_Y] = (robots[slot, Y] - y) / dt
    integrate_odometry(odometry, robots)


@njit_inline
def _move(
    around: Surroundings, slot: Int, wanted: Place, sweep: float, dt: float
) -> None:
    """Move a robot towards a pose, as far as it is free."""
    robots = around.robots
    closing = around.grid.limits[MAX_SPEED] * dt
    robots[slot, WALL_GAP] -= sweep
    robots[slot, ROBOT_GAP] -= sweep + closing
    # Nothing can be in reach before the gaps are used up (rules 1 and 2 of collisions).
    # Most moves end here. With a look for walls in each, a step would take twice as
    # long: row j of the benchmarks.
    robots_are_far = robots[slot, ROBOT_GAP] > MARGIN
    if robots_are_far and robots[slot, WALL_GAP] > MARGIN:
        robots[slot, BLOCKED] = False
    elif robots_are_far and is_rejected(robots, slot, wanted):
        # Still pushing against the same wall: it need not be looked at again.
        robots[slot, BLOCKED] = True
        return
    else:
        wanted = avoid_collision(around, slot, wanted, sweep)
    for axis in range(3):
        robots[slot, X + axis] = wanted[axis]


@njit_cached
def find_touched(
    around: Surroundings, order: NDArray[np.int64], slots: NDArray[np.int64]
) -> None:
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
    around: Surroundings,
    order: NDArray[np.int64],
    odometry: Floats,
    dt: float,
    steps: int,
    touched: NDArray[np.bool_],
) -> None:
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
    around: Surroundings,
    order: NDArray[np.int64],
    odometry: Floats,
    dt: float,
    steps: int,
    touched: NDArray[np.bool_],
) -> None:
    """Drive robots for several time steps as if no others were there.

    Arguments as of ``drive_on``.
    """
    for i in range(len(order)):
        alone = slice(i, i + 1)
        drive_on(around, order[alone], odometry, dt, steps, touched[alone])


# Columns of the table of odometry: slot of the robot, or FREE; distance between its
# left and right wheels, m; pose since the reset, m, rad; angles of the wheels at the
# pose, rad.
SLOT, SEPARATION, POSE_X, POSE_Y, POSE_YAW, POSE_LEFT, POSE_RIGHT = range(7)
ODOMETRY_COLUMNS = 7
FREE: Final = -1.0  # of a row without odometry


class WheelOdometry:
    """The odometry of one robot, which its fleet integrates in each step.

    Attributes:
        robot: The robot.
        row: Its row in the fleet's table of odometry, in which it stays.
    """

    def __init__(self, robot: "Robot", row: int) -> None:
        self.robot = robot
        self.row = row

    @property
    def pose(self) -> Pose2:
        """Pose relative to that of the spawn or reset, m and rad, not wrapped."""
        return Pose2(*self._numbers[POSE_X : POSE_YAW + 1].tolist())

    def reset(self) -> None:
        """Make the pose of the last step the new origin."""
        self._numbers[POSE_X : POSE_YAW + 1] = 0.0

    @property
    def _numbers(self) -> Floats:
        numbers: Floats = self.robot.fleet.odometry[self.row]
        return numbers


@njit_inline
def integrate_odometry(odometry: Floats, robots: Floats) -> None:
    """Advance all odometry to the present angles of the wheels.

    The motion since the last step is one circular arc, which is exact as long as the
    wheel speeds are constant in between.
    """
    for row in range(len(odometry)):
        slot = int(odometry[row, SLOT])
        if slot < 0:
            continue
        left, right = robots[slot, LEFT_ANGLE], robots[slot, RIGHT_ANGLE]
        left_turn = left - odometry[row, POSE_LEFT]
        right_turn = right - odometry[row, POSE_RIGHT]
        if left_turn == 0.0 and right_turn == 0.0:
            continue
        left_distance = robots[slot, WHEEL_RADIUS] * left_turn
        right_distance = robots[slot, WHEEL_RADIUS] * right_turn
        turn = (right_distance - left_distance) / odometry[row, SEPARATION]
        half = turn / 2
        chord = (left_distance + right_distance) / 2
        chord *= math.sin(half) / half if half != 0.0 else 1.0
        heading = odometry[row, POSE_YAW] + half
        odometry[row, POSE_X] += chord * math.cos(heading)
        odometry[row, POSE_Y] += chord * math.sin(heading)
        odometry[row, POSE_YAW] += turn
        odometry[row, POSE_LEFT] = left
        odometry[row, POSE_RIGHT] = right
