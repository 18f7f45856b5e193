"""The numbers of the readings of many robots, computed in one compiled call.

Theory of operation
===================
What a robot's sensors remember are numbers in the row of its slot. What it reports
follows from jobs: each writes the numbers of one attribute of a report, in the order in
which its line has them. Robots of one class have their numbers in the same places and
so share the jobs, which are kept once.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import Int, njit_cached, njit_inline
from radarsim.robots.fleet import Fleet
from radarsim.robots.motion import POSE_X
from radarsim.robots.robot import (
    BODY_Z,
    FRONT_STEER,
    LEFT_ANGLE,
    PITCH,
    REAR_STEER,
    RIGHT_ANGLE,
    ROLL,
    TOUCHED,
    VELOCITY_X,
    VELOCITY_Y,
    VELOCITY_Z,
    YAW,
    X,
    Y,
)
from radarsim.sensors.acceleration import (
    GRAVITY,
    read_acceleration,
    read_rotation,
)
from radarsim.sensors.motion_readings import (
    ANGLE_ZERO,
    DRAWN,
    INS_DRAWS,
    INS_NUMBERS,
    INS_USED,
    SPEEDS,
    USED,
    count_ticks,
    measure_speeds,
    move_ins,
    read_ins,
)

# Kinds of jobs. One number: time, s; charge of the battery, s; whether it is touched.
TIME, CHARGE, IS_TOUCHED = range(3)
# A number for each wheel: its speed, which is measured then; its angle; its ticks.
WHEEL_SPEEDS, WHEEL_ANGLES, WHEEL_TICKS = range(3, 6)
# A pose: of the body; that which an INS estimates; x, y, yaw that the wheels imply.
BODY_POSE, INS_POSE, WHEEL_POSE = range(6, 9)
# Nothing: the drift of an INS goes on. Angles of the front and the rear wheels.
DRIFT, STEERING = range(9, 11)
# Three numbers: accelerations, and those of a mass that rests on the sensor. Twelve: of
# an inertial measurement unit.
ACCELERATION, PROPER_ACCELERATION, INERTIA = range(11, 14)
LINK_ANGLES: Final = 14  # of each link of a mission package
# Two numbers: heights above the spawn and above the sea, m. One: minutes since the
# spawn; yaw, rad.
ALTITUDES, MINUTES, HEADING = range(15, 18)

SEA_LEVEL: Final = -111.0  # m; height of the sea below the spawn, as of the original

TICKS_A_MINUTE: Final = 6000
SPENT: Final = 0  # place in the numbers of a robot: 1 if random numbers are used up
# Numbers of a battery: time that it lasts, s; what it holds at least, s; tick of the
# spawn.
LIFE, LEAST, SPAWN_TICK = range(3)
# Numbers of the wheels of a job: how many; of each its side, 0 for left and 1 for
# right, and the sign of its ticks.
WHEEL_COUNT, WHEEL_SIDE, WHEEL_SIGN = range(3)
# Numbers of a mission package: how many links; of each: angle when it was told to move,
# and the tick; angle to which it turns, rad; its speed, rad/s.
LINK_COUNT, FROM_ANGLE, FROM_TICK, TO_ANGLE, LINK_SPEED = range(5)
LINK_NUMBERS: Final = 4


class Job(NamedTuple):
    """What the numbers of an attribute are computed from.

    Attributes:
        kind: One of the kinds above.
        place: Place of the sensor's numbers in the row of its robot.
        wheels: Place of the numbers of its wheels there.
    """

    kind: int
    place: int = 0
    wheels: int = 0


@njit_inline
def _copy(numbers: Floats, start: int, out: Floats, at: Int, size: int) -> None:
    for k in range(size):
        out[at + k] = numbers[start + k]


@njit_cached
def fill_readings(
    due: NDArray[np.int64],
    jobs: NDArray[np.int64],
    numbers: Floats,
    ticks: int,
    out: Floats,
    robots: Floats,
    odometry: Floats,
) -> int:
    """Do the jobs of robots, one after the other.

    Args:
        due: (R, 3) slot of each robot, the first of its jobs, and that after the last.
        jobs: (J, 3), a ``Job`` each.
        numbers: (S, N) numbers of the robots, by slot.
        ticks: Simulated time in ticks.
        out: For what is written.
        robots: Columns of the fleet.
        odometry: The odometry of the fleet.

    Returns:
        The number of robots that have used up some of their random numbers.
    """
    # Readings are plain numbers in the order of their lines, so that no object is made
    # for any of them: a tick of fifty robots has hundreds (rows "robots").
    at, spent, body = 0, 0, np.zeros(6)
    for row in range(len(due)):
        slot = due[row, 0]
        mine, body[0], body[1] = numbers[slot], robots[slot, X], robots[slot, Y]
        body[2], body[5] = robots[slot, BODY_Z], robots[slot, YAW]
        body[3], body[4] = robots[slot, ROLL], robots[slot, PITCH]
        left, right = robots[slot, LEFT_ANGLE], robots[slot, RIGHT_ANGLE]
        for job in range(due[row, 1], due[row, 2]):
            kind, place, wheels = jobs[job, 0], jobs[job, 1], jobs[job, 2]
            if kind == TIME:
                out[at] = ticks / 100
                at += 1
            elif kind == CHARGE:  # as of ``Battery.seconds_left``
                elapsed = (ticks - mine[place + SPAWN_TICK]) / 100
                charge = np.trunc(max(0.0, mine[place + LIFE] - elapsed))
                out[at] = max(charge, mine[place + LEAST])
                at += 1
            elif kind == IS_TOUCHED:
                out[at] = robots[slot, TOUCHED]
                at += 1
            elif kind == BODY_POSE:
                _copy(body, 0, out, at, 6)
                at += 6
            elif kind == INS_POSE:
                read_ins(mine, place, body, out, at)
                at += 6
            elif kind == WHEEL_POSE:
                _copy(odometry[int(mine[place])], POSE_X, out, at, 3)
                at += 3
            elif kind >= STEERING:
                at = _read_motion(kind, mine, place, robots[slot], ticks, out, at)
            elif kind == DRIFT:
                move_ins(mine, place, body)
                if mine[place + INS_USED] == INS_NUMBERS - INS_DRAWS:
                    mine[SPENT] = 1.0
            else:
                at = _read_wheels(
                    kind, mine, place, wheels, left, right, ticks, out, at
                )
        spent += mine[SPENT] != 0.0
    return spent


@njit_cached
def link_angle(numbers: Floats, link: int, ticks: int) -> float:
    """Return the angle of a link, rad.

    Args:
        numbers: Numbers of the robot.
        link: Place of the numbers of the package, and of those of the links before.
        ticks: Simulated time in ticks.
    """
    start = numbers[link + FROM_ANGLE]
    reach = numbers[link + LINK_SPEED] * (ticks - numbers[link + FROM_TICK]) / 100
    way = numbers[link + TO_ANGLE] - start
    return float(start + max(-reach, min(reach, way)))


@njit_inline
def _read_motion(
    kind: int,
    numbers: Floats,
    place: int,
    robot: Floats,
    ticks: int,
    out: Floats,
    at: int,
) -> int:
    """Write what else follows from the motion; return the place after."""
    if kind == LINK_ANGLES:
        count = int(numbers[place + LINK_COUNT])
        for link in range(count):
            out[at + link] = link_angle(numbers, place + LINK_NUMBERS * link, ticks)
        return at + count
    if kind == STEERING:
        out[at], out[at + 1] = robot[FRONT_STEER], robot[REAR_STEER]
        return at + 2
    if kind >= ALTITUDES:
        return _read_gauge(kind, numbers, place, robot, ticks, out, at)
    motion = robot[VELOCITY_X], robot[VELOCITY_Y], robot[VELOCITY_Z]
    attitude = robot[ROLL], robot[PITCH], robot[YAW]
    gravity = GRAVITY if kind == PROPER_ACCELERATION else 0.0
    time = ticks / 100
    elapsed = read_acceleration(
        numbers, place, time, motion, attitude, gravity, out, at
    )
    if kind != INERTIA:
        return at + 3
    read_rotation(numbers, place, elapsed, attitude, out, at + 3)
    return at + 12


@njit_inline
def _read_gauge(
    kind: int,
    numbers: Floats,
    place: int,
    robot: Floats,
    ticks: int,
    out: Floats,
    at: int,
) -> int:
    """Write heights, minutes or the heading; return the place after."""
    if kind == ALTITUDES:
        height = robot[BODY_Z] - numbers[place]
        out[at], out[at + 1] = height, max(0.0, height - SEA_LEVEL)
        return at + 2
    if kind == MINUTES:
        out[at] = (ticks - numbers[place]) // TICKS_A_MINUTE
    else:
        out[at] = robot[YAW]
    return at + 1


@njit_inline
def _read_wheels(
    kind: int,
    numbers: Floats,
    place: int,
    wheels: int,
    left: float,
    right: float,
    ticks: int,
    out: Floats,
    at: int,
) -> int:
    """Write a number for each wheel; return the place after them."""
    if kind == WHEEL_SPEEDS:  # once for all wheels: what follows are those measured
        measure_speeds(numbers, place, ticks / 100, left, right)
    for wheel in range(int(numbers[wheels + WHEEL_COUNT])):
        side = int(numbers[wheels + WHEEL_SIDE + 2 * wheel])
        angle = right if side else left
        if kind == WHEEL_SPEEDS:
            out[at] = numbers[place + SPEEDS + side]
        elif kind == WHEEL_ANGLES:
            out[at] = angle - numbers[place + ANGLE_ZERO + side]
        else:
            sign = numbers[wheels + WHEEL_SIGN + 2 * wheel]
            out[at] = count_ticks(numbers, place, side, angle) * sign
        at += 1
    if kind == WHEEL_TICKS and numbers[place + USED] == numbers[place + DRAWN]:
        numbers[SPENT] = 1.0
    return at


class Program(NamedTuple):
    """Jobs in the table.

    Attributes:
        first: The first of them.
        end: That after the last.
        size: How many numbers they write.
    """

    first: int
    end: int
    size: int


class ReadingTable:
    """Numbers of all robots, a row for each slot of a fleet, and jobs."""

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet
        self._numbers: Floats = np.zeros((0, 1))
        self._jobs: NDArray[np.int64] = np.zeros((0, 3), np.int64)
        self._programs: dict[tuple[Job, ...], Program] = {}

    def program(self, jobs: Sequence[Job], size: int) -> Program:
        """Return jobs, which write ``size`` numbers, as a program; equal ones once."""
        key = tuple(jobs)
        # Robots of one class have their numbers in the same places, so that a hundred
        # of them share a dozen programs.
        program = self._programs.get(key)
        if program is None:
            first = len(self._jobs)
            rows = np.array(key, np.int64).reshape(-1, 3)
            self._jobs = np.concatenate([self._jobs, rows])
            program = self._programs[key] = Program(first, first + len(key), size)
        return program

    def run(
        self, due: Sequence[tuple[int, Program]], ticks: int
    ) -> tuple[list[float], bool]:
        """Do the jobs of robots.

        Args:
            due: Slot of each robot, and its program.
            ticks: Simulated time in ticks.

        Returns:
            What was written, robot by robot; and whether some robots have used up
            random numbers, so that ``NumberRow.is_spent``.
        """
        rows = np.array([(slot, each.first, each.end) for slot, each in due], np.int64)
        out = np.zeros(sum([each.size for _, each in due]))
        spent = fill_readings(
            rows.reshape(-1, 3),
            self._jobs,
            self._numbers,
            ticks,
            out,
            self._fleet.columns,
            self._fleet.odometry,
        )
        return out.tolist(), bool(spent)

    def row(self, slot: int, width: int) -> Floats:
        """Return the row of a slot; there is room for at least ``width`` numbers."""
        rows, columns = self._numbers.shape
        if slot >= rows or width > columns:
            shape = max(rows, len(self._fleet.columns)), max(columns, width)
            # By the fleet's own growth, which doubles: rows are copied rarely.
            more = np.zeros(shape)
            more[:rows, :columns] = self._numbers
            self._numbers = more
        row: Floats = self._numbers[slot]
        return row


class NumberRow:
    """The numbers of one robot."""

    def __init__(self, table: ReadingTable, slot: int) -> None:
        """Begin without numbers.

        Args:
            table: Where they are.
            slot: Slot of the robot in the fleet.
        """
        self._table = table
        self._slot = slot
        self._width = SPENT + 1
        self.is_spent = False

    @property
    def is_spent(self) -> bool:
        """Whether some random numbers are used up."""
        return bool(self._table.row(self._slot, self._width)[SPENT])

    @is_spent.setter
    def is_spent(self, value: bool) -> None:
        self._table.row(self._slot, self._width)[SPENT] = value

    def add(self, numbers: Sequence[float] | Floats) -> slice:
        """Add numbers, and return their places."""
        places = slice(self._width, self._width + len(numbers))
        self._width = places.stop
        self[places] = numbers
        return places

    def __getitem__(self, places: slice) -> Floats:
        """Return a view of some numbers, which is not to be kept."""
        return self._table.row(self._slot, self._width)[places]

    def __setitem__(self, places: slice, numbers: Sequence[float] | Floats) -> None:
        self._table.row(self._slot, self._width)[places] = numbers
