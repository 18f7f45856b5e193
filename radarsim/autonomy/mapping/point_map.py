"""A map of points that computes their mean and covariance around any point.

Theory of operation
===================
Points are not stored, only their moments: number, sum and sum of squares, in square
cells of five sizes from 0.1 to 1.6 m. Around a point the moments of three by three
cells are summed, weighted by a quadratic B-spline, which is smooth in the position, and
give the mean of the map's points and the line along which they lie. The finest size
with enough points is used: where points are dense, as on a bush near by, a small window
follows the shape; on a far fence, where each scan leaves one point in half a metre, a
wide one averages the noise out. The cells are in a hash table with open addressing, as
few of them hold points.

A window takes in both faces of a thin wall, and where two walls meet. A point of the
map therefore counts by (1 + u . v) / 2, where u and v are the normals of its surface
and of that of the point that is compared: whole if both face the same way, not at all
if one is the back of the other. That is linear in u, so that three sets of moments give
the sum for any v: of the points, and of the points times either component of u.

Surface normals tell which way the surfaces face that the points of a scan are on.

Both faces of a wall are on a map once a robot has seen it from both sides. They are
nearer to each other than echoes of a thick beam scatter, and only the direction in
which they face tells them apart. It is that of the line through the neighbours of a
point in its scan, on the side where the scanner is.
"""

from typing import Final

import numpy as np

from radarsim.engine import Packed, engine
from radarsim.geometry import Floats

_ROWS: Final = 1 << 12  # of the table of an empty map; they are a power of two


class PointMap:
    """Moments of the points of all scans.

    Attributes:
        table: The hash table, as the engine takes it.
    """

    def __init__(self) -> None:
        self.table = _new_table(_ROWS)
        self._rows = _ROWS
        self._used = 0

    def __len__(self) -> int:
        """Return the number of cells that hold points."""
        return self._used

    def add(self, points: Floats, normals: Floats | None = None) -> None:
        """Add points.

        Args:
            points: (K, 2) m, map frame.
            normals: (K, 2) unit vectors into the surfaces that they are on, map frame;
                None if these are not known.
        """
        if normals is None:
            normals = np.zeros_like(points)
        while (new := engine.add_points(self.table, self._used, points, normals)) < 0:
            # Too short. It gets much longer, since all cells have to be copied.
            self._rows *= 4
            shorter, self.table = self.table, _new_table(self._rows)
            engine.copy_table(shorter, self.table)
        self._used += new


def _new_table(rows: int) -> Packed:
    keys, moments = np.zeros(rows, np.int64), np.zeros((rows, 3, 6))
    return engine.structures["PointTable"].pack(keys=keys, moments=moments)


def inward_normals(places: Floats, along: Floats) -> Floats:
    """Return unit vectors from points into the surfaces that they are on, (K, 2).

    Where the neighbours of a point form no line, it is the direction of the beam.

    Args:
        places: (K, 2) points of a scan in the order of their beams, m.
        along: (K, 2) unit vectors along the beams.
    """
    normals: Floats = along.copy()
    engine.fill_normals(np.ascontiguousarray(places), along, normals)
    return normals
