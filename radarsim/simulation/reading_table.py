"""The numbers from which the readings of all robots are computed together."""

from collections.abc import Sequence
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.robots.fleet import Fleet
from radarsim.simulation.reading_kernel import (
    BODY_POSE,
    DRIFT,
    INS_POSE,
    MEASURE,
    SPENT,
    WHEEL_POSE,
    fill_readings,
)

Instruction: TypeAlias = tuple[int, int, int, int]  # columns as in ``reading_kernel``

_WRITTEN: Final = {BODY_POSE: 6, INS_POSE: 6, WHEEL_POSE: 3, MEASURE: 0, DRIFT: 0}


def instruction(
    kind: int, place: int = 0, side: int = 0, factor: int = 1
) -> Instruction:
    """Return an instruction; see ``reading_kernel``."""
    return (kind, place, side, factor)


class Program(NamedTuple):
    """Instructions in the table.

    Attributes:
        first: The first of them.
        end: That after the last.
        size: How many numbers they write.
    """

    first: int
    end: int
    size: int


class ReadingTable:
    """Numbers of all robots, a row for each slot of a fleet, and instructions."""

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet
        self._numbers: Floats = np.zeros((0, 1))
        self._instructions: NDArray[np.int64] = np.zeros((0, 4), np.int64)
        self._programs: dict[tuple[Instruction, ...], Program] = {}

    def program(self, instructions: Sequence[Instruction]) -> Program:
        """Return instructions as a program; equal ones are kept once."""
        key = tuple(instructions)
        program = self._programs.get(key)
        if program is None:
            first = len(self._instructions)
            rows = np.array(key, np.int64).reshape(-1, 4)
            self._instructions = np.concatenate([self._instructions, rows])
            written = sum(_WRITTEN.get(kind, 1) for kind, *_ in key)
            program = Program(first, first + len(key), written)
            self._programs[key] = program
        return program

    def run(
        self, jobs: Sequence[tuple[int, Program]], ticks: int
    ) -> tuple[list[float], bool]:
        """Follow programs for robots.

        Args:
            jobs: Slot of each robot, and its program.
            ticks: Simulated time in ticks.

        Returns:
            What was written, robot by robot; and whether some robots have used up
            random numbers, so that ``NumberRow.is_spent``.
        """
        rows = np.array([(slot, each.first, each.end) for slot, each in jobs], np.int64)
        out = np.zeros(sum([each.size for _, each in jobs]))
        fleet = self._fleet
        spent = fill_readings(
            *(rows.reshape(-1, 3), self._instructions, self._numbers, ticks, out),
            *(fleet.columns, fleet.odometry),
        )
        return out.tolist(), bool(spent)

    def row(self, slot: int, width: int) -> Floats:
        """Return the row of a slot; there is room for at least ``width`` numbers."""
        rows, columns = self._numbers.shape
        if slot >= rows or width > columns:
            shape = max(rows, len(self._fleet.columns)), max(columns, width)
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
