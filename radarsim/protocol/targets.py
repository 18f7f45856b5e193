"""Target lines: the targets that the detector of a radar found in one turn.

They are the targets of a spectrum: a beam can have many, and each has a power. The
objects behind them are unknown, to a real radar as well.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isnan
from typing import ClassVar, Final, Self

import numpy as np
from numpy.typing import NDArray

from radarsim.errors import MalformedMessage
from radarsim.geometry import Floats
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.line_template import (
    WHOLE,
    WHOLE_IN_SERIES,
    Fields,
    reduce_text,
    series_marks,
)
from radarsim.protocol.message import Message
from radarsim.protocol.numbers import parse_list, parse_number
from radarsim.protocol.periodic_reports import SensorReport, Split, find_template

# A line has at most 4095 bytes. A target takes up to 29 of them (six digits of the
# beam, ten of the range and of the power), and everything else less than 300.
TARGETS_A_LINE: Final = 130


@dataclass(frozen=True, slots=True, eq=False)
class RadarTargets(SensorReport):
    """Targets of one turn of a radar, as many as fit into a line.

    Attributes:
        name: Name of the scanner.
        line: Number of the line, from 1 to ``lines``; 0 for a turn without targets.
        lines: Number of lines of the turn; 0 for one without targets.
        beams: (T,) int64, beam of each target, counted from 0 at the right.
        ranges: (T,) m.
        dbm: (T,) received power, dBm.
    """

    sensor_type: ClassVar[str] = "RadarTargets"

    name: str
    line: int
    lines: int
    beams: NDArray[np.int64]
    ranges: Floats
    dbm: Floats

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message."""
        words = (message.get("Targets") or "").split()
        numbers = np.array([_parse_target(word) for word in words]).reshape(-1, 3)
        return cls(
            message.number_or_nan("Time"),
            message.name,
            int(message.parse("Line", parse_number)),
            int(message.parse("Lines", parse_number)),
            numbers[:, 0].astype(np.int64),
            numbers[:, 1],
            numbers[:, 2],
        )

    @staticmethod
    def fields(dialect: Dialect, fixed: tuple[str, int]) -> Fields:
        """Return the fields after time and type, with marks for numbers."""
        name, count = fixed
        fields = (("Name", reduce_text(name)), ("Line", WHOLE), ("Lines", WHOLE))
        if not count:
            return fields
        target = f"{WHOLE_IN_SERIES},{series_marks(dialect.ranges, 2)}"
        return (*fields, ("Targets", " ".join([target] * count)))

    def split(self, dialect: Dialect) -> Split:
        """Return the template of the line, its numbers, and its series."""
        fixed = (self.name, len(self.beams))
        line = find_template(RadarTargets, dialect, isnan(self.time), fixed)
        series = np.column_stack((self.beams, self.ranges, self.dbm))
        numbers = (self.time, self.line, self.lines)
        return line, numbers, series.astype(np.float64).ravel()


def target_lines(
    time: float, scanner: str, beams: NDArray[np.int64], ranges: Floats, dbm: Floats
) -> Sequence[RadarTargets]:
    """Return the target lines of a turn, at least one.

    Args:
        time: s.
        scanner: Name of the scanner item.
        beams: (T,) beam of each target.
        ranges: (T,) m.
        dbm: (T,) dBm.
    """
    count = -(-len(beams) // TARGETS_A_LINE)
    if not count:
        return [RadarTargets(time, scanner, 0, 0, beams, ranges, dbm)]
    lines = []
    for number in range(count):
        some = slice(number * TARGETS_A_LINE, (number + 1) * TARGETS_A_LINE)
        columns = beams[some], ranges[some], dbm[some]
        lines.append(RadarTargets(time, scanner, number + 1, count, *columns))
    return lines


def _parse_target(word: str) -> list[float]:
    numbers = parse_list(word)
    if len(numbers) != 3:
        raise MalformedMessage(f"target {word[:80]!r}, expected three numbers")
    return numbers
