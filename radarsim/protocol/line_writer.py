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

_BLOCK_END: Final = b"\xf9"  # after the lines of each block
_LONGEST_NUMBER: Final = 19  # bytes
_TOO_LARGE: Final = -1  # result of the engine instead of the number of bytes


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
    return _write(templates, numbers, series).split(_BLOCK_END)[:-1]


def fill_lines(
    templates: Sequence[bytes], numbers: Sequence[float], series: Floats
) -> bytes:
    """Return lines with CRLF; numbers that do not fit into 32 bits are clipped.

    Args:
        templates: Templates of the lines.
        numbers: Numbers of all lines, in the order of their marks.
        series: Series of all lines, in the order of their marks.
    """
    return _write(templates, numbers, [series])


def _write(
    templates: Sequence[bytes], numbers: Sequence[float], series: Sequence[Floats]
) -> bytes:
    marked = np.frombuffer(bytearray().join(templates), np.uint8)
    values = np.concatenate([np.array(numbers, np.float64), *series])
    # An upper bound, as counting exactly would mean to format all numbers twice. The
    # end of a line has two bytes for one mark.
    out = np.zeros(2 * len(marked) + _LONGEST_NUMBER * len(values), np.uint8)
    size = engine.write_lines(marked, values, len(numbers), out)
    if size == _TOO_LARGE:
        values = clip_numbers(values)
        size = engine.write_lines(marked, values, len(numbers), out)
    if size < 0:
        counts = f"{len(numbers)} numbers and {len(values) - len(numbers)} in series"
        text = marked.tobytes().decode("latin-1")
        raise EngineError(f"{counts}, expected one for each mark of {text!r}")
    return out[:size].tobytes()
