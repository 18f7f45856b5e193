"""Scan matching: point maps, and the fit of a scan to a map by Gauss-Newton.

Theory of operation
===================
Each point of the scan is compared with the shape of the map's points around it. If the
map's points form a line, only the distance across the line counts, since the points of
a scan may be anywhere along a wall. If they form a spot, such as a pole, the distance
counts in both directions. A point of the map has more weight the more its surface faces
in the direction of the scan point's surface, so that the back of a wall does not count
as its front. A distance is weighted by its information: less where the map's points are
spread, as in foliage, and less where the beam grazes a surface, since an echo may come
from anywhere across the beam. Outliers have almost no weight (Geman and McClure's
weights).

The reported motion adds one more distance, the distance from the predicted pose. In
open space the scan gives no information. Then only this distance is left, and the
solution is the prediction, so the pose cannot diverge.

Along a corridor, the same must hold for one direction. Echoes of a thick beam scatter
by centimetres, so a wall looks like a spot in a window of 10 cm, and each spot pulls
the robot back a little, to where it was seen before. Lines are therefore also searched
in a wider window, and in an even wider one if almost all information is about one
direction; the rest across that direction is the error of the directions of the lines,
and is dropped.

Each step solves the normal equations of a pose, with the unknowns x, y and yaw.

A map does not store its points, only their moments: number, sum and sum of squares, in
square cells of five sizes from 0.1 to 1.6 m. Around a point, the moments of three by
three cells are summed, weighted by a quadratic B-spline, which is smooth in the
position. They give the mean of the map's points and the line through them. The finest
size with enough points is used: where points are dense, as on a nearby bush, a small
window follows the shape; on a far fence, where each scan has one point in half a metre,
a wide window averages the noise. The cells are in a hash table with open addressing,
since few of them hold points.

A window contains both faces of a thin wall, and both walls at a corner. A point of the
map therefore has the weight (1 + u . v) / 2, where u and v are the normals of its
surface and of the surface of the compared point: 1 if both face the same way, 0 if they
are the two faces of a wall. That is linear in u, so three sets of moments give the sum
for any v: of the points, and of the points times each component of u.

Surface normals give the direction in which the surfaces at a scan's points face. Both
faces of a wall are on a map once a robot has seen it from both sides. They are closer
together than echoes of a thick beam scatter, and only the normals distinguish them. A
normal is perpendicular to the line through a point's neighbours in its scan, and the
scanner is in front of the surface.
"""

from typing import Final, NamedTuple

import numpy as np

from radarsim.engine import Packed, engine
from radarsim.geometry import Floats, Pose2, wrap_angle

_ROWS: Final = 1 << 12  # rows of the table of an empty map; a power of two


class PointMap:
    """Map that stores, for each cell, the moments of the scan points in the cell.

    Attributes:
        table: The hash table, as the engine expects it.
    """

    def __init__(self) -> None:
        self.table = _new_table(_ROWS)
        self._rows = _ROWS
        self._used = 0

    def __len__(self) -> int:
        """Return the number of cells with points."""
        return self._used

    def add(self, points: Floats, normals: Floats | None = None) -> None:
        """Add the points of a scan to the map.

        Args:
            points: (K, 2) m, map frame.
            normals: (K, 2) unit vectors into the surfaces of the points, map frame;
                None if unknown.
        """
        if normals is None:
            normals = np.zeros_like(points)
        while (new := engine.add_points(self.table, self._used, points, normals)) < 0:
            # The table is full. It grows by a factor of
            # four, since each growth copies all cells.
            self._rows *= 4
            shorter, self.table = self.table, _new_table(self._rows)
            engine.copy_table(shorter, self.table)
        self._used += new


def _new_table(rows: int) -> Packed:
    keys, moments = np.zeros(rows, np.int64), np.zeros((rows, 3, 6))
    return engine.structures["PointTable"].pack(keys=keys, moments=moments)


def inward_normals(places: Floats, along: Floats) -> Floats:
    """Return unit vectors, (K, 2), that point into the surface at each point.

    If the neighbours of a point form no line, the direction of its beam is returned.

    Args:
        places: (K, 2) points of a scan in the order of their beams, m.
        along: (K, 2) unit vectors along the beams.
    """
    normals: Floats = along.copy()
    engine.fill_normals(np.ascontiguousarray(places), along, normals)
    return normals


class ScanPoints(NamedTuple):
    """End points of the beams of one scan, in the robot's frame.

    Attributes:
        places: (K, 2) m.
        along: (K, 2) unit vectors along the beams.
        normals: (K, 2) unit vectors into the surfaces of the points; zeros if unknown.
        spread: Standard deviation of an echo's position across its beam, m.
        spots: Whether spots count; False if some beams may have run out of power.
    """

    places: Floats
    along: Floats
    normals: Floats
    spread: float
    spots: bool


class Fit(NamedTuple):
    """Result of a fit: the pose at which a scan fits a map best.

    Attributes:
        pose: Pose of the robot, map frame.
        score: Sum of the scores of all points at the pose.
        inliers: Share of the points that are near points of the map.
        information: (3, 3) information matrix of x, y and yaw from the points alone.
    """

    pose: Pose2
    score: float
    inliers: float
    information: Floats

    @property
    def evenness(self) -> float:
        """Ratio of information on position in the least and most certain direction.

        It is near 0 in a corridor, and 0 without points.
        """
        least, most = np.linalg.eigvalsh(self.information[:2, :2])
        return float(max(least, 0.0) / most) if most > 0.0 else 0.0


def fit(
    table: Packed, points: ScanPoints, start: Pose2, predicted: Pose2, sigma: Floats
) -> Fit:
    """Find the pose near a start pose at which a scan fits the map best.

    Args:
        table: Hash table of the map.
        points: Points of the scan.
        start: Pose at which the search starts.
        predicted: Pose predicted from the robot's motion.
        sigma: (3,) standard deviations of the predicted pose, m, m and rad.
    """
    state = np.array([start.x, start.y, start.yaw])
    prior = np.array([predicted.x, predicted.y, predicted.yaw])
    information, outcome = np.zeros((3, 3)), np.zeros(2)
    known = 1.0 / np.square(sigma)
    engine.fit_scan(table, *points, state, prior, known, information, outcome)
    x, y, yaw = state.tolist()
    score, inliers = outcome.tolist()
    share = inliers / max(len(points.places), 1)
    return Fit(Pose2(x, y, wrap_angle(yaw)), score, share, information)


def best_start(table: Packed, points: ScanPoints, starts: Floats) -> int:
    """Return the row of the best start pose in (S, 3), judged by a sample of points."""
    return int(engine.best_start(table, *points, starts))
