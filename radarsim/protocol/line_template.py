r"""Templates of lines: lines with a mark for each number.

The engine (``lines.hpp``) writes the numbers of many lines into their templates.

A line is ASCII; marks are characters from U+00C0. The lower six bits of a mark are

- 32 if the number is taken from the series of the report, an array, and
- 8 times its rounding and its decimals; a fourth rounding is for whole numbers, and for
  what is written otherwise.

Before the mark of a number there may be others, which change the number: ``FLIPPED``,
``WRAPPED`` and ``POSITIVE``, in this order.
"""

import re
from functools import lru_cache
from typing import Final

import numpy as np

from radarsim.geometry import Floats
from radarsim.protocol.dialect import NumberFormat, Rounding

FIRST_MARK: Final = 0xC0
IN_SERIES: Final = 32
NEAREST, FLOAT32, TRUNCATED = range(3)  # roundings in marks
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

_ROUNDINGS: Final = {
    Rounding.NEAREST: NEAREST,
    Rounding.FLOAT32: FLOAT32,
    Rounding.TRUNCATED: TRUNCATED,
}
# Braces would end a field, and marks of templates are no ASCII.
_NOT_PRINTABLE: Final = re.compile(r"[^ -z|~]")


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
    rounding = _ROUNDINGS[number_format.rounding]
    return ",".join([chr(FIRST_MARK + 8 * rounding + number_format.decimals)] * count)


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
