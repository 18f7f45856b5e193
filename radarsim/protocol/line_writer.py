"""Write the numbers of many lines into their templates, in one call of the engine."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from radarsim.engine import engine
from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.fields import LineReport, ReportGroup
from radarsim.protocol.line_template import NO_SERIES
from radarsim.protocol.message import clip_numbers

_BLOCK_END: Final = b"\xf9"  # after the templates of each block
_LONGEST_NUMBER: Final = 19  # bytes
_TOO_LARGE: Final = 1  # result of the engine; 0 if all is written


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


def _write(
    templates: bytes, numbers: Sequence[float], series: Sequence[Floats], blocks: int
) -> tuple[bytes, list[int]]:
    """Return the lines of blocks after each other, and where each block ends."""
    codes = np.frombuffer(templates, np.uint8)
    values, entries = np.array(numbers, np.float64), np.concatenate(series)
    # An upper bound is enough, as the array is cut afterwards; counting exactly would
    # mean to format all numbers twice. Ends of lines have two bytes for one mark.
    most = 2 * len(codes) + _LONGEST_NUMBER * (len(values) + len(entries))
    out, ends = np.empty(most, np.uint8), np.empty(blocks, np.int64)
    code = engine.write_lines(codes, values, entries, out, ends)
    if code == _TOO_LARGE:
        values, entries = clip_numbers(values), clip_numbers(entries)
        code = engine.write_lines(codes, values, entries, out, ends)
    if code:
        counts = f"{len(values)} numbers and {len(entries)} in series"
        raise EngineError(f"{counts}, expected one for each mark of {templates!r}")
    return out[: ends[-1]].tobytes() if blocks else b"", ends.tolist()
