r"""Templates of lines, in which a placeholder character (mark) stands for a number.

The engine (``lines.hpp``) writes the numbers of many lines into their templates, in one
call.

A line is ASCII; marks are characters from U+00C0. The lower six bits of a mark are the
sum of

- 32 if the number comes from the series (the array) of the report, and
- 8 times the rounding, plus the number of decimals; a rounding of 3 stands for integers
  and the other special marks below.

The mark of a number can have prefixes, which modify the number: ``FLIPPED``,
``WRAPPED`` and ``POSITIVE``, in this order.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import TYPE_CHECKING, Final, TypeAlias

import numpy as np

from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.protocol.message import LARGEST, Triple, clip_numbers

if TYPE_CHECKING:
    from radarsim.protocol.dialect import Dialect
    from radarsim.protocol.fields import LineReport, ReportGroup

FIRST_MARK: Final = 0xC0
IN_SERIES: Final = 32
WHOLE: Final = "\xd8"
WHOLE_IN_SERIES: Final = "\xf8"
LINE_END: Final = "\xda"
TRUTH: Final = "\xdb"  # writes the number 1 or 0 as True or False
FLIPPED: Final = "\xdc"  # negates the next number; never yields -0.0
WRAPPED: Final = "\xdd"  # wraps the next angle, rad, to (-pi, pi]
POSITIVE: Final = "\xde"  # wraps the next angle, rad, to [0, 2 pi)
LONGEST_NAME: Final = 210  # characters of the name of an object, material or robot
NO_SERIES: Final[Floats] = np.zeros(0)
MOST_MARKS: Final = 256  # cache size, as clients can ask for scans of any length
_BLOCK_END: Final = b"\xf9"  # separator after the lines of each block
_LONGEST_NUMBER: Final = 19  # length of the longest written number, bytes
_TOO_LARGE: Final = -1  # error code of the engine, returned in place of a byte count
# In names, braces would end a field, and non-ASCII characters would count as marks.
_NOT_PRINTABLE: Final = re.compile(r"[^ -z|~]")

# Lines that are sent together: reports, their dialect, a report group or None, and the
# numbers of the group. The lines of the group precede those of the reports.
Block: TypeAlias = (
    "tuple[Iterable[LineReport], Dialect, ReportGroup | None, Sequence[float]]"
)


class Rounding(IntEnum):
    """How a number is rounded to its decimals; the engine uses the same values."""

    NEAREST = 0  # to the nearest; zero never has a minus sign
    FLOAT32 = 1  # rounded like a float32 by C's printf; -0.00 is possible
    TRUNCATED = 2  # cut off in float32: 1.3 is written as 1.2999


# An angle that is a multiple of the step may give a quotient just below an integer,
# because the step is a rounded number.
_STEP_TOLERANCE: Final = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class NumberFormat:
    """The decimals and the rounding of one kind of number in lines; no exponents.

    Formats compare by identity, which makes them fast dictionary keys.

    Attributes:
        decimals: Digits after the point, from 1 to 6.
        rounding: How numbers are rounded to these decimals.
        step: If given, the number is first truncated to an integer multiple of it.
    """

    decimals: int
    rounding: Rounding = Rounding.NEAREST
    step: float | None = None

    def format(self, value: float) -> str:
        """Return a number as text, clipped to a magnitude below 2**31."""
        return self.join([value])

    def cut_to_step(self, value: float) -> float:
        """Truncate a number to a multiple of the step, if the format has a step."""
        if self.step is None or not abs(value) < LARGEST:
            return value
        # The original server stores angles as integer multiples of a rotation unit and
        # converts them to rad when it writes a line.
        return int(value / self.step + _STEP_TOLERANCE) * self.step

    def join(self, values: Sequence[float]) -> str:
        """Return a vector as text, with commas and without spaces."""
        return _fill(marks(self, len(values)), list(map(self.cut_to_step, values)))

    def join_flipped(self, values: Triple, before: str = "") -> str:
        """Return x, y, z or roll, pitch, yaw as text in the axes of the wire."""
        return _fill(vector_marks(self, before), values)


def reduce_text(text: str) -> str:
    """Replace non-ASCII characters by ``?``, because such characters are marks."""
    return text.encode("ascii", "replace").decode("ascii")


def printable_name(text: str, longest: int = LONGEST_NAME) -> str:
    """Reduce a text to printable ASCII with single spaces; the result is never empty.

    Names come from maps and from clients. Braces and all other characters become "?".

    Args:
        text: Any text.
        longest: Maximum length of the result, characters.
    """
    return _NOT_PRINTABLE.sub("?", " ".join(text.split()))[:longest].rstrip() or "?"


@lru_cache(MOST_MARKS)
def marks(number_format: NumberFormat, count: int = 1) -> str:
    """Return placeholders for ``count`` numbers of a format, separated by commas."""
    mark = chr(FIRST_MARK + 8 * number_format.rounding + number_format.decimals)
    return ",".join([mark] * count)


@lru_cache(MOST_MARKS)
def vector_marks(number_format: NumberFormat, before: str = "") -> str:
    """Return placeholders for x, y, z or roll, pitch, yaw, written in the wire's axes.

    Args:
        number_format: Format of each number.
        before: Prefixes of the mark of each number: ``WRAPPED`` and ``POSITIVE``.
    """
    mark = before + marks(number_format)
    return f"{mark},{FLIPPED}{mark},{FLIPPED}{mark}"


@lru_cache(MOST_MARKS)
def series_marks(number_format: NumberFormat, count: int = 1) -> str:
    """Return placeholders for ``count`` numbers of an array, separated by commas."""
    mark = chr(ord(marks(number_format)) + IN_SERIES)
    return ",".join([mark] * count)


def encode_blocks(blocks: Sequence[Block]) -> list[bytes]:
    """Return the encoded lines of each block of reports, each line with CRLF."""
    templates: list[bytes] = []
    numbers: list[float] = []
    series = [NO_SERIES]
    # The loop creates no tuples or lists per report, which would add work for Python's
    # garbage collector.
    for reports, dialect, group, group_numbers in blocks:
        if group is not None:
            templates.append(group.template)
            numbers += group_numbers
        for report in reports:
            line, its_numbers, its_series = report.split(dialect)
            templates.append(line)
            numbers += its_numbers
            if its_series is not NO_SERIES:
                series.append(its_series)
        templates.append(_BLOCK_END)
    lines = fill_lines(templates, numbers, np.concatenate(series))
    return lines.split(_BLOCK_END)[:-1]


def fill_lines(
    templates: Sequence[bytes], numbers: Sequence[float], series: Floats
) -> bytes:
    """Replace the marks in templates by numbers; return the lines, each with CRLF.

    Args:
        templates: Templates of the lines.
        numbers: Numbers of all lines, in the order of their marks; clipped to less than
            2**31 in size.
        series: Numbers of all series, in the order of their marks; clipped as well.
    """
    from radarsim.engine import engine

    marked = np.frombuffer(bytearray().join(templates), np.uint8)
    values = np.array(numbers, np.float64)
    # The size of the output is an upper bound, as an exact count would need to format
    # all numbers twice. A line end is one mark, which becomes two bytes.
    most = 2 * len(marked) + _LONGEST_NUMBER * (len(values) + len(series))
    out = np.zeros(most, np.uint8)
    size = engine.write_lines(marked, values, series, out)
    if size == _TOO_LARGE:
        values, series = clip_numbers(values), clip_numbers(series)
        size = engine.write_lines(marked, values, series, out)
    if size < 0:
        text = marked.tobytes().decode("latin-1")
        raise EngineError(
            f"{len(values)} numbers, and {len(series)} in series,"
            f" expected one number for each mark in {text!r}"
        )
    return out[:size].tobytes()


def _fill(marked: str, numbers: Sequence[float]) -> str:
    template = marked.encode("latin-1")
    return fill_lines([template], numbers, NO_SERIES).decode("ascii")
