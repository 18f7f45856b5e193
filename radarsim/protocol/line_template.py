r"""Templates of lines: lines with a mark for each number.

The engine (``lines.hpp``) writes the numbers of many lines into their templates, in one
call.

A line is ASCII; marks are characters from U+00C0. The lower six bits of a mark are

- 32 if the number is taken from the series of the report, an array, and
- 8 times its rounding and its decimals; a fourth rounding is for whole numbers, and for
  other texts.

Before the mark of a number there may be others, which change the number: ``FLIPPED``,
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
TRUTH: Final = "\xdb"  # of a number that is 1 or 0
FLIPPED: Final = "\xdc"  # the sign of the number that follows; zero has none
WRAPPED: Final = "\xdd"  # the angle that follows, rad, to (-pi, pi]
POSITIVE: Final = "\xde"  # the angle that follows, rad, to [0, 2 pi)
LONGEST_NAME: Final = 210  # of an object, material or robot: those of maps, and copies
NO_SERIES: Final[Floats] = np.zeros(0)
MOST_MARKS: Final = 256  # that are kept; clients can ask for scans of any length
_BLOCK_END: Final = b"\xf9"  # after the lines of each block
_LONGEST_NUMBER: Final = 19  # bytes
_TOO_LARGE: Final = -1  # result of the engine instead of the number of bytes
# Braces would end a field, and marks of templates are no ASCII.
_NOT_PRINTABLE: Final = re.compile(r"[^ -z|~]")

# Reports whose lines are sent together, after those of a group, which is given by its
# numbers only.
Block: TypeAlias = (
    "tuple[Iterable[LineReport], Dialect, ReportGroup | None, Sequence[float]]"
)


class Rounding(IntEnum):
    """How a number is rounded to its decimals; the values are those in marks."""

    NEAREST = 0  # to the nearest; zero never has a minus sign
    FLOAT32 = 1  # as C's printf rounds a float32; -0.00 is possible
    TRUNCATED = 2  # cut off in float32: 1.3 is written as 1.2999


# A whole number of steps may come out just below, since steps are rounded themselves.
_STEP_TOLERANCE: Final = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class NumberFormat:
    """How one kind of number is written; never with an exponent.

    A format equals only itself, so that it is found quickly as a key.

    Attributes:
        decimals: Digits after the point, from 1 to 6.
        rounding: How numbers are rounded to these decimals.
        step: If given, the number is first cut to a whole multiple of it.
    """

    decimals: int
    rounding: Rounding = Rounding.NEAREST
    step: float | None = None

    def format(self, value: float) -> str:
        """Write one number; one that does not fit into 32 bits is clipped."""
        return self.join([value])

    def cut_to_step(self, value: float) -> float:
        """Return the whole multiple of the step that is written for a number."""
        if self.step is None or not abs(value) < LARGEST:
            return value
        # The original keeps angles as whole units of rotation and converts them back
        # when it writes a line.
        return int(value / self.step + _STEP_TOLERANCE) * self.step

    def join(self, values: Sequence[float]) -> str:
        """Write a vector with commas and without blanks."""
        return _fill(marks(self, len(values)), list(map(self.cut_to_step, values)))

    def join_flipped(self, values: Triple, before: str = "") -> str:
        """Write x, y, z or roll, pitch, yaw, as ``vector_marks`` does."""
        return _fill(vector_marks(self, before), values)


def reduce_text(text: str) -> str:
    """Return a text of ASCII, so that nothing in it is a mark."""
    return text.encode("ascii", "replace").decode("ascii")


def printable_name(text: str, longest: int = LONGEST_NAME) -> str:
    """Return a text of printable ASCII with single blanks; never an empty one.

    Names come from maps and from clients. Every other character, and braces, read "?".

    Args:
        text: Any text.
        longest: Number of characters after which it is cut.
    """
    return _NOT_PRINTABLE.sub("?", " ".join(text.split()))[:longest].rstrip() or "?"


@lru_cache(MOST_MARKS)
def marks(number_format: NumberFormat, count: int = 1) -> str:
    """Return the marks of numbers with commas between them."""
    mark = chr(FIRST_MARK + 8 * number_format.rounding + number_format.decimals)
    return ",".join([mark] * count)


@lru_cache(MOST_MARKS)
def vector_marks(number_format: NumberFormat, before: str = "") -> str:
    """Return the marks of x, y, z or roll, pitch, yaw, written in the wire's axes.

    Args:
        number_format: Format of each.
        before: Marks of other changes of each number, ``WRAPPED`` and ``POSITIVE``.
    """
    mark = before + marks(number_format)
    return f"{mark},{FLIPPED}{mark},{FLIPPED}{mark}"


@lru_cache(MOST_MARKS)
def series_marks(number_format: NumberFormat, count: int = 1) -> str:
    """Return the marks of numbers in the series, with commas between them."""
    mark = chr(ord(marks(number_format)) + IN_SERIES)
    return ",".join([mark] * count)


def encode_blocks(blocks: Sequence[Block]) -> list[bytes]:
    """Return the lines of each block, with CRLF; see ``fill_lines``."""
    templates: list[bytes] = []
    numbers: list[float] = []
    series = [NO_SERIES]
    # A loop that keeps nothing else: what it kept would be looked at by the collector.
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
    """Return lines with CRLF; numbers that do not fit into 32 bits are clipped.

    Args:
        templates: Templates of the lines.
        numbers: Numbers of all lines, in the order of their marks.
        series: Series of all lines, in the order of their marks.
    """
    from radarsim.engine import engine

    marked = np.frombuffer(bytearray().join(templates), np.uint8)
    values = np.array(numbers, np.float64)
    # An upper bound, as counting exactly would mean to format all numbers twice. The
    # end of a line has two bytes for one mark.
    most = 2 * len(marked) + _LONGEST_NUMBER * (len(values) + len(series))
    out = np.zeros(most, np.uint8)
    size = engine.write_lines(marked, values, series, out)
    if size == _TOO_LARGE:
        values, series = clip_numbers(values), clip_numbers(series)
        size = engine.write_lines(marked, values, series, out)
    if size < 0:
        text = marked.tobytes().decode("latin-1")
        raise EngineError(
            f"{len(values)} numbers and {len(series)} in series,"
            f" expected one for each mark of {text!r}"
        )
    return out[:size].tobytes()


def _fill(marked: str, numbers: Sequence[float]) -> str:
    template = marked.encode("latin-1")
    return fill_lines([template], numbers, NO_SERIES).decode("ascii")
