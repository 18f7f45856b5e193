"""Upright boxes that stop every ray: robots, which move while the scene is sealed."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.jit import njit_inline

# Columns of the boxes as they are laid out; the last but one is how far a corner is
# from the middle, seen from above.
X, Y, Z, COS, SIN, LENGTH, WIDTH, HEIGHT, AROUND, NUMBER = range(10)
NO_BOXES: Final = np.zeros((0, 10))


@dataclass(frozen=True, slots=True)
class Boxes:
    """Upright boxes that stop every ray: robots.

    Attributes:
        rows: (B, 8): x, y, yaw, lower and upper z, half the length, half the width
            (m, rad), and a number that names the box.

    Raises:
        EngineError: If the rows have another shape, or numbers that are not finite.
    """

    rows: Floats

    def __post_init__(self) -> None:
        rows = np.asarray(self.rows, np.float64)
        if rows.ndim != 2 or rows.shape[1] != 8:
            raise EngineError(f"boxes of shape {rows.shape}, expected (n, 8)")
        if not np.isfinite(rows).all():
            row = int(np.flatnonzero(~np.isfinite(rows).all(axis=1))[0])
            raise EngineError(
                f"boxes[{row}] is {rows[row].tolist()}, expected finite numbers"
            )
        object.__setattr__(self, "rows", rows)

    def is_any_near(self, point: Floats, radius: float, carrier_id: int) -> bool:
        """Say whether a box but one's own may be within ``radius`` m of a point."""
        x, y, _, _, _, length, width, number = self.rows.T
        apart = np.hypot(x - point[0], y - point[1])
        near = (apart <= radius + np.hypot(length, width)) & (number != carrier_id)
        return bool(near.any())

    def laid_out(self, middle: Floats) -> Floats:
        """Give the columns that ``meet_boxes`` reads.

        Args:
            middle: (3,) m, where the coordinates of its rays count from.
        """
        x, y, yaw, low, high, length, width, number = self.rows.T
        around = np.hypot(length, width)
        centre = x - middle[0], y - middle[1], (low + high) / 2 - middle[2]
        half = length, width, (high - low) / 2
        columns = (*centre, np.cos(yaw), np.sin(yaw), *half, around, number)
        return np.column_stack(columns)


@njit_inline
def _slab(at: Any, step: Any, half: Any) -> Any:
    """Give where a ray enters and leaves the slab from -half to half along one axis."""
    if step == 0.0:
        return (-np.inf, np.inf) if abs(at) <= half else (np.inf, -np.inf)
    first, second = (-half - at) / step, (half - at) / step
    return min(first, second), max(first, second)


@njit_inline
def meet_boxes(
    laid: Any, carrier_id: Any, origin: Any, direction: Any, max_range: Any
) -> Any:
    """Find the nearest surface of all boxes but one's own.

    A ray that starts in a box meets it from within.

    Returns:
        How far it is, m, at most ``max_range``; and the box's number, -1 for none.
    """
    nearest, name = max_range, np.int64(-1)
    ex, ey = direction[0], direction[1]
    for i in range(len(laid)):
        dx, dy = origin[0] - laid[i, X], origin[1] - laid[i, Y]
        if abs(ex * dy - ey * dx) > laid[i, AROUND] or laid[i, NUMBER] == carrier_id:
            continue
        c, s = laid[i, COS], laid[i, SIN]
        ahead = _slab(c * dx + s * dy, c * ex + s * ey, laid[i, LENGTH])
        beside = _slab(c * dy - s * dx, c * ey - s * ex, laid[i, WIDTH])
        above = _slab(origin[2] - laid[i, Z], direction[2], laid[i, HEIGHT])
        near = max(ahead[0], beside[0], above[0])
        far = min(ahead[1], beside[1], above[1])
        t = near if near >= 0.0 else far
        if near <= far and 0.0 <= t <= nearest:
            nearest, name = t, np.int64(laid[i, NUMBER])
    return nearest, name


@njit_inline
def box_incidence(laid: Any, name: Any, origin: Any, direction: Any, t: Any) -> Any:
    """Give the cosine between a ray and the normal of the box face that it hit.

    Args:
        laid: Boxes.
        name: The number of the box.
        origin: (3,) m.
        direction: (3,) unit vector.
        t: How far away it was hit, m.
    """
    cosine = 0.0
    for i in range(len(laid)):
        if laid[i, NUMBER] != name:
            continue
        c, s = laid[i, COS], laid[i, SIN]
        x = origin[0] + t * direction[0] - laid[i, X]
        y = origin[1] + t * direction[1] - laid[i, Y]
        z = origin[2] + t * direction[2] - laid[i, Z]
        ahead = abs(abs(c * x + s * y) - laid[i, LENGTH])
        beside = abs(abs(c * y - s * x) - laid[i, WIDTH])
        above = abs(abs(z) - laid[i, HEIGHT])
        if ahead <= beside and ahead <= above:
            cosine = abs(c * direction[0] + s * direction[1])
        elif beside <= above:
            cosine = abs(c * direction[1] - s * direction[0])
        else:
            cosine = abs(direction[2])
    return cosine
