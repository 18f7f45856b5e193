"""Move a robot among walls and other robots without collision.

Theory of operation
===================
A move that is free is made as it is. One that would penetrate something is pushed out
along the shortest direction, so that the robot slides; where that fails the robot turns
on the spot, and where that is blocked too it stays. Every pose that is taken is free,
so a robot can always back out of a contact.

Rule 1: no point of the robot travels farther in a move than its ``sweep``. So once the
gap to the nearest wall is known, walls need not be checked again before the sweeps add
up to it; that makes moves on the open floor cheap.
Rule 2: a move displaces the centre by at most ``MAX_DISPLACEMENT_RATIO`` sweeps, so the
same holds for the gap to the other robots, which move as well.

The robots near a place are found by a grid of square cells.

Cells are found by a hash of their place, so that the floor may be of any size. Robots
are entered once in each step, and cells are searched a little farther than asked for,
as robots move within the step.
"""

import math
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import Int, njit_cached, njit_inline
from radarsim.robots.footprint import (
    HALF_X,
    HALF_Y,
    MARGIN,
    MIDDLE_X,
    MIDDLE_Y,
    RANK,
    find_contact,
)
from radarsim.robots.robot import (
    BLOCKED,
    BOTTOM,
    FLOOR,
    HALF_LENGTH,
    HALF_WIDTH,
    MAX_DISPLACEMENT_RATIO,
    NUMBER,
    RADIUS,
    REJECTED,
    ROBOT_GAP,
    TOP,
    TOP_SPEED,
    WALL_GAP,
    YAW,
    Place,
    X,
    Y,
)
from radarsim.robots.wall_grid import WallTable, find_walls

ROBOT_RANGE: Final = 4.0  # m between the circles of two robots that find each other
COLUMN, ROW, NEXT = range(3)  # columns of ``places``
CELL, REACH, MAX_SPEED = range(3)  # items of ``limits``

_MIN_CELL: Final = 2.0  # m
_CELLS_IN_REACH: Final = 3
CONTACT_GAP: Final = 1e-3  # m left between the robot and what it runs into
TOUCH_RANGE: Final = 2e-3  # m; anything closer touches the robot
WALL_RANGE: Final = 0.5  # m beyond the robot's circle within which walls are found
_OUTLINE_RANGE: Final = 0.1  # m between the circles below which outlines matter
_MAX_PUSHES: Final = 8  # out of two walls in turn; more would not get out of a wedge


class RobotGrid(NamedTuple):
    """Robots by cells.

    N is the number of rows of the table of robots, B a power of two.

    Attributes:
        heads: (B,) slot of the first robot of each bucket of cells; -1 for none.
        places: (N, 3) column and row of each robot's cell, and the slot of the next
            robot in the same bucket; -1 for none.
        limits: (3,) size of a cell, m; how far cells are searched on each axis, beyond
            the radius of the robot that searches, m; the highest top speed, m/s.
    """

    heads: NDArray[np.int64]
    places: NDArray[np.int64]
    limits: Floats


def new_robot_grid(slots: int) -> RobotGrid:
    """Return a grid for robots in some slots."""
    buckets = 1 << slots.bit_length()
    places = np.zeros((slots, 3), np.int64)
    return RobotGrid(np.full(buckets, -1, np.int64), places, np.zeros(3))


@njit_inline
def pose_of(robots: Floats, slot: Int) -> Place:
    """Return x, y and yaw of a robot."""
    return robots[slot, X], robots[slot, Y], robots[slot, YAW]


@njit_inline
def bucket_of(grid: RobotGrid, column: int, row: int) -> int:
    """Return the bucket of a cell."""
    # Two large primes spread neighbours; the number of buckets is a power of two.
    return (column * 73856093 ^ row * 19349663) & (len(grid.heads) - 1)


@njit_inline
def enter_robots(
    grid: RobotGrid, robots: Floats, order: NDArray[np.int64], dt: float
) -> None:
    """Enter all robots where they are.

    Args:
        grid: The ``RobotGrid``.
        robots: The table of robots.
        order: (R,) slots of the robots.
        dt: Longest time for which robots drive before they are entered again, s.
    """
    for bucket in range(len(grid.heads)):
        grid.heads[bucket] = -1
    radius = speed = 0.0
    for i in range(len(order)):
        radius = max(radius, robots[order[i], RADIUS])
        speed = max(speed, robots[order[i], TOP_SPEED])
    reach = ROBOT_RANGE + radius + speed * dt  # they move before they are searched
    cell = max(_MIN_CELL, reach / _CELLS_IN_REACH)
    grid.limits[CELL], grid.limits[REACH] = cell, reach
    grid.limits[MAX_SPEED] = speed
    for i in range(len(order)):
        slot = order[i]
        column = math.floor(robots[slot, X] / cell)
        row = math.floor(robots[slot, Y] / cell)
        bucket = bucket_of(grid, column, row)
        grid.places[slot, COLUMN] = column
        grid.places[slot, ROW] = row
        grid.places[slot, NEXT] = grid.heads[bucket]
        grid.heads[bucket] = slot


class Surroundings(NamedTuple):
    """What a robot may run into.

    Attributes:
        robots: The table of robots.
        walls: The walls of all floors.
        grid: The robots by cells.
        lines: Room for a table of the lines near a robot.
    """

    robots: Floats
    walls: WallTable
    grid: RobotGrid
    lines: Floats


@njit_inline
def is_rejected(robots: Floats, slot: Int, wanted: Place) -> bool:
    """Return whether walls forbade the same move the last time."""
    for i in range(3):
        is_same_start = robots[slot, X + i] == robots[slot, REJECTED + i]
        if not is_same_start or wanted[i] != robots[slot, REJECTED + 3 + i]:
            return False
    return True


@njit_cached
def avoid_collision(
    around: Surroundings, slot: Int, wanted: Place, sweep: float
) -> Place:
    """Return the pose that a robot reaches when it moves towards another.

    Args:
        around: The ``Surroundings``.
        slot: Slot of the robot.
        wanted: Pose to which its wheels would take it: x, y, yaw, m, rad.
        sweep: Largest distance that any point of the robot travels, m; at most a
            fraction of its width, or it could pass through obstacles.
    """
    robots = around.robots
    walls, count = _find_lines(around, slot, wanted)
    gap, _, _ = _contact(around, slot, count, wanted)
    _note_gaps(robots, slot, gap, 0.0, count > walls)
    robots[slot, BLOCKED] = gap <= MARGIN
    if gap > MARGIN:
        return wanted
    start = pose_of(robots, slot)
    reached = _avoid(around, slot, count, wanted, sweep)
    if _is_same(reached, start):
        reached = start
        # Noted only if walls forbade it: a robot in the way may be gone next time.
        for i in range(3):
            by_walls = count == walls
            robots[slot, REJECTED + i] = robots[slot, X + i] if by_walls else np.nan
            robots[slot, REJECTED + 3 + i] = wanted[i]
    gap, _, _ = _contact(around, slot, count, reached)
    # Lines were searched around the wanted pose: around the one that was reached, less
    # is known by the distance between both.
    offset = math.hypot(reached[0] - wanted[0], reached[1] - wanted[1])
    _note_gaps(robots, slot, gap, offset, count > walls)
    return reached


@njit_cached
def is_touching(around: Surroundings, slot: Int) -> bool:
    """Return whether something solid is as close as after a contact."""
    robots = around.robots
    if min(robots[slot, WALL_GAP], robots[slot, ROBOT_GAP]) > TOUCH_RANGE:
        return False
    pose = pose_of(robots, slot)
    walls, count = _find_lines(around, slot, pose)
    gap, _, _ = _contact(around, slot, count, pose)
    _note_gaps(robots, slot, gap, 0.0, count > walls)
    return bool(gap <= TOUCH_RANGE)


@njit_inline
def _contact(
    around: Surroundings, slot: Int, count: Int, pose: Place
) -> tuple[float, float, float]:
    robots = around.robots
    half_size = (robots[slot, HALF_LENGTH], robots[slot, HALF_WIDTH])
    return find_contact(around.lines, count, pose, half_size)


@njit_inline
def _note_gaps(
    robots: Floats, slot: Int, gap: float, offset: float, has_robots: bool
) -> None:
    """Update the known gaps by that to lines found ``offset`` m away."""
    robots[slot, WALL_GAP] = min(gap, WALL_RANGE - offset)
    if has_robots:
        robots[slot, ROBOT_GAP] = min(gap, robots[slot, ROBOT_GAP])


@njit_inline
def _is_same(one: Place, other: Place) -> bool:
    """Return whether two poses differ by no more than rounding."""
    difference = abs(one[0] - other[0]) + abs(one[1] - other[1])
    return difference + abs(one[2] - other[2]) < 1e-9


@njit_cached
def _find_lines(around: Surroundings, slot: Int, pose: Place) -> tuple[int, int]:
    """Find the lines near a pose; robots farther away set the gap to robots.

    Returns:
        The number of walls, which come first, and that of all lines.
    """
    robots, grid = around.robots, around.grid
    x, y, _ = pose
    radius, floor = robots[slot, RADIUS], int(robots[slot, FLOOR])
    walls = find_walls(around.walls, floor, x, y, radius + WALL_RANGE, around.lines)
    count, nearest = walls, ROBOT_RANGE
    reach, cell = radius + grid.limits[REACH], grid.limits[CELL]
    first, last = math.floor((x - reach) / cell), math.floor((x + reach) / cell)
    for row in range(
        math.floor((y - reach) / cell), math.floor((y + reach) / cell) + 1
    ):
        for column in range(first, last + 1):
            other = grid.heads[bucket_of(grid, column, row)]
            # Two cells may share a bucket, so that a robot there counts only in its own
            # cell.
            while other >= 0:
                is_here = (
                    grid.places[other, COLUMN] == column
                    and grid.places[other, ROW] == row
                )
                if is_here and other != slot:
                    dx, dy = robots[other, X] - x, robots[other, Y] - y
                    gap = math.hypot(dx, dy) - (robots[other, RADIUS] + radius)
                    # One may fly over the other, and come down beside it later.
                    is_level = (
                        robots[other, BOTTOM] < robots[slot, TOP]
                        and robots[slot, BOTTOM] < robots[other, TOP]
                    )
                    if gap < _OUTLINE_RANGE and is_level:
                        _add_outline(around, other, count)
                        count += 4
                    else:
                        nearest = min(nearest, gap)
                other = grid.places[other, NEXT]
    robots[slot, ROBOT_GAP] = nearest
    return walls, count


@njit_inline
def _add_outline(around: Surroundings, other: Int, count: Int) -> None:
    """Add the four sides of another robot to the lines; they rank after all walls."""
    robots, lines = around.robots, around.lines
    # The sides are computed here from the pose, not kept: most robots are near nobody.
    x, y, yaw = pose_of(robots, other)
    length, width = robots[other, HALF_LENGTH], robots[other, HALF_WIDTH]
    c, s = math.cos(yaw), math.sin(yaw)
    rank = len(around.walls.lines) + 4 * robots[other, NUMBER]
    corner_x, corner_y = length * c - width * s + x, length * s + width * c + y
    for side in range(4):
        if side % 2 == 0:
            length = -length
        else:
            width = -width
        next_x, next_y = length * c - width * s + x, length * s + width * c + y
        row = count + side
        lines[row, MIDDLE_X] = (corner_x + next_x) / 2
        lines[row, MIDDLE_Y] = (corner_y + next_y) / 2
        lines[row, HALF_X] = (next_x - corner_x) / 2
        lines[row, HALF_Y] = (next_y - corner_y) / 2
        lines[row, RANK] = rank + side
        corner_x, corner_y = next_x, next_y


@njit_inline
def _avoid(
    around: Surroundings, slot: Int, count: Int, wanted: Place, sweep: float
) -> Place:
    """Return the pose to take instead of a wanted pose that is not free."""
    x, y, yaw = wanted
    start = pose_of(around.robots, slot)
    start_x, start_y, start_yaw = start
    start_gap, _, _ = _contact(around, slot, count, start)
    # A robot nearer than ``CONTACT_GAP`` slides on; it is not pushed back first.
    clearance = max(2 * MARGIN, min(CONTACT_GAP, start_gap))
    # Without the turn second: beside a wall it may be the turn that is blocked.
    for target in (wanted, (x, y, start_yaw)):
        is_free, freed = _push_out(around, slot, count, target, clearance)
        moved = math.hypot(freed[0] - start_x, freed[1] - start_y)
        if is_free and moved <= MAX_DISPLACEMENT_RATIO * sweep:
            return freed
    turned = (start_x, start_y, yaw)
    if _contact(around, slot, count, turned)[0] > MARGIN:
        return turned
    # A robot that was placed inside an obstacle may leave it.
    return wanted if _contact(around, slot, count, wanted)[0] > start_gap else start


@njit_inline
def _push_out(
    around: Surroundings, slot: Int, count: Int, pose: Place, clearance: float
) -> tuple[bool, Place]:
    """Push a pose out of all lines; return whether that succeeds, and the pose."""
    for _ in range(_MAX_PUSHES):
        gap, away_x, away_y = _contact(around, slot, count, pose)
        if gap > MARGIN:
            return True, pose
        push = clearance - gap
        pose = (pose[0] + push * away_x, pose[1] + push * away_y, pose[2])
    return False, pose
