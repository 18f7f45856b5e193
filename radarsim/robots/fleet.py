"""All robots of a simulation, driven together.

Their state is in columns of arrays, so that one call of machine code advances them all.
Each robot keeps its row, its slot, as long as it is in the fleet.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import engine
from radarsim.geometry import Floats, Pose2, wrap_angle
from radarsim.presets.robots import RobotModel
from radarsim.protocol.dialect import WheelDrive
from radarsim.robots.footprint import LINE, MARGIN
from radarsim.robots.obstacles import Obstacles, WallStore
from radarsim.robots.robot import (
    COLUMN,
    FREE,
    ODOMETRY,
    ROBOT,
    UNKNOWN,
    Robot,
    new_rows,
)

_FIRST_SLOTS: Final = 8
WALL_RANGE: Final = 0.5  # m beyond the robot's circle within which walls are found
_MAX_DISPLACEMENT_RATIO: Final = 2.0  # of a centre, by the sweep of a move
# Of the rows of ``raycast.rays.Boxes``.
_BOX: Final = ("x", "y", "yaw", "bottom", "top", "half_length", "half_width", "number")
_BOX_COLUMNS: Final = [COLUMN[field] for field in _BOX]


class Fleet:
    """Robots that drive among each other, on one or several floors.

    Attributes:
        robots: The robots, in the order of spawning, in which they also move.
        slots: (R,) their slots, int64.
        odometry: (M,) of type ``ODOMETRY``, of robots that have one; some rows may be
            free.
        table: (S,) of type ``ROBOT``, a row for each slot; another array once one is
            added. Rows of free slots hold anything.
        columns: The same rows as numbers, see ``robots.robot.COLUMN``.
    """

    def __init__(self) -> None:
        self.robots: tuple[Robot, ...] = ()
        self.slots: NDArray[np.int64] = np.zeros(0, np.int64)
        self.odometry: NDArray[np.void] = np.zeros(0, ODOMETRY)
        self._free_slots: list[int] = []
        self._spawned = 0
        self._floors: list[Obstacles] = []
        self._set_table(new_rows(0))
        self._lines: NDArray[np.void] = np.zeros(0, LINE)  # room for what a robot meets
        self._enter_floors()

    def prepare(self, obstacles: Obstacles) -> None:
        """Enter the walls of a floor, unless it is known."""
        if obstacles not in self._floors:
            if not self._walls.add(obstacles.walls):
                self._forget_floors()
                self._floors.append(obstacles)
                self._enter_floors()
            else:
                self._floors.append(obstacles)

    def _enter_floors(self) -> None:
        """Enter the walls of all floors into another table."""
        self._walls = WallStore([floor.walls for floor in self._floors])
        self._pack()

    def _pack(self) -> None:
        """Pack what robots may run into, as C++ takes it."""
        # All walls, and the sides of all robots.
        room = self._walls.lines + 4 * len(self.table)
        # Kept from robot to robot: to allocate megabytes can take milliseconds.
        if len(self._lines) < room:
            self._lines = np.zeros(room + room // 4, LINE)
        self._around = engine.structures["Surroundings"].pack(
            robots=self.table,
            order=self.slots,
            odometry=self.odometry,
            walls=self._walls.table,
            lines=self._lines,
            margin=MARGIN,
            wall_range=WALL_RANGE,
            max_displacement_ratio=_MAX_DISPLACEMENT_RATIO,
        )

    def add(
        self,
        name: str,
        model: RobotModel,
        pose: Pose2,
        *,
        obstacles: Obstacles,
        wheel_drive: WheelDrive,
    ) -> Robot:
        """Add a robot that stands still.

        Args:
            name: Name of the robot.
            model: Robot class.
            pose: Where it stands, map frame; the fleet does not look for a free place.
            obstacles: Obstacles on its floor.
            wheel_drive: Conversion of drive commands to wheel speeds.
        """
        slot = self._take_slot(obstacles)
        robot = Robot(
            name,
            model,
            wheel_drive=wheel_drive,
            fleet=self,
            slot=slot,
        )
        self._spawned += 1
        self._fill_slot(robot, pose, obstacles)
        self.robots = (*self.robots, robot)
        self._update_slots()
        return robot

    def add_odometry(self, robot: Robot) -> int:
        """Integrate the turns of a robot's wheels from now on; return the row."""
        free = np.flatnonzero(self.odometry["slot"] == FREE)
        if not free.size:
            count = len(self.odometry)
            more = np.zeros(max(_FIRST_SLOTS, count), ODOMETRY)
            more["slot"] = FREE
            free = np.array([count])
            self.odometry = np.concatenate([self.odometry, more])
            self._pack()
        row, separation = int(free[0]), robot.model.wheel_separation
        self.odometry[row] = (robot.slot, separation, 0, 0, 0, *robot.side_angles)
        return row

    def remove(self, robot: Robot) -> None:
        """Remove a robot, which stands where it is in a fleet that does not drive.

        Raises:
            ValueError: If the robot is not in the fleet.
        """
        if robot.fleet is not self:
            raise ValueError(f"robot {robot.name!r} is not in this fleet")
        # Whoever still holds the robot can read its last pose, while its row here is
        # given to the next one.
        alone, slot = Fleet(), robot.slot
        alone._set_table(self.table[[slot]])
        alone.odometry = self.odometry.copy()
        alone.table["touched"] = 0.0
        robot.fleet, robot.slot = alone, 0
        self.odometry["slot"][self.odometry["slot"] == slot] = FREE
        self._free_slots.append(slot)
        self.robots = tuple(each for each in self.robots if each is not robot)
        self._update_slots()

    def place(self, robot: Robot, pose: Pose2, obstacles: Obstacles) -> None:
        """Put a robot elsewhere, where it stands still; arguments as of ``add``.

        Odometry goes on as if the robot had not been moved.
        """
        number = robot.number
        self.prepare(obstacles)
        self._fill_slot(robot, pose, obstacles)
        robot.row["number"] = number
        self._forget_gaps()

    def lift(self, robot: Robot, z: float, obstacles: Obstacles) -> None:
        """Move a robot that flies to another height.

        Args:
            robot: The robot.
            z: Height of its body frame, m, map frame.
            obstacles: Obstacles at that height.
        """
        self.prepare(obstacles)
        model, row = robot.model, robot.row
        bottom, floor = z - model.origin_height, self._floors.index(obstacles)
        row["bottom"], row["top"], row["body_z"] = bottom, bottom + model.height, z
        if row["floor"] != floor:
            row["floor"], row["wall_gap"], row["rejected"] = floor, 0.0, np.nan

    def step(self, dt: float) -> None:
        """Drive all robots for one time step of ``dt`` s."""
        engine.drive_robots(self._around, dt)

    def drive(
        self, slots: NDArray[np.int64], dt: float, steps: int, *, meets: bool
    ) -> NDArray[np.bool_]:
        """Drive some robots for several time steps, as if there were no others.

        Args:
            slots: (K,) their slots, in the order in which they move.
            dt: Time step, s.
            steps: Number of time steps.
            meets: Whether these robots may run into each other.

        Returns:
            (K,) whether each was blocked, or touched something, after any of the steps.
        """
        touched = np.zeros(len(slots), np.bool_)
        engine.drive_on(self._around, slots, dt, steps, meets, touched)
        return touched

    def touched(self, slots: Sequence[int] | NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which robots were blocked in the last step, or touch something.

        The results are kept until the next step, also for ``Robot.touched``: it takes
        much less time to ask for many robots first, and then for each.

        Args:
            slots: (K,) their slots.
        """
        asked = np.asarray(slots, np.int64)
        engine.find_touched(self._around, asked)
        return np.asarray(self.table["touched"][asked] == 1.0)

    def near(self, x: float, y: float, distance: float) -> tuple[Robot, ...]:
        """Return the robots near a place, m, map frame, in the order of spawning.

        They are those with a corner that may be within ``distance`` m.
        """
        rows = self.columns[self.slots]
        gaps = np.hypot(rows[:, COLUMN["x"]] - x, rows[:, COLUMN["y"]] - y)
        gaps -= rows[:, COLUMN["radius"]]
        return tuple(self.robots[i] for i in np.flatnonzero(gaps <= distance))

    def boxes(self) -> Floats:
        """Return the robots as rows of ``raycast.rays.Boxes``, (R, 8).

        They are in the order of spawning, and their ids are the numbers of the robots.
        """
        return self.columns[self.slots[:, None], _BOX_COLUMNS]

    def _take_slot(self, obstacles: Obstacles) -> int:
        """Return a free slot, and make room for it and for the walls of its floor."""
        if not self._free_slots:
            count = len(self.table)
            more = new_rows(max(_FIRST_SLOTS, count))
            self._set_table(np.concatenate([self.table, more]))
            self._pack()
            # Highest first, as slots are taken from the end: the lowest one is used
            # first.
            self._free_slots = list(range(len(self.table) - 1, count - 1, -1))
        self.prepare(obstacles)
        return self._free_slots.pop()

    def _set_table(self, table: NDArray[np.void]) -> None:
        self.table = table
        self.columns: Floats = table.view(np.float64).reshape(
            len(table), ROBOT.itemsize // 8
        )

    def _forget_floors(self) -> None:
        """Keep only the floors on which robots are: those that fly have many."""
        floors = self.table["floor"][self.slots].astype(np.int64)
        used, renumbered = np.unique(floors, return_inverse=True)
        self._floors = [self._floors[number] for number in used.tolist()]
        self.table["floor"][self.slots] = renumbered

    def _fill_slot(self, robot: Robot, pose: Pose2, obstacles: Obstacles) -> None:
        model, floor = robot.model, obstacles.floor
        (row,) = new_rows(1)
        row["x"], row["y"], row["yaw"] = pose.x, pose.y, wrap_angle(pose.yaw)
        row["bottom"], row["top"] = floor, floor + model.height
        row["body_z"] = floor + model.origin_height
        row["half_length"], row["half_width"] = model.length / 2, model.width / 2
        row["track"], row["wheel_radius"] = model.track, model.wheel_radius
        row["radius"] = robot.footprint.radius
        row["top_speed"] = _MAX_DISPLACEMENT_RATIO * _fastest_sweep(robot)
        row["floor"] = self._floors.index(obstacles)
        row["number"] = self._spawned
        self.table[robot.slot] = row

    def _update_slots(self) -> None:
        self.slots = np.array([robot.slot for robot in self.robots], np.int64)
        self._pack()
        self._forget_gaps()

    def _forget_gaps(self) -> None:
        # A robot that came may be close to any other, and one that left was.
        self.table["robot_gap"] = 0.0
        self.table["touched"] = UNKNOWN


def _fastest_sweep(robot: Robot) -> float:
    """Return an upper bound of the speed of a robot's fastest point, m/s."""
    model, spin = robot.model, robot.wheel_drive.max_spin_rad_s
    if robot.bicycle is None:
        motions = [(spin, spin, 0.0), (-spin, spin, 0.0)]
    else:
        motions = robot.bicycle.extremes(spin)
    fastest: float = max(
        engine.sweep_rate(
            left * model.wheel_radius,
            right * model.wheel_radius,
            model.track,
            robot.footprint.radius,
            sideslip,
        )
        for left, right, sideslip in motions
    )
    if model.flight is None:
        return fastest
    turn = math.radians(model.flight.max_turn_deg) * robot.footprint.radius
    return max(fastest, model.flight.max_linear + turn) + model.flight.max_lateral
