"""The fleet: all robots of a simulation, which move together.

The state of the robots is in arrays, so one call of the engine advances all robots.
A robot keeps its row, the slot, as long as it is in the fleet.
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
WALL_RANGE: Final = 0.5  # m around the robot's circle in which walls are searched
_MAX_DISPLACEMENT_RATIO: Final = 2.0  # largest ratio of displacement to sweep
# The fields of a row of ``raycast.rays.Boxes``.
_BOX: Final = ("x", "y", "yaw", "bottom", "top", "half_length", "half_width", "number")
_BOX_COLUMNS: Final = [COLUMN[field] for field in _BOX]


class Fleet:
    """Robots that move and collide with each other, on one or several floors.

    Attributes:
        robots: The robots, in the order of spawning, in which they also move.
        slots: (R,) slots of the robots, int64.
        odometry: (M,) of type ``ODOMETRY``, rows of robots with odometry, and free
            rows.
        table: (S,) of type ``ROBOT``, a row for each slot; rows of free slots are
            undefined. Adding a robot can replace the array.
        columns: The same rows as (S, C) float64, see ``robots.robot.COLUMN``.
    """

    def __init__(self) -> None:
        self.robots: tuple[Robot, ...] = ()
        self.slots: NDArray[np.int64] = np.zeros(0, np.int64)
        self.odometry: NDArray[np.void] = np.zeros(0, ODOMETRY)
        self._free_slots: list[int] = []
        self._spawned = 0
        self._floors: list[Obstacles] = []
        self._set_table(new_rows(0))
        self._lines: NDArray[np.void] = np.zeros(0, LINE)  # buffer of the engine
        self._enter_floors()

    def prepare(self, obstacles: Obstacles) -> None:
        """Add the walls of a floor to the table unless it already contains them."""
        if obstacles not in self._floors:
            if not self._walls.add(obstacles.walls):
                self._forget_floors()
                self._floors.append(obstacles)
                self._enter_floors()
            else:
                self._floors.append(obstacles)

    def _enter_floors(self) -> None:
        """Create a new table with the walls of all floors."""
        self._walls = WallStore([floor.walls for floor in self._floors])
        self._pack()

    def _pack(self) -> None:
        """Pack robots and walls into a structure for the engine."""
        # The buffer has room for all walls, and the sides of all robots.
        room = self._walls.lines + 4 * len(self.table)
        # The buffer is reused, since allocating megabytes can take milliseconds.
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
            pose: Pose of the robot, map frame; the fleet does not check collisions.
            obstacles: Obstacles on the robot's floor.
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
        """Start to integrate the wheel rotation of a robot; return the odometry row."""
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
        """Remove a robot; its state is moved to a fleet of its own, which never moves.

        Raises:
            ValueError: If the robot is not in the fleet.
        """
        if robot.fleet is not self:
            raise ValueError(f"robot {robot.name!r} is not in this fleet")
        # The copied row lets other code read the last pose of the robot, while another
        # robot reuses its slot here.
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
        """Move a robot to another pose, where it stops; arguments as in ``add``.

        Odometry does not count this displacement.
        """
        number = robot.number
        self.prepare(obstacles)
        self._fill_slot(robot, pose, obstacles)
        robot.row["number"] = number
        self._forget_gaps()

    def lift(self, robot: Robot, z: float, obstacles: Obstacles) -> None:
        """Move a flying robot to another height.

        Args:
            robot: The robot.
            z: Height of the body frame, m, map frame.
            obstacles: Obstacles at that height.
        """
        self.prepare(obstacles)
        model, row = robot.model, robot.row
        bottom, floor = z - model.origin_height, self._floors.index(obstacles)
        row["bottom"], row["top"], row["body_z"] = bottom, bottom + model.height, z
        if row["floor"] != floor:
            row["floor"], row["wall_gap"], row["rejected"] = floor, 0.0, np.nan

    def step(self, dt: float) -> None:
        """Move all robots for one time step of ``dt`` s."""
        engine.drive_robots(self._around, dt)

    def drive(
        self, slots: NDArray[np.int64], dt: float, steps: int, *, meets: bool
    ) -> NDArray[np.bool_]:
        """Move some robots for several time steps, ignoring all other robots.

        Args:
            slots: (K,) slots of the robots, in the order in which they move.
            dt: Time step, s.
            steps: Number of time steps.
            meets: Whether these robots may collide with each other.

        Returns:
            (K,) whether each robot was blocked or in contact after any of the steps.
        """
        touched = np.zeros(len(slots), np.bool_)
        engine.drive_on(self._around, slots, dt, steps, meets, touched)
        return touched

    def touched(self, slots: Sequence[int] | NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which robots were blocked in the last step, or are in contact, (K,).

        The results are cached until the next step, also for ``Robot.touched``. One call
        for many robots is much faster than a call for each robot.

        Args:
            slots: (K,) slots of the robots.
        """
        asked = np.asarray(slots, np.int64)
        engine.find_touched(self._around, asked)
        return np.asarray(self.table["touched"][asked] == 1.0)

    def near(self, x: float, y: float, distance: float) -> tuple[Robot, ...]:
        """Return the robots near a position, m, map frame, in the order of spawning.

        A robot is near if its circumscribed circle is within ``distance`` m.
        """
        rows = self.columns[self.slots]
        gaps = np.hypot(rows[:, COLUMN["x"]] - x, rows[:, COLUMN["y"]] - y)
        gaps -= rows[:, COLUMN["radius"]]
        return tuple(self.robots[i] for i in np.flatnonzero(gaps <= distance))

    def boxes(self) -> Floats:
        """Return the robots as rows of ``raycast.rays.Boxes``, (R, 8).

        The rows are in the order of spawning, with the robots' numbers as ids.
        """
        return self.columns[self.slots[:, None], _BOX_COLUMNS]

    def _take_slot(self, obstacles: Obstacles) -> int:
        """Return a free slot; enlarge the tables of robots and walls if needed."""
        if not self._free_slots:
            count = len(self.table)
            more = new_rows(max(_FIRST_SLOTS, count))
            self._set_table(np.concatenate([self.table, more]))
            self._pack()
            # The list is in descending order, so `pop` returns the lowest slot first.
            self._free_slots = list(range(len(self.table) - 1, count - 1, -1))
        self.prepare(obstacles)
        return self._free_slots.pop()

    def _set_table(self, table: NDArray[np.void]) -> None:
        self.table = table
        self.columns: Floats = table.view(np.float64).reshape(
            len(table), ROBOT.itemsize // 8
        )

    def _forget_floors(self) -> None:
        """Drop floors without robots, since flying robots add many floors."""
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
        # Adding, moving or removing a robot changes distances and contacts, so all are
        # unknown.
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
