"""Upright boxes that stop every ray: robots, which move while the scene is fixed.

Theory of operation
===================
Seen from above, a grid of square cells covers all boxes. Each cell lists the boxes
whose bounding circles reach into its square. A ray visits the cells on its way one
after the other, and tries the boxes that they list, until it has met one before the end
of a cell. Among a thousand robots in a hall it tries a dozen: row j of the
benchmarks.

Which boxes are tried cannot change what a ray meets, as long as none of those it meets
is missing: circles are wider than rounding errors by far. Where coordinates are so
large that this would not hold, and where there are too few boxes or rays for a grid to
pay off, all boxes are tried.
"""

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import engine
from radarsim.errors import EngineError
from radarsim.geometry import Floats

ROBOT_BOX: Final = engine.rows["RobotBox"]
NO_BOXES: Final = np.zeros(0, ROBOT_BOX)


@dataclass(frozen=True, slots=True)
class Boxes:
    """Upright boxes that stop every ray.

    Attributes:
        rows: (B, 8): x, y, yaw, lower and upper z, half the length, half the width
            (m, rad), and the id of the box.
        velocities: (B, 2) m/s, along x and y; None if nobody asks for them.

    Raises:
        EngineError: If the rows have another shape, or are not finite.
    """

    rows: Floats
    velocities: Floats | None = None
    _tables: dict[bytes, NDArray[np.void]] = field(
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

    def find(
        self, ids: NDArray[np.int64]
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return which of some ids are those of boxes, (K,), and their rows, (K,)."""
        known = self.rows[:, 7].astype(np.int64)
        found = np.flatnonzero(np.isin(ids, known))
        order = np.argsort(known)
        return found, order[np.searchsorted(known, ids[found], sorter=order)]

    def table(self, centre: Floats) -> NDArray[np.void]:
        """Return the rows of ROBOT_BOX for the engine; they are computed once.

        Args:
            centre: (3,) m, the origin of its coordinates.
        """
        key = centre.tobytes()
        if key not in self._tables:
            self._tables[key] = self._tabulate(centre)
        return self._tables[key]

    def _tabulate(self, centre: Floats) -> NDArray[np.void]:
        x, y, yaw, low, high, length, width, box_id = self.rows.T
        table = np.zeros(len(x), ROBOT_BOX)
        table["x"], table["y"] = x - centre[0], y - centre[1]
        table["z"], table["height"] = (low + high) / 2 - centre[2], (high - low) / 2
        table["cos"], table["sin"] = np.cos(yaw), np.sin(yaw)
        table["length"], table["width"] = length, width
        table["footprint_radius"] = np.hypot(length, width)
        table["id"] = box_id
        return table
