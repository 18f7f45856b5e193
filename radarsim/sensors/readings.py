"""Computes the sensor readings of many robots in one call of the engine.

``readings.hpp`` describes how each reading is computed.
"""

import operator
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import Packed, engine
from radarsim.errors import EngineError
from radarsim.geometry import Floats

if TYPE_CHECKING:
    from radarsim.robots.fleet import Fleet

_JOB: Final = engine.rows["Job"]
_DUE: Final = engine.rows["DueJobs"]
_DEPLETED: Final = 0  # column of a robot's row that is 1 if random numbers are used up


class Job(NamedTuple):
    """An instruction for the engine to compute one reading from a sensor's state.

    Attributes:
        kind: A ``Reading`` of ``readings.hpp``.
        place: Column of the sensor's state in the row of its robot.
    """

    kind: int
    place: int = 0


class Program(NamedTuple):
    """Consecutive jobs in the job table, which compute the readings of a robot.

    Attributes:
        first: Index of the first job.
        end: Index after the last job.
        size: How many numbers the jobs write.
    """

    first: int
    end: int
    size: int


class ReadingTable:
    """The states of all robots' sensors, one row per robot, and the table of jobs."""

    def __init__(self, fleet: "Fleet") -> None:
        self._fleet = fleet
        self._rows: Floats = np.zeros((0, 1))
        self._jobs = np.zeros(0, _JOB)
        self._programs: dict[tuple[Job, ...], Program] = {}
        self._tables = self._pack()

    def program(self, jobs: Sequence[Job], size: int) -> Program:
        """Return a program of jobs that write ``size`` numbers; programs are cached."""
        key = tuple(jobs)
        # Robots of one class store states in the same columns and share programs, so a
        # hundred robots need only a dozen programs.
        program = self._programs.get(key)
        if program is None:
            first = len(self._jobs)
            self._jobs = np.concatenate([self._jobs, np.array(jobs, _JOB)])
            program = self._programs[key] = Program(first, first + len(key), size)
        return program

    def run(
        self, due: Sequence[tuple[int, Program]], ticks: int
    ) -> tuple[list[float], bool]:
        """Compute the readings of robots.

        Args:
            due: Slot and program of each robot.
            ticks: Simulated time in ticks.

        Returns:
            The numbers written, robot by robot; and whether any robot has used up its
            random numbers, so that its ``RobotState.is_depleted`` is true.
        """
        out = np.zeros(sum([each.size for _, each in due]))
        rows = np.array([(slot, each.first, each.end) for slot, each in due], _DUE)
        fleet, tables = self._fleet, self._tables
        arrays = self._jobs, self._rows, fleet.table, fleet.odometry
        if not all(map(operator.is_, arrays, tables.fields.values())):
            tables = self._tables = self._pack()
        depleted = engine.take_readings(rows, tables, ticks, out)
        if depleted < 0:
            raise EngineError(f"expected jobs that write {len(out)} numbers in all")
        return out.tolist(), depleted > 0

    def _pack(self) -> Packed:
        return engine.structures["SensorTables"].pack(
            jobs=self._jobs,
            rows=self._rows,
            robots=self._fleet.table,
            odometry=self._fleet.odometry,
        )

    def row(self, slot: int, width: int) -> Floats:
        """Return the row of a robot, enlarged to ``width`` numbers if it is shorter."""
        rows, columns = self._rows.shape
        if slot >= rows or width > columns:
            shape = max(rows, len(self._fleet.table)), max(columns, width)
            # The table has as many rows as the fleet's table, which doubles when it is
            # full, so copies are rare.
            more = np.zeros(shape)
            more[:rows, :columns] = self._rows
            self._rows = more
        row: Floats = self._rows[slot]
        return row


class RobotState:
    """The row of the reading table with the states of one robot's sensors.

    Attributes:
        table: The table that has the row of this robot.
    """

    def __init__(self, table: ReadingTable, slot: int) -> None:
        """Create the row of a robot without sensors.

        Args:
            table: The table that has the row of this robot.
            slot: Slot of the robot in the fleet.
        """
        self.table = table
        self._slot = slot
        self._width = _DEPLETED + 1
        self.is_depleted = False

    @property
    def is_depleted(self) -> bool:
        """Whether a sensor of the robot has used all random numbers drawn for it."""
        return bool(self._row[_DEPLETED])

    @is_depleted.setter
    def is_depleted(self, value: bool) -> None:
        self._row[_DEPLETED] = value

    def add(self, states: NDArray[Any]) -> slice:
        """Append a sensor's state to the row, and return the columns of the state."""
        numbers = states.view(np.float64)
        places = slice(self._width, self._width + len(numbers))
        self._width = places.stop
        self._row[places] = numbers
        return places

    def __getitem__(self, places: slice) -> Floats:
        """Return a view of some columns of the row, valid until the table grows."""
        return self._row[places]

    @property
    def _row(self) -> Floats:
        return self.table.row(self._slot, self._width)
