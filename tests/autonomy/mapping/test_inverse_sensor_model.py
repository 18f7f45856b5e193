"""The cells that beams cross, against beams sampled in tiny steps."""

import math
from collections.abc import Sequence

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from radarsim.autonomy.mapping.occupancy_grid import (
    LOG_ODDS_FREE,
    LOG_ODDS_LIMIT,
    NEAR,
    SENSED,
)
from radarsim.autonomy.mapping.scan import BeamEnd, Layer
from radarsim.engine import engine

SIDE = 40
LOG_ODDS_HIT = 9
angles = st.floats(-math.pi, math.pi)
reaches = st.floats(0, 15)
starts = st.tuples(st.floats(17, 23), st.floats(17, 23))

Mark = tuple[int, float, float, int]


class SmallGrid:
    """A few cells, and scans of them from one place."""

    def __init__(self) -> None:
        self.evidence = np.zeros((len(Layer), SIDE, SIDE), np.int8)
        self.flags = np.zeros((SIDE, SIDE), np.uint8)

    def scan(
        self,
        start: tuple[float, float],
        rays: Sequence[tuple[float, float, int]],
        *hits: Mark,
        short: float = 5.0,
        sees_through: bool = True,
    ) -> None:
        """Add beams of angle, range and end, and hits of beam, near, far and layer."""
        angle, reach, ends = (np.array(column) for column in zip(*rays, strict=True))
        directions = np.column_stack([np.cos(angle), np.sin(angle)])
        columns = zip(*hits, strict=True) if hits else [()] * 4
        types = (np.int64, np.float64, np.float64, np.int8)
        met = [np.array(c, kind) for c, kind in zip(columns, types, strict=True)]
        engine.add_scan(
            self.evidence,
            self.flags,
            *(0, 0),
            *start,
            directions,
            reach.astype(np.float64),
            ends.astype(np.int8),
            *met,
            short,
            sees_through,
        )

    def sensed(self) -> NDArray[np.bool_]:
        return np.asarray(self.flags & SENSED > 0)


BARELY = 1e-9  # cells; so near to the edge of one, rounding decides


def cells_by_sampling(
    start: tuple[float, float], angle: float, reach: float
) -> tuple[set[tuple[int, int]], set[tuple[int, int]]]:
    """Return the cells that a beam crosses, without and with those of rounding."""
    t = np.append(np.arange(0, reach, 4e-3), reach)
    x, y = start[0] + t * math.cos(angle), start[1] + t * math.sin(angle)
    around = [
        np.floor([y + down, x + across]).astype(int)
        for down in (-BARELY, BARELY)
        for across in (-BARELY, BARELY)
    ]
    is_sure = np.all([(cells == around[0]).all(axis=0) for cells in around], axis=0)
    sure = set(map(tuple, around[0].T[is_sure].tolist()))
    maybe = {tuple(cell) for cells in around for cell in cells.T.tolist()}
    return sure, maybe


@example(start=(17.0, 17.0), angle=-3.1415926535897927, reach=4.0)
@settings(max_examples=25)
@given(start=starts, angle=angles, reach=reaches)
def test_traced_cells_are_those_the_beam_is_in(
    start: tuple[float, float], angle: float, reach: float
) -> None:
    sheet = SmallGrid()
    sheet.scan(start, [(angle, reach, BeamEnd.NOTHING)])
    crossed = {(int(i), int(j)) for i, j in np.argwhere(sheet.sensed())}
    sure, maybe = cells_by_sampling(start, angle, reach)
    assert sure <= crossed
    assert len(crossed - maybe) <= 2  # corners that tiny steps jump over


@settings(max_examples=25)
@given(start=starts, angle=angles, reach=reaches)
def test_hit_raises_evidence_in_its_cell_and_lowers_it_in_cells_before(
    start: tuple[float, float], angle: float, reach: float
) -> None:
    sheet = SmallGrid()
    sheet.scan(start, [(angle, reach, BeamEnd.HIT)], (0, reach, reach, Layer.SOLID))
    for layer in (Layer.SOLID, Layer.BEAM_END):
        evidence = sheet.evidence[layer]
        assert (evidence > 0).sum() == 1
        assert evidence.max() == LOG_ODDS_HIT
        assert (evidence < 0).sum() == sheet.sensed().sum() - 1


@settings(max_examples=25)
@given(start=starts, angle=angles, near=st.floats(0, 10), depth=st.floats(0, 5))
def test_foliage_is_mapped_along_the_crossed_stretch(
    start: tuple[float, float], angle: float, near: float, depth: float
) -> None:
    sheet = SmallGrid()
    far = near + depth
    sheet.scan(start, [(angle, far, BeamEnd.SPENT)], (0, near, far, Layer.FOLIAGE))
    bush = sheet.evidence[Layer.FOLIAGE] > 0
    _, beam = cells_by_sampling(start, angle, far)
    assert {(int(i), int(j)) for i, j in np.argwhere(bush)} <= {
        (i + di, j + dj) for i, j in beam for di in (-1, 0, 1) for dj in (-1, 0, 1)
    }
    assert bush.sum() >= depth * max(abs(math.cos(angle)), abs(math.sin(angle))) - 1
    assert not (sheet.evidence[Layer.SOLID] > 0).any()
    assert not (sheet.evidence[Layer.SMOKE] > 0).any()


def test_cell_gets_evidence_once_per_scan() -> None:
    sheet = SmallGrid()
    beams = [(0.001 * k, 10.0, BeamEnd.HIT) for k in range(20)]
    sheet.scan((20.5, 20.5), beams, *[(k, 10.0, 10.0, Layer.SOLID) for k in range(20)])
    assert sheet.evidence[Layer.SOLID, 20, 30] == LOG_ODDS_HIT
    assert sheet.evidence[Layer.SOLID, 20, 25] == -LOG_ODDS_FREE
    assert not (sheet.flags & ~np.uint8(SENSED | NEAR)).any()


def test_hits_outweigh_beams_that_pass_in_the_same_scan() -> None:
    sheet = SmallGrid()
    beams = [
        (0.0, 10.0, BeamEnd.HIT),
        (0.01, 15.0, BeamEnd.NOTHING),
        (-0.01, 15.0, BeamEnd.NOTHING),
    ]
    for _ in range(3):
        sheet.scan((20.5, 20.5), beams, (0, 10.0, 10.0, Layer.SOLID))
    assert sheet.evidence[Layer.SOLID, 20, 30] == 3 * LOG_ODDS_HIT


def test_evidence_is_limited() -> None:
    sheet = SmallGrid()
    for _ in range(30):
        sheet.scan(
            (20.5, 20.5), [(0.0, 10.0, BeamEnd.HIT)], (0, 10.0, 10.0, Layer.SOLID)
        )
    assert sheet.evidence[Layer.SOLID].max() == LOG_ODDS_LIMIT
    for _ in range(60):
        sheet.scan((20.5, 20.5), [(0.0, 15.0, BeamEnd.NOTHING)])
    assert sheet.evidence[Layer.SOLID].max() == 0
    assert sheet.evidence[Layer.SOLID].min() == -LOG_ODDS_LIMIT


def test_scans_without_echoes_leave_foliage_evidence_unchanged() -> None:
    sheet = SmallGrid()
    sheet.scan((20.5, 20.5), [(0.0, 9.0, BeamEnd.NOTHING)], sees_through=False)
    assert not sheet.evidence[[Layer.FOLIAGE, Layer.SMOKE]].any()
    assert sheet.evidence[[Layer.SOLID, Layer.BEAM_END]].any()


def test_blind_beam_changes_nothing() -> None:
    sheet = SmallGrid()
    sheet.scan((20.5, 20.5), [(0.0, 0.0, BeamEnd.BLIND)])
    assert not sheet.sensed().any()
