"""A scan as maps take it: how far each beam is known, what ended it, what it met.

Theory of operation
===================
A range alone says that a beam got so far; a radar that sees through foliage ends there
at something opaque, or where its power runs out. Echoes tell the two apart, and tell
where foliage and smoke begin and end. Where no echoes are told, each range is taken for
something opaque, and nothing is known of foliage.

What a beam met are marks: something opaque is a point, foliage and smoke are stretches
of the beam. A range below the least one tells nothing: a laser in smoke reads zero.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose2
from radarsim.jit import njit_cached
from radarsim.protocol.reports import RangeScan, TargetEchoes


class BeamEnd(IntEnum):
    """What ended a beam."""

    NOTHING = 0  # it reached the maximum range
    UNSURE = 1  # a range without echoes
    HIT = 2
    SPENT = 3  # its power ran out
    AIR = 4  # a drop of rain
    BLIND = 5  # it measured nothing


class Layer(IntEnum):
    """What the evidence in a map is of, and what beams hit."""

    SOLID = 0
    FOLIAGE = 1  # and whatever else beams enter and robots do not
    SMOKE = 2  # and whatever else beams and robots enter
    BEAM_END = 3  # where beams end, whatever ends them; never of a single hit


_KINDS: Final = {"enter": 0, "leave": 1, "sheet": 2, "hit": 3, "spent": 4, "rain": 5}
_LEAVE, _SHEET, _HIT, _SPENT, _RAIN = 1, 2, 3, 4, 5
_ENDS: Final = np.array(
    [
        BeamEnd.BLIND,
        BeamEnd.BLIND,
        BeamEnd.BLIND,
        BeamEnd.HIT,
        BeamEnd.SPENT,
        BeamEnd.AIR,
    ],
    np.int8,
)
ROUNDING: Final = 0.006  # m; what a range on the wire may be short of the greatest one


class BeamHits(NamedTuple):
    """What beams met, a row each.

    Attributes:
        beams: (K,) int64.
        near: (K,) m, where it begins.
        far: (K,) m, where it ends; the same for a point.
        what: (K,) Layer.SOLID, Layer.FOLIAGE or Layer.SMOKE.
    """

    beams: NDArray[np.int64]
    near: Floats
    far: Floats
    what: NDArray[np.int8]


@dataclass(frozen=True, slots=True, eq=False)
class PlanarScan:
    """What a scanner saw at one time, in the plane.

    Attributes:
        time: s.
        mount: Of the scanner on the robot.
        angles: (N,) rad from the scanner's forward axis, counter-clockwise.
        reach: (N,) m, how far each beam is known: to its end, or the greatest range
            where there is none; 0 for one that tells nothing.
        ends: (N,) what ended it, BeamEnd.NOTHING to BeamEnd.BLIND.
        marks: What the beams met.
        sees_through: Whether the marks tell of foliage and smoke too.
    """

    time: float
    mount: Pose2
    angles: Floats
    reach: Floats
    ends: NDArray[np.int8]
    hits: BeamHits
    sees_through: bool

    def points(self, *, sure: bool = True) -> tuple[Floats, Floats]:
        """Give where beams ended, in the robot's frame.

        Args:
            sure: Leave out the ends at which power ran out, if these are known.

        Returns:
            (K, 2) m, and (K, 2) unit vectors along their beams.
        """
        chosen = (self.ends == BeamEnd.HIT) | (self.ends == BeamEnd.UNSURE)
        if not sure:
            chosen |= self.ends == BeamEnd.SPENT
        angles = self.angles[chosen] + self.mount.yaw
        along = np.column_stack([np.cos(angles), np.sin(angles)])
        return along * self.reach[chosen, None] + (self.mount.x, self.mount.y), along


def read_scan(
    report: RangeScan,
    seen: Sequence[TargetEchoes] | None = None,
    *,
    max_range: float,
    min_range: float = 0.0,
    mount: Pose2 | None = None,
) -> PlanarScan:
    """Read a scan as a server tells it.

    Args:
        report: The ranges.
        seen: The echoes of that scan; None where the server tells none.
        max_range: Reads a beam without return, m; ``inf`` if nobody tells.
        min_range: Shorter ranges tell nothing, m.
        mount: Of the scanner on the robot.
    """
    ranges = np.asarray(report.ranges, np.float64)
    angles: Floats = np.linspace(-report.fov / 2, report.fov / 2, len(ranges))
    returned = ranges < max_range - ROUNDING
    ends = np.where(returned, BeamEnd.UNSURE, BeamEnd.NOTHING).astype(np.int8)
    reach = np.where(returned, ranges, max_range)
    if seen is None:
        beams = np.flatnonzero(returned & (ranges >= min_range))
        hits = _points(beams, reach[beams])
    else:
        echoes = _Echoes.of(seen, len(ranges), max_range)
        echoes.tell_ends(reach, ends)
        hits = echoes.hits(reach)
    blind = ~(ranges >= max(min_range, 1e-9)) | ~np.isfinite(reach)
    reach[blind], ends[blind] = 0.0, BeamEnd.BLIND
    kept = ~blind[hits.beams]
    columns: Any = (column[kept] for column in hits)
    mount = mount or Pose2(0.0, 0.0)
    return PlanarScan(
        report.time, mount, angles, reach, ends, BeamHits(*columns), seen is not None
    )


class _Echoes(NamedTuple):
    """All echoes of a scan, by beam, then by thing, then by range."""

    beams: NDArray[np.int64]
    things: NDArray[np.int64]
    ranges: Floats
    kinds: NDArray[np.int8]
    passable: NDArray[np.bool_]

    @classmethod
    def of(
        cls, seen: Sequence[TargetEchoes], beams: int, max_range: float
    ) -> "_Echoes":
        """Gather them from all lines; an object may have several.

        What is of no beam, out of reach or of an unknown kind is left out.
        """
        names = sorted({(one.object, one.material) for one in seen})
        number = {name: i for i, name in enumerate(names)}
        columns: Any = (
            _joined([one.beams for one in seen], np.int64),
            _repeated([number[one.object, one.material] for one in seen], seen),
            _joined([one.ranges for one in seen], np.float64),
            _joined([[_KINDS.get(k, -1) for k in one.kinds] for one in seen], np.int8),
            _repeated([one.robot_passes for one in seen], seen).astype(np.bool_),
        )
        known = (columns[0] >= 0) & (columns[0] < beams) & (columns[3] >= 0)
        known &= (columns[2] >= 0) & (columns[2] <= max_range + ROUNDING)
        order = np.lexsort([columns[2], columns[1], columns[0]])
        order = order[known[order]]
        return cls(*(column[order] for column in columns))

    def tell_ends(self, reach: Floats, ends: NDArray[np.int8]) -> None:
        """Put right how far beams are known, and why they ended.

        A beam that has a range and no end was told by a scanner that knows one echo of
        each beam: at what can be passed, it saw no farther.
        """
        ends[ends == BeamEnd.UNSURE] = BeamEnd.SPENT
        last = np.flatnonzero(self.kinds >= _HIT)
        last = last[np.argsort(self.ranges[last], kind="stable")]
        reach[self.beams[last]] = self.ranges[last]
        ends[self.beams[last]] = _ENDS[self.kinds[last]]

    def hits(self, reach: Floats) -> BeamHits:
        """Find what the beams met."""
        near, far = np.zeros((2, len(self.beams)))
        is_mark = np.zeros(len(self.beams), np.bool_)
        _pair(self, reach, near, far, is_mark)
        what = np.where(self.passable, Layer.SMOKE, Layer.FOLIAGE).astype(np.int8)
        what[self.kinds == _HIT] = Layer.SOLID
        far = np.minimum(far, reach[self.beams])
        rows = np.flatnonzero(is_mark & (near <= far))
        return BeamHits(self.beams[rows], near[rows], far[rows], what[rows])


@njit_cached
def _pair(echoes: Any, reach: Any, near: Any, far: Any, is_mark: Any) -> None:
    """Join the places where beams enter things with those where they leave them.

    A beam that leaves what it has not entered began in it; one that does not leave
    what it has entered ended there. What is nested in itself is one.
    """
    depth, begun, n = 0, 0.0, len(echoes.beams)
    for i in range(n):
        t, kind = echoes.ranges[i], echoes.kinds[i]
        last = i + 1 == n or (
            echoes.beams[i + 1] != echoes.beams[i]
            or echoes.things[i + 1] != echoes.things[i]
        )
        if kind == _LEAVE:
            near[i], far[i], is_mark[i] = begun, t, depth <= 1
            begun = t if depth <= 1 else begun
            depth = max(depth - 1, 0)
        elif kind in (_SHEET, _HIT):
            near[i], far[i], is_mark[i] = t, t, True
        elif kind == _SPENT:
            near[i], far[i], is_mark[i] = (begun if depth else t), t, True
            depth = 0
        elif kind != _RAIN:
            begun = begun if depth else t
            depth += 1
        if last:
            if depth > 0:
                near[i], far[i], is_mark[i] = (
                    begun,
                    max(reach[echoes.beams[i]], t),
                    True,
                )
            depth, begun = 0, 0.0


def _points(beams: NDArray[np.int64], ranges: Floats) -> BeamHits:
    return BeamHits(beams, ranges, ranges, np.full(len(beams), Layer.SOLID, np.int8))


def _joined(columns: Sequence[Any], kind: Any) -> Any:
    return np.concatenate([np.zeros(0, kind), *[np.asarray(c, kind) for c in columns]])


def _repeated(values: Sequence[Any], seen: Sequence[TargetEchoes]) -> Any:
    counts = np.array([len(one.beams) for one in seen], np.int64)
    return np.repeat(np.array(values, np.int64), counts)
