"""The echoes of one scan, which come in several lines before it."""

import math
from collections.abc import Sequence

from radarsim.protocol.reports import EchoLine, RangeScan, Seen


class Gathering:
    """Collects the lines that belong together; holds those of one scan at a time."""

    def __init__(self) -> None:
        self._time = math.nan
        self._lines: dict[int, Seen] = {}
        self._count = -1

    def take(self, line: EchoLine) -> None:
        """Take in a line; one of another time begins anew."""
        if not _is_same(line.time, self._time):
            self._time, self._lines = line.time, {}
        self._count = line.lines
        if line.seen is not None and 0 < line.line <= line.lines:
            self._lines[line.line] = line.seen

    def of(self, scan: RangeScan) -> Sequence[Seen] | None:
        """Give all echoes of a scan; None where none, or not all, were told."""
        if not _is_same(scan.time, self._time) or len(self._lines) != self._count:
            return None
        seen, self._lines, self._count = list(self._lines.values()), {}, -1
        return seen


def _is_same(one: float, other: float) -> bool:
    """Compare time stamps; some servers send none."""
    return one == other or (math.isnan(one) and math.isnan(other))
