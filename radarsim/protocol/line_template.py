r"""Templates of lines: lines with a mark for each number.

Lines are written from their templates one by one here, and many at once by the kernel
in ``line_writer``.

A line is ASCII; marks are characters from U+00C0. The lower six bits of a mark are

- 32 if the number is taken from the series of the report, an array, and
- 8 times its rounding and its decimals; a fourth rounding is for whole numbers, and for
  what is written otherwise.

Before the mark of a number there may be others, which change the number: ``FLIPPED``,
``WRAPPED`` and ``POSITIVE``, in this order.

>>> fill(template("SEN", [("Pose", marks(NumberFormat(2), 3))]), (1, 2, 3), NO_SERIES)
'SEN {Pose 1.00,2.00,3.00}\r\n'
"""

import math
import re
from collections.abc import Callable, Iterable, Sequence
from typing import Final, TypeAlias

import numpy as np

from radarsim.geometry import Floats, wrap_angle
from radarsim.protocol.message import Message
from radarsim.protocol.numbers import NumberFormat, Rounding

Fields: TypeAlias = Sequence[tuple[str, str]]

# compiled into kernels
FIRST_MARK: Final = 0xC0
IN_SERIES: Final = 32
NEAREST, FLOAT32, TRUNCATED = range(3)  # roundings in marks
WHOLE: Final = "\xd8"
WHOLE_IN_SERIES: Final = "\xf8"
SKIPPED: Final = "\xd9"  # a number that is not written
LINE_END: Final = "\xda"
TRUTH: Final = "\xdb"  # of a number that is 1 or 0
FLIPPED: Final = "\xdc"  # the sign of the number that follows; zero has none
WRAPPED: Final = "\xdd"  # the angle that follows, rad, to (-pi, pi]
POSITIVE: Final = "\xde"  # the angle that follows, rad, to [0, 2 pi)
LONGEST_NAME: Final = 210  # of an object, material or robot: those of maps, and copies
NO_SERIES: Final[Floats] = np.zeros(0)

_ROUNDINGS: Final = (Rounding.NEAREST, Rounding.FLOAT32, Rounding.TRUNCATED)
_FORMATS: Final = {
    FIRST_MARK + 8 * number + decimals: NumberFormat(decimals, rounding)
    for number, rounding in enumerate(_ROUNDINGS)
    for decimals in range(1, 8)
}
_MARKS: Final = {number_format: mark for mark, number_format in _FORMATS.items()}
_NOT_PRINTABLE: Final = re.compile(r"[^ -z|~]")
_MARK: Final = re.compile("[\xdc-\xde]*[\xc0-\xdb\xe0-\xff]")


def template(verb: str, fields: Fields) -> bytes:
    """Return the template of a line; values are of marks and of ``reduce_text``."""
    return f"{Message(verb, tuple(fields)).encode()}{LINE_END}".encode("latin-1")


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


def marks(number_format: NumberFormat, count: int = 1) -> str:
    """Return the marks of numbers with commas between them."""
    return ",".join([chr(_MARKS[number_format])] * count)


def vector_marks(number_format: NumberFormat) -> str:
    """Return the marks of x, y, z, which are written in the axes of the wire."""
    mark = marks(number_format)
    return f"{mark},{FLIPPED}{mark},{FLIPPED}{mark}"


def angle_marks(number_format: NumberFormat, *, positive: bool = False) -> str:
    """Return the marks of roll, pitch, yaw, rad, which are written likewise.

    Args:
        number_format: Format of each.
        positive: Whether they are written in [0, 2 pi), not in (-pi, pi].
    """
    mark = f"{WRAPPED}{POSITIVE if positive else ''}{marks(number_format)}"
    return f"{mark},{FLIPPED}{mark},{FLIPPED}{mark}"


def series_marks(number_format: NumberFormat, count: int = 1) -> str:
    """Return the marks of numbers in the series, with commas between them."""
    return ",".join([chr(_MARKS[number_format] + IN_SERIES)] * count)


def fill(lines: bytes, numbers: Iterable[float], series: Floats) -> str:
    """Write lines with their ends.

    Args:
        lines: Templates of the lines, after each other.
        numbers: Numbers in the order of their marks.
        series: (N,) numbers of the series in the order of their marks.

    Raises:
        ValueError: If a number is not finite or does not fit into 32 bits.
    """
    alone, in_series = iter(numbers), iter(series.tolist())

    def write(match: re.Match[str]) -> str:
        changes, last = match[0][:-1], match[0][-1]
        if last == LINE_END:
            return "\r\n"
        mark = ord(last)
        number = next(in_series if mark & IN_SERIES else alone)
        for change in changes:
            number = _CHANGES[change](number)
        if last == SKIPPED:
            return ""
        if last == TRUTH:
            return str(number != 0)
        number_format = _FORMATS.get(mark & ~IN_SERIES)
        return number_format.format(number) if number_format else str(int(number))

    return _MARK.sub(write, lines.decode("latin-1"))


_CHANGES: Final[dict[str, Callable[[float], float]]] = {
    FLIPPED: lambda number: 0.0 - number,
    WRAPPED: wrap_angle,
    POSITIVE: lambda angle: angle % math.tau,
}
