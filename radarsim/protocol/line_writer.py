"""Write the lines of many periodic reports in one compiled call.

The lines are those that ``encode`` of the reports writes, to the last digit. Numbers
below 2**31 with up to six decimals are below 2**52 when they are scaled to whole
numbers, so that their halves are exact. Whatever the kernel cannot write, as a number
that is not finite, its report writes itself.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.protocol.dialect import COMPAT, Dialect
from radarsim.protocol.line_template import (
    FIRST_MARK,
    FLIPPED,
    FLOAT32,
    IN_SERIES,
    LINE_END,
    NEAREST,
    NO_SERIES,
    POSITIVE,
    SKIPPED,
    TRUNCATED,
    TRUTH,
    WRAPPED,
    fill,
)
from radarsim.protocol.numbers import LARGEST
from radarsim.protocol.periodic_reports import PeriodicReport, ReportGroup
from radarsim.protocol.reports import Report, Status, to_bytes

_SKIPPED, _LINE_END, _TRUTH = ord(SKIPPED), ord(LINE_END), ord(TRUTH)
_FLIPPED, _WRAPPED, _POSITIVE = ord(FLIPPED), ord(WRAPPED), ord(POSITIVE)
_BLOCK_END = b"\xf9"  # after the templates of each block
_REFUSED = b"\xfa"  # instead of a template, in a block that is written without kernel
_BLOCK_END_MARK, _REFUSED_MARK = ord(_BLOCK_END), ord(_REFUSED)
_CR, _LF, _MINUS, _POINT = b"\r\n-."
_ZERO = np.uint64(ord("0"))
_POWERS = 10.0 ** np.arange(17)
_TRUE, _FALSE = (np.frombuffer(text, np.uint8) for text in (b"True", b"False"))
_WHOLE_POWERS = _POWERS.astype(np.uint64)
_TEN = np.uint64(10)
_MOST_DECIMALS = 6
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

    reports: Sequence[Report]
    dialect: Dialect
    group: ReportGroup | None = None
    numbers: Sequence[float] = ()


def encode_lines(reports: Sequence[tuple[Report, Dialect]]) -> list[bytes]:
    r"""Return the line of each report in its dialect, with CRLF.

    >>> encode_lines([(Status(1.0, 3600, light=False), COMPAT)])[0][:40]
    b'STA {Type GroundVehicle} {Time 1.00} {Fr'

    Raises:
        ValueError: If a number is not finite or does not fit into 32 bits.
    """
    return encode_blocks([ReportBlock((each,), dialect) for each, dialect in reports])


def encode_blocks(blocks: Sequence[ReportBlock]) -> list[bytes]:
    """Return the lines of each block, with CRLF.

    Raises:
        ValueError: If a number is not finite or does not fit into 32 bits.
    """
    if not blocks:
        return []
    templates: list[bytes] = []
    numbers: list[float] = []
    series = [NO_SERIES]
    # A loop that keeps nothing else: what it kept would be looked at by the collector.
    for reports, dialect, group, group_numbers in blocks:
        if group is not None:
            templates.append(group.template)
            numbers += group_numbers
        for report in reports:
            if not isinstance(report, PeriodicReport):
                templates.append(_REFUSED)
                continue
            line, its_numbers, its_series = report.split(dialect)
            templates.append(line)
            numbers += its_numbers
            if its_series is not NO_SERIES:
                series.append(its_series)
        templates.append(_BLOCK_END)
    data, ends = _write(templates, numbers, series, len(blocks))
    lines = [data[start:end] for start, end in zip([0, *ends], ends, strict=False)]
    if all(lines):
        return lines
    return [
        line or _encode_slowly(block) for line, block in zip(lines, blocks, strict=True)
    ]


def _encode_slowly(block: ReportBlock) -> bytes:
    """Return the lines of a block that the kernel cannot write, or that is empty."""
    lines = [report.encode(block.dialect) for report in block.reports]
    if block.group is None:
        return to_bytes(lines)
    group = fill(block.group.template, block.numbers, NO_SERIES)
    return group.encode("ascii", "replace") + to_bytes(lines)


def fill_block(
    templates: Sequence[bytes], numbers: Sequence[float], series: Floats
) -> bytes:
    """Return the lines of one block, with CRLF; empty if the kernel cannot write it.

    Args:
        templates: Templates of the lines.
        numbers: Numbers of all lines, in the order of their marks.
        series: Series of all lines, in the order of their marks.
    """
    data, _ = _write([*templates, _BLOCK_END], numbers, [series], 1)
    return data


def warm_up() -> None:
    """Compile the kernel, or read it from the cache."""
    encode_lines([(Status(0.0, 0, light=False), COMPAT)])


def _write(
    templates: Sequence[bytes],
    numbers: Sequence[float],
    series: Sequence[Floats],
    blocks: int,
) -> tuple[bytes, list[int]]:
    """Return the blocks after each other, and the end of each; empty if refused."""
    joined = b"".join(templates)
    codes = np.frombuffer(joined, np.uint8)
    values, entries = np.array(numbers, np.float64), np.concatenate(series)
    most = len(codes) + joined.count(_LINE_END)
    most += _LONGEST_NUMBER * (len(values) + len(entries))
    out, ends = np.zeros(most, np.uint8), np.zeros(blocks, np.int64)
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
    """Write blocks of lines.

    Args:
        codes: Templates of the lines; a mark ends each block.
        numbers: Numbers of the lines, in the order of their marks.
        series: Series of the lines, after each other, in the order of their marks.
        out: For the lines, after each other.
        ends: For the end of each block in ``out``. A block that is not written because
            of one of its numbers or lines ends where it begins.
    """
    at = start = block = number = entry = changes = 0
    is_refused = False
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
            ends[block] = start = at = start if is_refused else at
            block += 1
            is_refused = False
        elif code == _REFUSED_MARK:
            is_refused = True
        elif code & IN_SERIES:
            end = _write_number(series[entry], code, out, at)
            is_refused |= end == at
            at, entry = end, entry + 1
        else:
            value = _change_number(numbers[number], changes)
            end = _write_alone(value, code, out, at)
            is_refused |= end == at and code != _SKIPPED
            at, number, changes = end, number + 1, 0


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
    """Return what ``geometry.wrap_angle`` does, for an angle that can be written."""
    if -math.pi < angle <= math.pi or not abs(angle) < LARGEST:
        return angle
    rest = np.fmod(abs(angle), math.tau)  # exact, as all that follows
    other = math.tau - rest
    wrapped = math.copysign(1.0, angle) * (rest if rest <= other else -other)
    return wrapped if wrapped > -math.pi else math.pi


@njit_inline
def _write_alone(value: float, mark: int, out: NDArray[np.uint8], at: int) -> int:
    """Write a number that is not of a series; result as of ``_write_number``."""
    if mark == _SKIPPED:
        return at
    if mark != _TRUTH:
        return _write_number(value, mark, out, at)
    text = _TRUE if value != 0.0 else _FALSE
    for k in range(len(text)):
        out[at + k] = text[k]
    return at + len(text)


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
