r"""Templates of lines, and the reports whose lines are written from one.

Between two readings of an item only numbers in its line change. A template is the line
with a mark for each number, and it is made once for each item and dialect. Lines are
written from it one by one here, and many at once by the kernel in ``line_writer``.

A line is ASCII; marks are characters from U+00C0. The mark of a number has 16 times its
rounding and its decimals in its lower six bits.

>>> fill(template("SEN", [("Pose", marks(NumberFormat(2), 3))]), (1, 2, 3), NO_SERIES)
'SEN {Pose 1.00,2.00,3.00}'
"""

import re
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from typing import Final, TypeAlias

import numpy as np

from radarsim.geometry import Floats
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.message import Message
from radarsim.protocol.numbers import NumberFormat, Rounding

Fields: TypeAlias = Sequence[tuple[str, str]]
Split: TypeAlias = tuple[bytes, tuple[float, ...], Floats]

# compiled into kernels
FIRST_MARK: Final = 0xC0
NEAREST, FLOAT32, TRUNCATED = range(3)  # roundings in the mark of a number
WHOLE: Final = "\xf0"  # marks a whole number
SKIPPED: Final = "\xf1"  # marks a number that is not written
SERIES: Final = "\xf2"  # marks the length of the series, before the mark of its numbers
LINE_END: Final = "\xf3"
NO_SERIES: Final[Floats] = np.zeros(0)

_ROUNDINGS: Final = (Rounding.NEAREST, Rounding.FLOAT32, Rounding.TRUNCATED)
_FORMATS: Final = {
    chr(FIRST_MARK + 16 * number + decimals): NumberFormat(decimals, rounding)
    for number, rounding in enumerate(_ROUNDINGS)
    for decimals in range(1, 16)
}
_MARKS: Final = {number_format: mark for mark, number_format in _FORMATS.items()}
_MARK: Final = re.compile(f"{SERIES}?[{chr(FIRST_MARK)}-{SKIPPED}]")


class PeriodicReport:
    """A report that is sent many times, each time with the same template."""

    __slots__ = ()

    @abstractmethod
    def split(self, dialect: Dialect) -> Split:
        """Return the template of the line, its numbers in their order, and its series.

        The length of the series, if there is one, is the last of the numbers.

        Raises:
            ValueError: If a number that is part of the template is not finite.
        """

    def encode(self, dialect: Dialect) -> str:
        """Write the report as one line without its end.

        Raises:
            ValueError: If a number is not finite.
        """
        return fill(*self.split(dialect))


def template(verb: str, fields: Fields) -> bytes:
    """Return the template of a line; values are of marks and of ``reduce_text``."""
    return f"{Message(verb, tuple(fields)).encode()}{LINE_END}".encode("latin-1")


def reduce_text(text: str) -> str:
    """Return a text of ASCII, so that nothing in it is a mark."""
    return text.encode("ascii", "replace").decode("ascii")


def marks(number_format: NumberFormat, count: int = 1) -> str:
    """Return the marks of numbers with commas between them."""
    return ",".join([_MARKS[number_format]] * count)


def fill(line: bytes, numbers: Iterable[float], series: Floats) -> str:
    """Write a line without its end.

    Args:
        line: Template of the line.
        numbers: Numbers in their order, last the length of the series.
        series: (N,) numbers of the series; empty if the line has none.

    Raises:
        ValueError: If a number is not finite or does not fit into 32 bits.
    """
    rest = iter(numbers)

    def write(match: re.Match[str]) -> str:
        mark = match[0]
        number = next(rest)
        if mark == SKIPPED:
            return ""
        if mark == WHOLE:
            return str(int(number))
        if mark[0] == SERIES:
            return _FORMATS[mark[1]].join(series.tolist())
        return _FORMATS[mark].format(number)

    return _MARK.sub(write, line.decode("latin-1").removesuffix(LINE_END))
