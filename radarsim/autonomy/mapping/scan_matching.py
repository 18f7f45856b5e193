"""Scan matching: maps of points, and the fit of a scan to one by Gauss-Newton.

Theory of operation
===================
Each point of the scan is compared with the shape of the map's points around it. Where
these lie along a line, only the distance across it counts, as points slide along walls;
where they form a spot, as of a pole, both directions count. The map's points count by
how much their surfaces face as that of the scan's point does, so that the back of a
wall is not taken for its front. A distance is weighted by its information: less where
the map's points are spread, as in foliage, and less where the beam grazes, since an
echo may come from anywhere across the beam. Outliers count almost nothing (Geman and
McClure's weights).

The motion that the robot reports is one more distance, from the predicted pose. Where
the scan says nothing, in the open, that alone is left and the solution is the
prediction, so the pose cannot run away.

Along a corridor, that must hold for one direction. Echoes of a thick beam scatter by
centimetres, so that a wall is a spot in a window of a hand's breadth, and each spot
holds the robot back a little, to where it was seen before. Lines are therefore looked
for in a wider window too, and where almost all information is about one direction, in
one wider still; the rest across that direction is the error of the lines' own
directions, and is dropped.

Each step solves the normal equations of a pose, with the unknowns x, y and yaw.

The points of a map are not stored, only their moments: number, sum and sum of squares,
in square cells of five sizes from 0.1 to 1.6 m. Around a point the moments of three by
three cells are summed, weighted by a quadratic B-spline, which is smooth in the
position, and give the mean of the map's points and the line along which they lie. The
finest size with enough points is used: where points are dense, as on a bush near by, a
small window follows the shape; on a far fence, where each scan leaves one point in half
a metre, a wide one averages the noise out. The cells are in a hash table with open
addressing, as few of them hold points.

A window takes in both faces of a thin wall, and where two walls meet. A point of the
map therefore counts by (1 + u . v) / 2, where u and v are the normals of its surface
and of that of the point that is compared: whole if both face the same way, not at all
if one is the back of the other. That is linear in u, so that three sets of moments give
the sum for any v: of the points, and of the points times either component of u.

Surface normals tell which way the surfaces face that the points of a scan are on.

Both faces of a wall are on a map once a robot has seen it from both sides. They are
nearer to each other than echoes of a thick beam scatter, and only the direction in
which they face distinguishes them. It is that of the line through the neighbours of a
point in its scan, on the side where the scanner is.
"""

from typing import Final, NamedTuple

import numpy as np

from radarsim.engine import Packed, engine
from radarsim.geometry import Floats, Pose2, wrap_angle

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


class ScanPoints(NamedTuple):
    """Points where the beams of a scan ended, in the robot's frame.

    Attributes:
        places: (K, 2) m.
        along: (K, 2) unit vectors along the beams.
        normals: (K, 2) unit vectors into the surfaces that the points are on; zeros
            where these are not known.
        spread: Standard deviation of where across its beam an echo comes from, m.
        spots: Whether spots count; not if some beams may have run out of power.
    """

    places: Floats
    along: Floats
    normals: Floats
    spread: float
    spots: bool


class Fit(NamedTuple):
    """The pose at which a scan fits a map best.

    Attributes:
        pose: Pose of the robot, map frame.
        score: Sum of the scores of all points there.
        inliers: Share of the points that lie where the map has points.
        information: (3, 3) information matrix of x, y and yaw by the points alone.
    """

    pose: Pose2
    score: float
    inliers: float
    information: Floats

    @property
    def evenness(self) -> float:
        """Least information on a translation in any direction by the most.

        It is near 0 in a corridor, and 0 without points.
        """
        least, most = np.linalg.eigvalsh(self.information[:2, :2])
        return float(max(least, 0.0) / most) if most > 0.0 else 0.0


def fit(
    table: Packed, points: ScanPoints, start: Pose2, predicted: Pose2, sigma: Floats
) -> Fit:
    """Find the pose near a start at which a scan fits the map best.

    Args:
        table: Table of the map.
        points: Points of the scan.
        start: Pose to begin at.
        predicted: Pose by the robot's motion.
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
    """Return the row of the pose, of (S, 3), at which a sample of points fits best."""
    return int(engine.best_start(table, *points, starts))
