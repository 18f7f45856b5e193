"""Write the lines of many periodic reports in one compiled call.

The lines are those that ``encode`` of the reports writes, to the last digit. Numbers
below 2**31 with up to six decimals are below 2**52 when they are scaled to whole
numbers, so that their halves are exact. Whatever the kernel cannot write, as a number
that is not finite, its report writes itself.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.protocol.dialect import COMPAT, Dialect
from radarsim.protocol.line_template import (
    FIRST_MARK,
    FLOAT32,
    IN_SERIES,
    LINE_END,
    NEAREST,
    NO_SERIES,
    SKIPPED,
    TRUNCATED,
)
from radarsim.protocol.numbers import LARGEST
from radarsim.protocol.periodic_reports import PeriodicReport
from radarsim.protocol.reports import Report, Status, to_bytes

_SKIPPED, _LINE_END = ord(SKIPPED), ord(LINE_END)
_LEFT_OUT = LINE_END.encode("latin-1")  # template of a line that its report writes
_CR, _LF, _MINUS, _POINT = b"\r\n-."
_ZERO = np.uint64(ord("0"))
_POWERS = 10.0 ** np.arange(17)
_WHOLE_POWERS = _POWERS.astype(np.uint64)
_TEN = np.uint64(10)
_MOST_DECIMALS = 6
_LONGEST_NUMBER = 19  # sign, ten digits, point, six decimals; a line end is less
_SPLITTER = 2.0**27 + 1.0  # of a double into two halves of its digits


def encode_lines(reports: Sequence[tuple[Report, Dialect]]) -> list[bytes]:
    r"""Return the line of each report in its dialect, with CRLF.

    >>> encode_lines([(Status(1.0, 3600, light=False), COMPAT)])[0][:40]
    b'STA {Type GroundVehicle} {Time 1.00} {Fr'

    Raises:
        ValueError: If a number is not finite or does not fit into 32 bits.
    """
    if not reports:
        return []
    templates: list[bytes] = []
    numbers: list[float] = []
    series = [NO_SERIES]
    # A loop that keeps nothing else: what it kept would be looked at by the collector.
    for report, dialect in reports:
        if isinstance(report, PeriodicReport):
            line, its_numbers, its_series = report.split(dialect)
            templates.append(line)
            numbers += its_numbers
            if its_series is not NO_SERIES:
                series.append(its_series)
        else:
            templates.append(_LEFT_OUT)
    data, ends = _write(templates, numbers, series)
    lines = [data[start:end] for start, end in zip([0, *ends], ends, strict=False)]
    if all(lines):
        return lines
    return [
        line or to_bytes([report.encode(dialect)])
        for line, (report, dialect) in zip(lines, reports, strict=True)
    ]


def warm_up() -> None:
    """Compile the kernel, or read it from the cache."""
    encode_lines([(Status(0.0, 0, light=False), COMPAT)])


def _write(
    templates: Sequence[bytes], numbers: Sequence[float], series: Sequence[Floats]
) -> tuple[bytes, list[int]]:
    """Return the lines after each other, and the end of each; empty if refused."""
    codes = np.frombuffer(b"".join(templates), np.uint8)
    values, entries = np.array(numbers, np.float64), np.concatenate(series)
    most = len(codes) + len(templates) + _LONGEST_NUMBER * (len(values) + len(entries))
    out, ends = np.zeros(most, np.uint8), np.zeros(len(templates), np.int64)
    write_lines(codes, values, entries, out, ends)
    return out[: ends[-1]].tobytes(), ends.tolist()


@njit_cached
def write_lines(
    codes: NDArray[np.uint8],
    numbers: Floats,
    series: Floats,
    out: NDArray[np.uint8],
    ends: NDArray[np.int64],
) -> None:
    """Write lines.

    Args:
        codes: Templates of the lines.
        numbers: Numbers of the lines, in the order of their marks.
        series: Series of the lines, after each other, in the order of their marks.
        out: For the lines, after each other.
        ends: For the end of each line in ``out``. A line that is not written because of
            one of its numbers ends where it begins.
    """
    at = start = line = number = entry = 0
    is_refused = False
    for code in codes:
        if code < FIRST_MARK:
            out[at] = code
            at += 1
        elif code == _LINE_END:
            at = start if is_refused else _end_line(out, start, at)
            ends[line] = start = at
            line += 1
            is_refused = False
        elif code == _SKIPPED:
            number += 1
        else:
            if code & IN_SERIES:
                value = series[entry]
                entry += 1
            else:
                value = numbers[number]
                number += 1
            end = _write_number(value, code, out, at)
            is_refused |= end == at
            at = end


@njit_inline
def _end_line(out: NDArray[np.uint8], start: int, at: int) -> int:
    """Write the end of a line, unless it is empty; return the place after it."""
    if at == start:
        return at
    out[at], out[at + 1] = _CR, _LF
    return at + 2


@njit_inline
def _write_number(value: float, mark: int, out: NDArray[np.uint8], at: int) -> int:
    """Write a number at a place; return the place after it, or the same if refused."""
    if not abs(value) < LARGEST:
        return at
    rounding, decimals = mark >> 3 & 3, mark & 7
    if decimals > _MOST_DECIMALS:
        return at
    scale = _POWERS[decimals]
    is_negative = value < 0.0
    if rounding == TRUNCATED:
        single = np.float32(value)
        size = abs(single)
        whole = np.trunc(size)
        rest = np.trunc((size - whole) * np.float32(scale))
        if rest >= scale:  # rounded up to one more digit, which no number has
            return at
        scaled = int(whole) * int(scale) + int(rest)
        is_negative = bool(single < 0.0)
    elif rounding == FLOAT32:
        single = np.float32(value)
        scaled = _scale(np.float64(abs(single)), scale)
        is_negative = bool(np.signbit(single))
    elif rounding == NEAREST:
        scaled = _scale(abs(value), scale)
        is_negative = is_negative and scaled != 0
    else:  # whole
        scaled = int(abs(value))
        is_negative = is_negative and scaled != 0
    if is_negative:
        out[at] = _MINUS
        at += 1
    return _write_digits(scaled, decimals, out, at)


@njit_inline
def _scale(size: float, scale: float) -> int:
    """Return a product as a whole number, rounded once; exact halves become even."""
    product = size * scale
    whole = np.rint(product)
    if abs(product - whole) == 0.5:
        # The product may have been rounded to the half. Its error is exact: the upper
        # half of the digits times a scale of 20 bits is, and so is the lower half.
        split = size * _SPLITTER
        upper = split - (split - size)
        error = (upper * scale - product) + (size - upper) * scale
        if error > 0.0:
            whole = product + 0.5
        elif error < 0.0:
            whole = product - 0.5
    return int(whole)


@njit_inline
def _write_digits(scaled: int, decimals: int, out: NDArray[np.uint8], at: int) -> int:
    """Write a scaled number with its point at a place; return the place after it."""
    rest = np.uint64(scaled)  # whose division is faster
    digits = decimals + 1
    while rest >= _WHOLE_POWERS[digits]:
        digits += 1
    end = at + digits + (decimals > 0)
    place = end
    for _ in range(decimals):
        place -= 1
        rest = _write_last_digit(rest, out, place)
    if decimals:
        place -= 1
        out[place] = _POINT
    while place > at:
        place -= 1
        rest = _write_last_digit(rest, out, place)
    return end


@njit_inline
def _write_last_digit(number: np.uint64, out: NDArray[np.uint8], at: int) -> np.uint64:
    """Write the last digit of a number; return the number without it."""
    rest = number // _TEN
    out[at] = _ZERO + (number - rest * _TEN)
    return rest
