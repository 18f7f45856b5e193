"""Numbers, vectors and truth values as USARSim writes them.

Reading is lenient where clients in the field are: decimal commas of their locale,
blanks or commas between the numbers of a vector. What cannot be meant, ``nan``,
``1e400`` or ``abc``, is refused, so that it never reaches the simulation.
"""

import functools
import re
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

from radarsim.errors import MalformedMessage
from radarsim.geometry import Floats

LARGEST_READ = 1e9  # m, rad, rad/s; arithmetic on it cannot overflow
LARGEST_WRITTEN = 2.0**31  # the original casts to 32 bit integers

_NUMBER = re.compile(r"[+-]?([0-9]+([.,][0-9]*)?|[.,][0-9]+)([eE][+-]?[0-9]+)?")
_LIST = re.compile(r"[-+0-9.eE, ]*")  # float() would also take nan, inf and 1_0


def read_number(text: str) -> float:
    """Read one number, with a decimal point or a decimal comma.

    >>> read_number("-0,5"), read_number(".4"), read_number("+1")
    (-0.5, 0.4, 1.0)

    Raises:
        MalformedMessage: If it is none, or larger than anything a robot can use.
    """
    digits = text.strip()
    if not _NUMBER.fullmatch(digits):
        raise MalformedMessage(f"{text[:80]!r}, expected a number")
    number = float(digits.replace(",", "."))
    if abs(number) > LARGEST_READ:
        raise MalformedMessage(f"{text[:80]!r}, expected at most {LARGEST_READ:g}")
    return number


def read_numbers(text: str, count: int) -> tuple[float, ...]:
    """Read a vector of at least two numbers in any form that clients send.

    With as many words as numbers, blanks separate, and a comma inside a word is
    the decimal comma of the client's locale. Else commas separate.

    >>> read_numbers("4.5,1.9,1.8", 3) == read_numbers("4,5, 1,9, 1,8", 3)
    True

    Raises:
        MalformedMessage: If these are not that many numbers.
    """
    joined = " ".join(text.split()).replace(" ,", ",")
    words = joined.split()
    if len(words) == count:
        parts = [word.removesuffix(",") for word in words]
    else:
        parts = joined.split(",")
    if len(parts) != count:
        raise MalformedMessage(f"{text[:80]!r}, expected {count} numbers")
    return tuple(read_number(part) for part in parts)


def read_list(text: str) -> list[float]:
    """Read any number of numbers, at least one, between commas, blanks or both.

    Decimal points only: with commas between numbers that nobody has counted, another
    comma cannot be told from them.

    Raises:
        MalformedMessage: If there are none, or one cannot be read or is too large.
    """
    words = text.replace(",", " ").split()
    if not words or not _LIST.fullmatch(text):
        raise MalformedMessage(f"{text[:80]!r}, expected numbers")
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        raise MalformedMessage(f"{text[:80]!r}, expected numbers") from None
    if max(numbers) > LARGEST_READ or min(numbers) < -LARGEST_READ:
        raise MalformedMessage(f"{text[:80]!r}, expected at most {LARGEST_READ:g} each")
    return numbers


def read_flag(text: str, *, any_case: bool) -> bool:
    """Read a truth value: ``true`` is true and all else is false.

    Args:
        text: What the client sent.
        any_case: Whether ``True`` is true as well.
    """
    return (text.lower() if any_case else text) == "true"


class Rule(Enum):
    """What becomes of the digits that are not written."""

    ROUNDED = auto()  # and never a zero with a minus sign
    ENGINE = auto()  # rounded as C's printf does, from float32; -0.00 is possible
    TRUNCATED = auto()  # cut off, in float32: 1.3 gives 1.2999


@dataclass(frozen=True, slots=True)
class NumberFormat:
    """How one kind of number is written; there is never an exponent.

    Attributes:
        decimals: Digits after the point, at least 1.
        rule: What becomes of the others.
        step: If given, the number first falls to a whole multiple of this.
    """

    decimals: int
    rule: Rule = Rule.ROUNDED
    step: float | None = None

    def text(self, value: float) -> str:
        """Write one number.

        Raises:
            ValueError: If it is not finite, or does not fit 32 bits.
        """
        if not abs(value) < LARGEST_WRITTEN:
            raise ValueError(f"number {value!r}, expected less than 2**31 in size")
        if self.step is not None:
            value = int(value / self.step) * self.step
        if self.rule is Rule.ROUNDED:
            return _rounded(value, self.decimals)
        if self.rule is Rule.ENGINE:
            return f"{float(np.float32(value)):.{self.decimals}f}"
        return _truncated(value, self.decimals)

    def join(self, values: Iterable[float]) -> str:
        """Write a vector, commas between its numbers and no blanks."""
        return ",".join([self.text(value) for value in values])


def format_ranges(ranges: Floats, form: NumberFormat) -> str:
    """Write the ranges of a scan, (N,) m, commas between them and no blanks.

    Ranges of two digits within 200 m are looked up: a table is eight times as fast as
    writing them one by one.

    Raises:
        ValueError: If one of them is not finite, or does not fit 32 bits.
    """
    if form not in _TABLED or not np.all((ranges >= 0) & (ranges < _TABLE_END)):
        return form.join(ranges.tolist())
    if form.rule is Rule.TRUNCATED:
        places, unsure = _places_truncated(ranges), np.zeros(0, np.int64)
    else:
        places, unsure = _places_rounded(ranges)
    texts: list[str] = _table()[places].tolist()
    for i in unsure.tolist():
        texts[i] = form.text(float(ranges[i]))
    return ",".join(texts)


def format_shares(shares: Floats, form: NumberFormat) -> list[str]:
    """Write numbers from 0 to 1, (N,), never with a sign; others as they are.

    All at once, which is four times as fast as one by one.

    Raises:
        ValueError: If one of them is not finite, or does not fit 32 bits.
    """
    if form.rule is Rule.TRUNCATED or not np.all((shares >= 0) & (shares <= 1)):
        return [form.text(share + 0.0) for share in shares.tolist()]
    exact = shares.astype(np.float32) if form.rule is Rule.ENGINE else shares
    numbers = np.abs(exact).tolist()
    return (f"%.{form.decimals}f " * len(numbers) % tuple(numbers)).split()


_TABLED = frozenset((NumberFormat(2), NumberFormat(2, Rule.TRUNCATED)))
_TABLE_END = 200.0  # m


@functools.cache
def _table() -> NDArray[np.object_]:
    """Write all whole centimetres up to the table's end, both ends included."""
    whole = int(_TABLE_END) * 100 + 1
    return np.array([f"{n // 100}.{n % 100:02d}" for n in range(whole)], object)


def _places_rounded(ranges: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Give the nearest centimetre of each range, and which are too near to a half."""
    scaled = ranges * 100.0
    places = np.rint(scaled)
    unsure = np.flatnonzero(np.abs(np.abs(scaled - places) - 0.5) < 1e-9)
    return places.astype(np.int64), unsure


def _places_truncated(ranges: Floats) -> NDArray[np.int64]:
    """Give the last centimetre below each range, in float32 as the original does."""
    single = ranges.astype(np.float32)
    whole = np.trunc(single)
    part = ((single - whole) * np.float32(100.0)).astype(np.int64)
    places: NDArray[np.int64] = whole.astype(np.int64) * 100 + part
    return places


def _rounded(value: float, decimals: int) -> str:
    text = f"{value:.{decimals}f}"
    return text.lstrip("-") if float(text) == 0 else text


def _truncated(value: float, decimals: int) -> str:
    single = np.float32(value)
    sign = "-" if single < 0 else ""
    size = abs(single)
    whole = int(size)
    part = int((size - np.float32(whole)) * np.float32(10.0**decimals))
    return f"{sign}{whole}.{part:0{decimals}d}"
