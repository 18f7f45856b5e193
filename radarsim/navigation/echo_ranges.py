"""Ranges to drive by: where echoes tell it, to the first thing that blocks a robot.

Theory of operation
===================
The range of a radar beam says where it ended, and thin foliage does not end it: a bush
of 1 m and density .7 takes less than the power that a beam has. Its echoes still tell
where it entered the bush, and that robots do not pass. So of every beam the nearest
echo of what robots cannot pass counts, however thin that is. What robots pass, such as
smoke, counts where a beam ends in it, since nothing beyond has been seen.

Echo lines come before the scan that they belong to. Servers that know no echoes send
none; then ranges alone count.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.protocol.reports import EchoLine, RangeScan, TargetEchoes

ECHO_WAIT: Final = 0.5  # s without echoes after which ranges alone count
_AIR: Final = "rain"  # a kind of echo of nothing that blocks


class EchoCollector:
    """Collects the echo lines of one scan, which arrive before it."""

    def __init__(self) -> None:
        self._time = math.nan
        self._lines: dict[int, TargetEchoes] = {}
        self._line_count = -1

    def take(self, line: EchoLine) -> None:
        """Add a line; a line of another time starts anew."""
        if not _is_same_time(line.time, self._time):
            self._time, self._lines = line.time, {}
        self._line_count = line.lines
        if line.echoes is not None and 0 < line.line <= line.lines:
            self._lines[line.line] = line.echoes

    def of(self, scan: RangeScan) -> Sequence[TargetEchoes] | None:
        """Return all echoes of a scan; None if any line is missing."""
        is_complete = len(self._lines) == self._line_count
        if not is_complete or not _is_same_time(scan.time, self._time):
            return None
        echoes, self._lines, self._line_count = list(self._lines.values()), {}, -1
        return echoes


def _is_same_time(one: float, other: float) -> bool:
    """Compare time stamps; some servers send none, which are nan."""
    return one == other or (math.isnan(one) and math.isnan(other))


def blocked_ranges(ranges: Floats, beams: NDArray[np.int64], lengths: Floats) -> Floats:
    """Return how far a robot could go along each beam, as far as is known.

    Args:
        ranges: (N,) m; ranges of the scan.
        beams: (M,) beams of the blocking echoes of the same scan.
        lengths: (M,) m; their ranges.

    Returns:
        (N,) m; the nearest echo of what robots cannot pass, at most the range.
    """
    nearest = np.array(ranges, np.float64)
    np.minimum.at(nearest, beams, lengths)
    return nearest


def blocking_echoes(
    beam_count: int, echoes: Sequence[TargetEchoes]
) -> tuple[NDArray[np.int64], Floats]:
    """Return the echoes of what robots cannot pass, near and far.

    Args:
        beam_count: Number of beams of the scan; echoes of no beam are left out.
        echoes: Echoes of the scan.

    Returns:
        Beams and ranges in m, (M,) each.
    """
    beams, lengths = [np.zeros(0, np.int64)], [np.zeros(0)]
    for target in echoes:
        if target.robot_passes:
            continue
        counts = (target.beams >= 0) & (target.beams < beam_count)
        counts &= target.ranges >= 0  # nan compares false
        if _AIR in target.kinds:
            counts &= np.array([kind != _AIR for kind in target.kinds], np.bool_)
        beams.append(target.beams[counts])
        lengths.append(target.ranges[counts])
    return np.concatenate(beams), np.concatenate(lengths)
