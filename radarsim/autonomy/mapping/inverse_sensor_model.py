"""Inverse sensor model: the evidence that one scan gives for the cells of a map.

Theory of operation
===================
Each layer holds evidence in tenths of log-odds, as whole numbers: more when a beam hits
what the layer is of, less when a beam passes through without hitting it. A cell gets
one piece of evidence per scan and layer, however many beams cross it, and a hit
outweighs beams that pass: beams that slide along a wall, beside others that end on it,
do not wear it away, and what is near the robot, where beams are dense, does not become
surer than what is far.

A scan is added in three passes: ``add_hits``, ``add_free_cells``, and
``clear_scan_flags``, which clears the marks of the cells that had evidence of this
scan.
"""

import math
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.autonomy.mapping.scan import BeamEnd, BeamHits, Layer
from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline

Path: TypeAlias = NDArray[np.int64]  # (P, 2) rows and columns of cells

LOG_ODDS_HIT: Final = 9  # tenths; odds of 2.5 to 1
LOG_ODDS_FREE: Final = 2  # 1 to 1.2: side rays often miss what is thin
LOG_ODDS_LIMIT: Final = 60  # so that a map can still change where things moved
SENSED, NEAR = 1, 2  # flags of a cell that stay
# Plain numbers for compiled code.
_SOLID, _BEAM_END, _LAYERS = int(Layer.SOLID), int(Layer.BEAM_END), len(Layer)
_BLIND = int(BeamEnd.BLIND)
# A beam at its maximum range, or at a drop of rain, has ended at nothing that stays.
_OBSTRUCTED = (int(BeamEnd.UNSURE), int(BeamEnd.HIT), int(BeamEnd.SPENT))
_HAS_HIT: Final = 4  # 4, 8, 16, 32: the layer has had its hit of this scan
_IS_CROSSED: Final = 64  # has had its evidence for being free
_LASTING: Final = SENSED | NEAR


class Cells(NamedTuple):
    """What is known of cells.

    Attributes:
        evidence: (4, R, C) int8, tenths of log-odds, by ``Layer``.
        flags: (R, C) uint8.
    """

    evidence: NDArray[np.int8]
    flags: NDArray[np.uint8]


class Beams(NamedTuple):
    """Beams of a scan over the cells.

    Attributes:
        start: (2,) where the beams begin, x and y in cells from the map's origin.
        corner: (2,) number of the first column and row of the arrays. Which cells a
            beam crosses does not depend on it, to the last bit.
        directions: (N, 2) unit vectors.
        known_range: (N,) how far each beam is known, cells.
        ends: (N,) what ended each beam, as in ``PlanarScan``.
        short_range: How far a cell may be to be ``NEAR``, cells.
        sees_through: Whether the hits include foliage and smoke.
    """

    start: Floats
    corner: NDArray[np.int64]
    directions: Floats
    known_range: Floats
    ends: NDArray[np.int8]
    short_range: float
    sees_through: bool


@njit_inline
def _trace(beams: Beams, k: int, near: float, far: float, path: Path) -> int:
    """List the cells along a beam, in order, those at both ends included.

    Args:
        beams: Beams of the scan.
        k: Number of the beam.
        near: Where to begin, cells along the beam.
        far: Where to stop.
        path: (P, 2) row and column in the arrays, to be filled.

    Returns:
        The number of cells.
    """
    start, direction = beams.start, beams.directions[k]
    x, y = start[0] + near * direction[0], start[1] + near * direction[1]
    column, row = math.floor(x), math.floor(y)
    last_column = math.floor(start[0] + far * direction[0])
    last_row = math.floor(start[1] + far * direction[1])
    right, up = (1 if direction[0] > 0.0 else -1), (1 if direction[1] > 0.0 else -1)
    step_x, step_y = abs(1.0 / direction[0]), abs(1.0 / direction[1])  # inf on an axis
    next_x = (
        (column + (right > 0) - x) / direction[0] if direction[0] != 0.0 else np.inf
    )
    next_y = (row + (up > 0) - y) / direction[1] if direction[1] != 0.0 else np.inf
    # Between them a beam makes as many steps as there are rows and columns. Counting
    # those, and not the distance, loses no cell to rounding.
    steps = abs(last_column - column) + abs(last_row - row)
    count: int = min(steps + 1, len(path))
    for i in range(count):
        path[i, 0], path[i, 1] = row - beams.corner[1], column - beams.corner[0]
        # To the nearer border, but never past the last row or column: the distances
        # to borders are sums, whose rounding would carry the beam beyond its end.
        if column != last_column and (next_x < next_y or row == last_row):
            column += right
            next_x += step_x
        else:
            row += up
            next_y += step_y
    return count


@njit_inline
def _add_hit(cells: Cells, layer: int, row: int, column: int) -> None:
    # once per scan: dense beams near the robot are no better evidence
    flag = _HAS_HIT << layer
    if not cells.flags[row, column] & flag:
        cells.flags[row, column] |= flag
        sum_ = cells.evidence[layer, row, column] + LOG_ODDS_HIT
        cells.evidence[layer, row, column] = min(sum_, LOG_ODDS_LIMIT)


@njit_cached
def add_hits(cells: Cells, beams: Beams, hits: BeamHits, path: Path) -> None:
    """Add the evidence of what beams hit.

    Args:
        cells: Cells to change.
        beams: Beams of the scan.
        hits: ``BeamHits`` of the scan, with ranges in cells.
        path: (P, 2) scratch memory.
    """
    for k in range(len(hits.beams)):
        count = _trace(beams, hits.beams[k], hits.near[k], hits.far[k], path)
        for i in range(count):
            _add_hit(cells, hits.layer[k], path[i, 0], path[i, 1])
    for k in range(len(beams.known_range)):
        if beams.ends[k] in _OBSTRUCTED:
            _trace(beams, k, beams.known_range[k], beams.known_range[k], path)
            _add_hit(cells, _BEAM_END, path[0, 0], path[0, 1])
            # known, though ``add_free_cells`` leaves the last cell of a beam out
            cells.flags[path[0, 0], path[0, 1]] |= SENSED


@njit_inline
def _add_free(cells: Cells, row: int, column: int, sees_through: bool) -> None:
    # Only layers that had no hit in it: beams slide along a wall on which others end.
    flags = cells.flags[row, column]
    if flags & _IS_CROSSED:
        return
    cells.flags[row, column] = flags | _IS_CROSSED | SENSED
    for layer in range(_LAYERS):
        # A laser's ranges tell nothing of foliage and smoke, not that there is none.
        is_measured = sees_through or layer in (_SOLID, _BEAM_END)
        if is_measured and not flags & (_HAS_HIT << layer):
            sum_ = cells.evidence[layer, row, column] - LOG_ODDS_FREE
            cells.evidence[layer, row, column] = max(sum_, -LOG_ODDS_LIMIT)


@njit_cached
def add_free_cells(cells: Cells, beams: Beams, path: Path) -> None:
    """Add the evidence of where beams passed, in all cells before their ends."""
    for k in range(len(beams.known_range)):
        # Its known range is 0, which would still mark the cell of the scanner as free.
        if beams.ends[k] == _BLIND:
            continue
        count = _trace(beams, k, 0.0, beams.known_range[k], path)
        if beams.ends[k] in _OBSTRUCTED:
            count -= 1  # the cell of the end itself is not free
        for i in range(count):
            row, column = path[i, 0], path[i, 1]
            _add_free(cells, row, column, beams.sees_through)
            # From scanner to middle of cell, both in cells from the map's origin.
            dx = beams.corner[0] + column + 0.5 - beams.start[0]
            dy = beams.corner[1] + row + 0.5 - beams.start[1]
            if dx * dx + dy * dy < beams.short_range * beams.short_range:
                cells.flags[row, column] |= NEAR


@njit_cached
def clear_scan_flags(cells: Cells, beams: Beams, path: Path) -> None:
    """Prepare the cells for the next scan."""
    # Along the beams once more, as no other cells are marked: clearing the whole array
    # would take longer the larger the map is.
    for k in range(len(beams.known_range)):
        if beams.ends[k] != _BLIND:
            count = _trace(beams, k, 0.0, beams.known_range[k], path)
            for i in range(count):
                cells.flags[path[i, 0], path[i, 1]] &= _LASTING
