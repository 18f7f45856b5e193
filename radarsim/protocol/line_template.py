r"""Templates of lines: lines with a mark for each number.

Lines are written from their templates one by one here, and many at once by the kernel
in ``line_writer``.

A line is ASCII; marks are characters from U+00C0. The lower six bits of a mark are

- 32 if the number is taken from the series of the report, an array, and
- 8 times its rounding and its decimals; a fourth rounding is for whole numbers.

>>> fill(template("SEN", [("Pose", marks(NumberFormat(2), 3))]), (1, 2, 3), NO_SERIES)
'SEN {Pose 1.00,2.00,3.00}'
"""

import re
from collections.abc import Iterable, Sequence
from typing import Final, TypeAlias

import numpy as np

from radarsim.geometry import Floats
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
_MARK: Final = re.compile(f"[{chr(FIRST_MARK)}-{SKIPPED}\xe0-\xff]")


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


def series_marks(number_format: NumberFormat, count: int = 1) -> str:
    """Return the marks of numbers in the series, with commas between them."""
    return ",".join([chr(_MARKS[number_format] + IN_SERIES)] * count)


def fill(line: bytes, numbers: Iterable[float], series: Floats) -> str:
    """Write a line without its end.

    Args:
        line: Template of the line.
        numbers: Numbers in the order of their marks.
        series: (N,) numbers of the series in the order of their marks.

    Raises:
        ValueError: If a number is not finite or does not fit into 32 bits.
    """
    alone, in_series = iter(numbers), iter(series.tolist())

    def write(match: re.Match[str]) -> str:
        mark = ord(match[0])
        number = next(in_series if mark & IN_SERIES else alone)
        if mark == ord(SKIPPED):
            return ""
        number_format = _FORMATS.get(mark & ~IN_SERIES)
        return number_format.format(number) if number_format else str(int(number))

    return _MARK.sub(write, line.decode("latin-1").removesuffix(LINE_END))
