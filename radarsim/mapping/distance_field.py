"""How far cells are from the nearest one of a kind."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached


def distance_field(cells: NDArray[np.bool_], reach: float) -> Floats:
    """Give the distance from the middle of each cell to that of the nearest true one.

    Args:
        cells: (R, C).
        reach: Farther than this is not looked, in cells.

    Returns:
        (R, C) in cells; inf where none is within reach.
    """
    squares = np.full(cells.shape, np.inf)
    _fill(cells, math.floor(reach), squares)
    distances: Floats = np.sqrt(squares)
    distances[distances > reach] = np.inf
    return distances


@njit_cached
def _fill(cells: Any, reach: Any, squares: Any) -> None:
    """Find the nearest one in each row, then the best of the rows near by."""
    rows, columns = cells.shape
    across = np.full((rows, columns), np.inf)
    for i in range(rows):
        since = np.inf
        for j in range(columns):
            since = 0.0 if cells[i, j] else since + 1.0
            across[i, j] = since
        since = np.inf
        for j in range(columns - 1, -1, -1):
            since = 0.0 if cells[i, j] else since + 1.0
            across[i, j] = min(across[i, j], since)
    for i in range(rows):
        for k in range(max(i - reach, 0), min(i + reach + 1, rows)):
            down = float((i - k) * (i - k))
            for j in range(columns):
                squares[i, j] = min(squares[i, j], across[k, j] ** 2 + down)
