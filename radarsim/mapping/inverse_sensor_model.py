"""What one scan says of the cells that its beams cross, in machine code.

Theory of operation
===================
Each layer is evidence in tenths of a log-odds, whole numbers: more for it when a beam
meets what the layer is of, less when a beam goes through without meeting it. A cell
gets one piece of evidence from a scan, however many of its beams cross the cell, and
what speaks for something wins: beams that slide along a wall, beside others that end
on it, do not wear it away, and what is near the robot, where beams are dense, is not
surer than what is far.

Three passes: what was met; what was gone through; and forgetting which cell has had
its evidence of this scan.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
from radarsim.mapping.scan import BeamEnd, Layer

LOG_ODDS_HIT: Final = 9  # tenths; odds of 2.5 to 1
LOG_ODDS_FREE: Final = 2  # 1 to 1.2: side rays often miss what is thin
LOG_ODDS_LIMIT: Final = 60
SENSED, NEAR = 1, 2  # marks of a cell that stay
LAYERS: Final = len(Layer)
ENDED: Final = int(Layer.BEAM_END)
BLIND: Final = int(BeamEnd.BLIND)
UNSURE, HIT, SPENT = int(BeamEnd.UNSURE), int(BeamEnd.HIT), int(BeamEnd.SPENT)
_HAD: Final = 4  # of a layer: 4, 8, 16, 32, had evidence for it in this scan
_CROSSED: Final = 64  # had evidence against
_STAYS: Final = SENSED | NEAR


class Cells(NamedTuple):
    """What is known of cells.

    Attributes:
        evidence: (LAYERS, R, C) int8, tenths of log-odds.
        marks: (R, C) uint8.
    """

    evidence: NDArray[np.int8]
    flags: NDArray[np.uint8]


class Beams(NamedTuple):
    """Beams of a scan over the cells.

    Attributes:
        start: (2,) where they begin, x and y in cells from the map's origin.
        corner: (2,) number of the lattice's first column and row. Where cells are does
            not depend on it, to the last bit.
        ways: (N, 2) unit vectors.
        reach: (N,) how far they are known, cells.
        ends: (N,) as in ``PlanarScan``.
        short: How far near is, cells.
        sees_through: Whether what was met tells of foliage and smoke.
    """

    start: Floats
    corner: NDArray[np.int64]
    ways: Floats
    reach: Floats
    ends: NDArray[np.int8]
    short: float
    sees_through: bool


@njit_inline
def _trace(beams: Any, k: Any, near: Any, far: Any, path: Any) -> Any:
    """List the cells along a beam, in order, those at both ends included.

    Args:
        beams: Of the scan.
        k: Which one.
        near: Where to begin, cells along the beam.
        far: Where to stop.
        path: (P, 2) row and column in the lattice, to be filled.

    Returns:
        How many there are.
    """
    start, way = beams.start, beams.ways[k]
    x, y = start[0] + near * way[0], start[1] + near * way[1]
    column, row = np.int64(math.floor(x)), np.int64(math.floor(y))
    last_column = np.int64(math.floor(start[0] + far * way[0]))
    last_row = np.int64(math.floor(start[1] + far * way[1]))
    right, up = (1 if way[0] > 0.0 else -1), (1 if way[1] > 0.0 else -1)
    wide, high = abs(1.0 / way[0]), abs(1.0 / way[1])  # inf along an axis
    next_x = (column + (right > 0) - x) / way[0] if way[0] != 0.0 else np.inf
    next_y = (row + (up > 0) - y) / way[1] if way[1] != 0.0 else np.inf
    steps: Any = abs(last_column - column) + abs(last_row - row)
    count = min(steps + 1, len(path))
    for i in range(count):
        path[i, 0], path[i, 1] = row - beams.corner[1], column - beams.corner[0]
        if column != last_column and (next_x < next_y or row == last_row):
            column += right
            next_x += wide
        else:
            row += up
            next_y += high
    return count


@njit_inline
def _speak_for(cells: Any, layer: Any, row: Any, column: Any) -> None:
    """Give a cell evidence for a layer, once a scan."""
    bit = _HAD << layer
    if not cells.flags[row, column] & bit:
        cells.flags[row, column] |= bit
        sure = min(cells.evidence[layer, row, column] + LOG_ODDS_HIT, LOG_ODDS_LIMIT)
        cells.evidence[layer, row, column] = sure


@njit_cached
def meet(cells: Any, beams: Any, met: Any, path: Any) -> None:
    """Take in what beams met.

    Args:
        cells: To be changed.
        beams: Of the scan.
        met: Its ``BeamHits``, in cells.
        path: (P, 2) scratch.
    """
    for k in range(len(met.beams)):
        count = _trace(beams, met.beams[k], met.near[k], met.far[k], path)
        for i in range(count):
            _speak_for(cells, met.what[k], path[i, 0], path[i, 1])
    for k in range(len(beams.reach)):
        if beams.ends[k] in (UNSURE, HIT, SPENT):
            _trace(beams, k, beams.reach[k], beams.reach[k], path)
            _speak_for(cells, ENDED, path[0, 0], path[0, 1])
            cells.flags[path[0, 0], path[0, 1]] |= SENSED


@njit_inline
def _speak_against(cells: Any, row: Any, column: Any, sees_through: Any) -> None:
    """Give a cell that a beam went through evidence against what it did not meet."""
    flags = cells.flags[row, column]
    if flags & _CROSSED:
        return
    cells.flags[row, column] = flags | _CROSSED | SENSED
    for layer in range(LAYERS):
        told = sees_through or layer in (0, ENDED)
        if told and not flags & (_HAD << layer):
            sure = max(
                cells.evidence[layer, row, column] - LOG_ODDS_FREE, -LOG_ODDS_LIMIT
            )
            cells.evidence[layer, row, column] = sure


@njit_cached
def cross(cells: Any, beams: Any, path: Any) -> None:
    """Take in where beams went through; of those that ended, all but the last cell."""
    for k in range(len(beams.reach)):
        if beams.ends[k] == BLIND:
            continue
        reach = beams.reach[k]
        count = _trace(beams, k, 0.0, reach, path)
        if beams.ends[k] in (UNSURE, HIT, SPENT):
            count -= 1
        for i in range(count):
            row, column = path[i, 0], path[i, 1]
            _speak_against(cells, row, column, beams.sees_through)
            dx = beams.corner[0] + column + 0.5 - beams.start[0]
            dy = beams.corner[1] + row + 0.5 - beams.start[1]
            if dx * dx + dy * dy < beams.short * beams.short:
                cells.flags[row, column] |= NEAR


@njit_cached
def forget(cells: Any, beams: Any, path: Any) -> None:
    """Make the cells ready for the next scan."""
    for k in range(len(beams.reach)):
        if beams.ends[k] != BLIND:
            count = _trace(beams, k, 0.0, beams.reach[k], path)
            for i in range(count):
                cells.flags[path[i, 0], path[i, 1]] &= _STAYS
