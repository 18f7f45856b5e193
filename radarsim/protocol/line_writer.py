"""Write the numbers of many lines into their templates, in one compiled call.

Numbers below 2**31 with up to six decimals are below 2**52 when they are scaled to
whole numbers, so that their halves are exact: the digits are those of ``NumberFormat``.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.fields import LineReport, ReportGroup
from radarsim.protocol.line_template import (
    FIRST_MARK,
    FLIPPED,
    FLOAT32,
    IN_SERIES,
    LINE_END,
    NEAREST,
    NO_SERIES,
    POSITIVE,
    TRUNCATED,
    TRUTH,
    WRAPPED,
)
from radarsim.protocol.message import LARGEST, clip_numbers

_LINE_END, _TRUTH = ord(LINE_END), ord(TRUTH)
_FLIPPED, _WRAPPED, _POSITIVE = ord(FLIPPED), ord(WRAPPED), ord(POSITIVE)
_BLOCK_END = b"\xf9"  # after the templates of each block
_BLOCK_END_MARK = ord(_BLOCK_END)
_CR, _LF, _MINUS, _POINT = b"\r\n-."
_ZERO = np.uint64(ord("0"))
_POWERS = 10.0 ** np.arange(17)
_TRUE, _FALSE = (np.frombuffer(text, np.uint8) for text in (b"True", b"False"))
_WHOLE_POWERS = _POWERS.astype(np.uint64)
_TEN = np.uint64(10)
_LONGEST_NUMBER = 19  # sign, ten digits, point, six decimals; a truth value is less
_SPLITTER = 2.0**27 + 1.0  # of a double into two halves of its digits


class ReportBlock(NamedTuple):
    """Reports of which the lines are sent together.

    Attributes:
        reports: Reports that are there; they follow those of the group.
        dialect: Their dialect.
        group: Reports of which there are only the numbers; None for no group.
        numbers: The numbers of the group.
    """

    reports: Sequence[LineReport]
    dialect: Dialect
    group: ReportGroup | None = None
    numbers: Sequence[float] = ()


def encode_blocks(blocks: Sequence[ReportBlock]) -> list[bytes]:
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
    data, ends = _write(b"".join(templates), numbers, series, len(blocks))
    return [data[start:end] for start, end in zip([0, *ends], ends, strict=False)]


def fill_lines(
    templates: Sequence[bytes], numbers: Sequence[float], series: Floats
) -> bytes:
    """Return lines with CRLF; numbers that do not fit into 32 bits are clipped.

    Args:
        templates: Templates of the lines.
        numbers: Numbers of all lines, in the order of their marks.
        series: Series of all lines, in the order of their marks.
    """
    return _write(b"".join([*templates, _BLOCK_END]), numbers, [series], 1)[0]


def warm_up() -> None:
    """Compile the kernel, or read it from the cache."""
    fill_lines([], (), NO_SERIES)


def _write(
    templates: bytes, numbers: Sequence[float], series: Sequence[Floats], blocks: int
) -> tuple[bytes, list[int]]:
    """Return the lines of blocks after each other, and where each block ends."""
    codes = np.frombuffer(templates, np.uint8)
    values, entries = np.array(numbers, np.float64), np.concatenate(series)
    # An upper bound is enough, as the array is cut afterwards; counting exactly would
    # mean to format all numbers twice.
    most = len(codes) + templates.count(_LINE_END)
    most += _LONGEST_NUMBER * (len(values) + len(entries))
    out, ends = np.zeros(most, np.uint8), np.zeros(blocks, np.int64)
    if write_lines(codes, values, entries, out, ends) != 0.0:
        values, entries = clip_numbers(values), clip_numbers(entries)
        write_lines(codes, values, entries, out, ends)
    return out[: ends[-1]].tobytes() if blocks else b"", ends.tolist()


@njit_cached
def write_lines(
    codes: NDArray[np.uint8],
    numbers: Floats,
    series: Floats,
    out: NDArray[np.uint8],
    ends: NDArray[np.int64],
) -> float:
    """Write blocks of lines.

    Args:
        codes: Templates of the lines; a mark ends each block.
        numbers: Numbers of the lines, in the order of their marks.
        series: Series of the lines, after each other, in the order of their marks.
        out: For the lines, after each other.
        ends: For the end of each block in ``out``.

    Returns:
        A number that cannot be written, after which nothing is; 0 if there is none.
    """
    # One pass over the templates of all robots, as a tick can have hundreds of
    # lines and each call of a kernel costs about as much as one of them (row j
    # of the benchmarks).
    at = block = number = entry = changes = 0
    for code in codes:
        if code < FIRST_MARK:
            out[at] = code
            at += 1
        elif _FLIPPED <= code <= _POSITIVE:
            changes |= 1 << (code - _FLIPPED)
        elif code == _LINE_END:
            out[at], out[at + 1] = _CR, _LF
            at += 2
        elif code == _BLOCK_END_MARK:
            ends[block] = at
            block += 1
        elif code & IN_SERIES:
            value = series[entry]
            # Also true of NaN. The digits below would not end otherwise.
            if not abs(value) < LARGEST:
                return float(value)
            at, entry = _write_number(value, code, out, at), entry + 1
        else:
            value = numbers[number]
            if not abs(value) < LARGEST:
                return float(value)
            if code == _TRUTH:
                at = _write_truth(value, out, at)
            else:
                value = _change_number(value, changes)
                at = _write_number(value, code, out, at)
            number, changes = number + 1, 0
    return 0.0


@njit_inline
def _change_number(value: float, changes: int) -> float:
    """Return a number as the marks before its own change it; their bits are set."""
    if changes & 1:  # FLIPPED
        value = 0.0 - value
    if changes & 2:  # WRAPPED
        value = _wrap_angle(value)
    if changes & 4:  # POSITIVE
        value += math.tau if value < 0.0 else 0.0  # -0.0 becomes 0.0
    return value


@njit_inline
def _wrap_angle(angle: float) -> float:
    """Return what ``geometry.wrap_angle`` does."""
    if -math.pi < angle <= math.pi:
        return angle
    rest = np.fmod(abs(angle), math.tau)  # exact, as all that follows
    other = math.tau - rest
    wrapped = math.copysign(1.0, angle) * (rest if rest <= other else -other)
    return wrapped if wrapped > -math.pi else math.pi


@njit_inline
def _write_truth(value: float, out: NDArray[np.uint8], at: int) -> int:
    """Write a number that is 1 or 0 at a place; return the place after it."""
    text = _TRUE if value != 0.0 else _FALSE
    for k in range(len(text)):
        out[at + k] = text[k]
    return at + len(text)


@njit_inline
def _write_number(value: float, mark: int, out: NDArray[np.uint8], at: int) -> int:
    """Write a number at a place; return the place after it."""
    rounding, decimals = mark >> 3 & 3, mark & 7
    scale = _POWERS[decimals]
    is_negative = value < 0.0
    if rounding == TRUNCATED:
        single = np.float32(value)
        size = abs(single)
        whole = np.trunc(size)
        # Never as much as the scale: the largest fraction of single precision times a
        # power of ten is nearer to the number below that power.
        rest = np.trunc((size - whole) * np.float32(scale))
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
    # Digits are written from the last to the first, since a division yields the last.
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
