"""Upright boxes that stop every ray: robots, which move while the scene is fixed."""

from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.jit import njit_inline

# Columns of a table of boxes: centre, yaw, half sizes, and half the diagonal of the
# footprint.
X, Y, Z, COS, SIN, LENGTH, WIDTH, HEIGHT, FOOTPRINT_RADIUS, BOX_ID = range(10)
NO_BOXES: Final = np.zeros((0, 10))


@dataclass(frozen=True, slots=True)
class Boxes:
    """Upright boxes that stop every ray.

    Attributes:
        rows: (B, 8): x, y, yaw, lower and upper z, half the length, half the width
            (m, rad), and the id of the box.

    Raises:
        EngineError: If the rows have another shape, or are not finite.
    """

    rows: Floats
    _tables: dict[bytes, Floats] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

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

    def table(self, centre: Floats) -> Floats:
        """Return the table that kernels read; it is computed once.

        Args:
            centre: (3,) m, the origin of its coordinates.
        """
        key = centre.tobytes()
        if key not in self._tables:
            self._tables[key] = self._tabulate(centre)
        return self._tables[key]

    def _tabulate(self, centre: Floats) -> Floats:
        x, y, yaw, low, high, length, width, box_id = self.rows.T
        table = np.zeros((len(x), 10))
        table[:, X], table[:, Y] = x - centre[0], y - centre[1]
        table[:, Z], table[:, HEIGHT] = (low + high) / 2 - centre[2], (high - low) / 2
        table[:, COS], table[:, SIN] = np.cos(yaw), np.sin(yaw)
        table[:, LENGTH], table[:, WIDTH] = length, width
        table[:, FOOTPRINT_RADIUS] = np.hypot(length, width)
        table[:, BOX_ID] = box_id
        return table


@njit_inline
def _intersect_slab(start: Any, slope: Any, half: Any) -> Any:
    """Return where a ray enters and leaves the slab from -half to half on one axis."""
    if slope == 0.0:
        return (-np.inf, np.inf) if abs(start) <= half else (np.inf, -np.inf)
    first, second = (-half - start) / slope, (half - start) / slope
    return min(first, second), max(first, second)


@njit_inline
def intersect_box(boxes: Any, i: Any, origin: Any, direction: Any) -> Any:
    """Return the distance at which a ray meets a box, m; -1 if it does not.

    A ray that starts in a box hits it from within.
    """
    ex, ey = direction[0], direction[1]
    dx, dy = origin[0] - boxes[i, X], origin[1] - boxes[i, Y]
    # Most boxes are too far beside the ray: reject them by their circles first.
    if abs(ex * dy - ey * dx) > boxes[i, FOOTPRINT_RADIUS]:
        return -1.0
    c, s = boxes[i, COS], boxes[i, SIN]
    ahead = _intersect_slab(c * dx + s * dy, c * ex + s * ey, boxes[i, LENGTH])
    beside = _intersect_slab(c * dy - s * dx, c * ey - s * ex, boxes[i, WIDTH])
    above = _intersect_slab(origin[2] - boxes[i, Z], direction[2], boxes[i, HEIGHT])
    near = max(ahead[0], beside[0], above[0])
    far = min(ahead[1], beside[1], above[1])
    t = near if near >= 0.0 else far
    return t if near <= far and t >= 0.0 else -1.0


@njit_inline
def is_box_near(boxes: Any, carrier_id: Any, point: Any, radius: Any) -> Any:
    """Return whether a box other than the carrier's may be within ``radius`` m."""
    for i in range(len(boxes)):
        dx, dy = point[0] - boxes[i, X], point[1] - boxes[i, Y]
        reach = radius + boxes[i, FOOTPRINT_RADIUS]
        if dx * dx + dy * dy <= reach * reach and boxes[i, BOX_ID] != carrier_id:
            return True
    return False


@njit_inline
def box_incidence(boxes: Any, box_id: Any, origin: Any, direction: Any, t: Any) -> Any:
    """Return the cosine between a ray and the normal of the box face that it hit.

    Args:
        boxes: (B, 10), from ``Boxes.table``.
        box_id: Id of the box that was hit.
        origin: (3,) m.
        direction: (3,) unit vector.
        t: Distance of the hit, m.
    """
    cosine = 0.0
    for i in range(len(boxes)):
        if boxes[i, BOX_ID] != box_id:
            continue
        c, s = boxes[i, COS], boxes[i, SIN]
        x = origin[0] + t * direction[0] - boxes[i, X]
        y = origin[1] + t * direction[1] - boxes[i, Y]
        z = origin[2] + t * direction[2] - boxes[i, Z]
        # The hit point is on the face to whose plane it is nearest.
        ahead = abs(abs(c * x + s * y) - boxes[i, LENGTH])
        beside = abs(abs(c * y - s * x) - boxes[i, WIDTH])
        above = abs(abs(z) - boxes[i, HEIGHT])
        if ahead <= beside and ahead <= above:
            cosine = abs(c * direction[0] + s * direction[1])
        elif beside <= above:
            cosine = abs(c * direction[1] - s * direction[0])
        else:
            cosine = abs(direction[2])
    return cosine
