"""Scans for maps: each beam has a known length, a kind of end, and hits.

Theory of operation
===================
A range alone is the distance that a beam reached. The beam of a radar that sees through
foliage ends at an opaque obstacle or where its power runs out; echoes distinguish the
two, and show where foliage and smoke begin and end. If a server sends no echoes, each
range counts as an opaque obstacle, and foliage is unknown.

A hit is a point on an opaque obstacle, or a section of the beam inside foliage or
smoke. A range below the minimum range is invalid: a laser in smoke reads zero.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Final, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radarsim.client import ScannerInfo
from radarsim.client.robot_info import no_return
from radarsim.engine import engine
from radarsim.geometry import Floats, Pose2
from radarsim.protocol.reports import RangeScan, TargetEchoes

Number = TypeVar("Number", bound=np.generic)


class BeamEnd(IntEnum):
    """The reason why a beam ends where it does."""

    NOTHING = 0  # the beam reached the maximum range
    UNSURE = 1  # a range without echoes
    HIT = 2  # an opaque obstacle
    SPENT = 3  # the power of the beam ran out
    AIR = 4  # a drop of rain
    BLIND = 5  # the beam measured nothing


class Layer(IntEnum):
    """Kinds of hits; a map has a layer of evidence for each kind."""

    SOLID = 0
    FOLIAGE = 1  # and other materials that beams enter but robots cannot
    SMOKE = 2  # and other materials that both beams and robots enter
    BEAM_END = 3  # beam ends of any cause; only in maps


_ECHO_KINDS: Final = {
    kind: number
    for number, kind in enumerate(("enter", "leave", "sheet", "hit", "spent", "rain"))
}
_END_OF_ECHO: Final = np.array(
    [*[BeamEnd.BLIND] * 3, BeamEnd.HIT, BeamEnd.SPENT, BeamEnd.AIR], np.int8
)
_HIT: Final = _ECHO_KINDS["hit"]
MAX_RANGE: Final = 200.0  # m; limit of beams, even if a server states more
ROUNDING: Final = 0.006  # m; tolerance for rounded echo ranges at the maximum


class BeamHits(NamedTuple):
    """The objects that the beams of a scan hit, one row per hit.

    Attributes:
        beams: (K,) int64, number of the beam.
        near: (K,) m, range at which the hit begins.
        far: (K,) m, range at which the hit ends; equal to ``near`` for a point.
        layer: (K,) int8, ``Layer`` that was hit.
    """

    beams: NDArray[np.int64]
    near: Floats
    far: Floats
    layer: NDArray[np.int8]

    def chosen(self, rows: NDArray[np.bool_]) -> "BeamHits":
        """Return the hits of the given rows."""
        return BeamHits(
            self.beams[rows], self.near[rows], self.far[rows], self.layer[rows]
        )


@dataclass(frozen=True, slots=True, eq=False)
class PlanarScan:
    """One scan in the plane of the map: lengths, ends and hits of its beams.

    Attributes:
        time: s.
        mount: Pose of the scanner on the robot.
        angles: (N,) rad from the scanner's forward axis, counter-clockwise.
        known_range: (N,) m, known length of each beam: up to its end, or the maximum
            range without an end; 0 for a beam that measured nothing.
        ends: (N,) int8, ``BeamEnd`` of each beam.
        hits: The hits of the beams.
        sees_through: Whether the hits include foliage and smoke.
    """

    time: float
    mount: Pose2
    angles: Floats
    known_range: Floats
    ends: NDArray[np.int8]
    hits: BeamHits
    sees_through: bool

    def points(self, *, sure: bool = True) -> tuple[Floats, Floats]:
        """Return the end points of beams, (K, 2) m, in the robot's frame.

        Args:
            sure: Omit points where the power ran out, if these are known.

        Returns:
            (K, 2) m, and (K, 2) unit vectors along the beams.
        """
        chosen = (self.ends == BeamEnd.HIT) | (self.ends == BeamEnd.UNSURE)
        if not sure:
            chosen |= self.ends == BeamEnd.SPENT
        angles = self.angles[chosen] + self.mount.yaw
        along = np.column_stack([np.cos(angles), np.sin(angles)])
        points = along * self.known_range[chosen, None] + (self.mount.x, self.mount.y)
        return points, along

    def within(self, distance: float) -> "PlanarScan":
        """Return the scan with all beams cut off at a distance, m."""
        is_cut = self.known_range > distance
        if not is_cut.any():
            return self
        ends, hits = self.ends.copy(), self.hits.chosen(self.hits.near <= distance)
        # The end of a beam that is cut is unknown, but the space up to the cut is free.
        ends[is_cut] = BeamEnd.NOTHING
        return replace(
            self,
            known_range=np.minimum(self.known_range, distance),
            ends=ends,
            hits=hits._replace(far=np.minimum(hits.far, distance)),
        )


def read_scan(
    report: RangeScan,
    echoes: Sequence[TargetEchoes] | None = None,
    *,
    max_range: float,
    min_range: float = 0.0,
    mount: Pose2 | None = None,
) -> PlanarScan:
    """Convert the reports of a scan to a ``PlanarScan``.

    Args:
        report: The ranges.
        echoes: Echoes of the same scan; None if the server sends none.
        max_range: Reading of a beam without a return, m; ``inf`` if unknown.
        min_range: Minimum range, m; shorter ranges are ignored.
        mount: Pose of the scanner on the robot.
    """
    ranges = np.asarray(report.ranges, np.float64)
    angles: Floats = np.linspace(-report.fov / 2, report.fov / 2, len(ranges))
    # Ranges are rounded in messages, so a beam without a
    # return may read slightly less than the maximum range.
    returned = ranges < no_return(max_range)
    ends = np.where(returned, BeamEnd.UNSURE, BeamEnd.NOTHING).astype(np.int8)
    known_range = np.where(returned, ranges, max_range)
    if echoes is None:
        beams = np.flatnonzero(returned & (ranges >= min_range))
        points, layers = known_range[beams], np.full(len(beams), Layer.SOLID, np.int8)
        hits = BeamHits(beams, points, points, layers)
    else:
        hits = _read_echoes(echoes, known_range, ends, max_range)
    # A range of 0 is invalid even if the minimum range is 0, since a laser in smoke
    # reads 0. The comparison is negated so that nan counts as invalid, too.
    blind = ~(ranges >= max(min_range, 1e-9)) | ~np.isfinite(known_range)
    known_range[blind], ends[blind] = 0.0, BeamEnd.BLIND
    return PlanarScan(
        report.time,
        mount or Pose2(0.0, 0.0),
        angles,
        known_range,
        ends,
        hits.chosen(~blind[hits.beams]),
        echoes is not None,
    )


def scan_of(
    scanner: ScannerInfo, report: RangeScan, echoes: Sequence[TargetEchoes] | None
) -> PlanarScan:
    """Convert a scanner's reports to a ``PlanarScan`` in the frame of its robot."""
    mount = scanner.mount
    return read_scan(
        report,
        echoes,
        max_range=min(scanner.max_range, MAX_RANGE),
        min_range=scanner.min_range,
        mount=Pose2(mount.x, mount.y, mount.yaw),
    )


def _sorted_echoes(
    echoes: Sequence[TargetEchoes], beams: int, max_range: float
) -> tuple[
    NDArray[np.int64], NDArray[np.int64], Floats, NDArray[np.int8], NDArray[np.bool_]
]:
    """Join the echoes of all ``TargetEchoes``; several of them may be of one object.

    Echoes with an invalid beam, beyond the maximum range or of an unknown kind are
    dropped.

    Returns:
        Beam, target number, range, kind, and whether robots pass, of each echo, sorted
        by beam, then by target, then by range.
    """
    # Names are sorted, since the iteration order of
    # a set of strings differs between processes.
    names = sorted({(each.object, each.material) for each in echoes})
    number = {name: i for i, name in enumerate(names)}
    counts = [len(each.beams) for each in echoes]
    beam = _joined([each.beams for each in echoes], np.int64)
    targets = [number[each.object, each.material] for each in echoes]
    target = np.repeat(np.array(targets, np.int64), counts)
    ranges = _joined([each.ranges for each in echoes], np.float64)
    kinds = [[_ECHO_KINDS.get(kind, -1) for kind in each.kinds] for each in echoes]
    kind = _joined(kinds, np.int8)
    passes = np.repeat(np.array([each.robot_passes for each in echoes], bool), counts)
    known = (beam >= 0) & (beam < beams) & (kind >= 0)
    known &= (ranges >= 0) & (ranges <= max_range + ROUNDING)
    # ``lexsort`` sorts by its last key first.
    order = np.lexsort([ranges, target, beam])
    order = order[known[order]]
    return beam[order], target[order], ranges[order], kind[order], passes[order]


def _read_echoes(
    echoes: Sequence[TargetEchoes],
    known_range: Floats,
    ends: NDArray[np.int8],
    max_range: float,
) -> BeamHits:
    """Return the hits of beams, and update the known lengths and the ends of beams.

    A beam with a range but no end comes from a scanner that sends one echo per beam:
    the echo is from a passable material, beyond which the beam measured nothing.
    """
    beams, targets, ranges, kinds, passes = _sorted_echoes(echoes, len(ends), max_range)
    ends[ends == BeamEnd.UNSURE] = BeamEnd.SPENT
    # If a beam has several ends, the farthest
    # is written last and overwrites the others.
    last = np.flatnonzero(kinds >= _HIT)
    last = last[np.argsort(ranges[last], kind="stable")]
    known_range[beams[last]] = ranges[last]
    ends[beams[last]] = _END_OF_ECHO[kinds[last]]
    near, far = np.zeros((2, len(beams)))
    is_hit = np.zeros(len(beams), np.bool_)
    engine.pair_echoes(beams, targets, ranges, kinds, known_range, near, far, is_hit)
    layer = np.where(passes, Layer.SMOKE, Layer.FOLIAGE).astype(np.int8)
    layer[kinds == _HIT] = Layer.SOLID
    far = np.minimum(far, known_range[beams])
    return BeamHits(beams, near, far, layer).chosen(is_hit & (near <= far))


def _joined(columns: Sequence[ArrayLike], dtype: type[Number]) -> NDArray[Number]:
    # ``concatenate`` fails for an empty list, so an empty array is added.
    arrays = [np.asarray(column, dtype) for column in columns]
    return np.concatenate([np.zeros(0, dtype), *arrays])
