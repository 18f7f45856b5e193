"""Scan matching: fits a scan to a map of points by Gauss-Newton with robust weights.

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
one wider still; what is left across that direction is the error of the lines' own
directions, and is dropped.

Each step solves the normal equations of a pose, with the unknowns x, y and yaw.
"""

import math
from typing import Final, NamedTuple, TypeAlias

import numpy as np

from radarsim.autonomy.mapping.point_map import LINE_RATIO, Table, shape_around
from radarsim.geometry import Floats, Pose2, wrap_angle
from radarsim.jit import njit_cached, njit_inline

Triple: TypeAlias = tuple[float, float, float]  # xx, xy and yy of a (2, 2) matrix

MAX_ITERATIONS: Final = 12
# Squared distance, in variances, at which the weight is a quarter.
ROBUST_SCALE: Final = 4.0
SAMPLED_POINTS: Final = 150  # at most, that are used to compare starts
HALF_SCORE: Final = 1 / 0.05**2  # 1/m^2; a point known to 5 cm scores one half
WIDER: Final = 1  # wider windows in which lines are looked for
WIDER_ALONG: Final = 2  # along a corridor
CORRIDOR_RATIO: Final = 0.3  # least information by most, below which it is one
# Normals are off by some degrees: along a wall its points seem to have up to this share
# of the information that they have across it, and have none.
LEAST_RATIO: Final = 0.05
INLIER_WEIGHT: Final = 0.25  # robust weight from which a point fits the map
MAX_SPOT: Final = 0.15**2  # m^2, largest variance of a spot
RANGE_ERROR: Final = 0.02  # m, of ranges and of the map's own lines


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
    table: Table, points: ScanPoints, start: Pose2, predicted: Pose2, sigma: Floats
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
    information = np.zeros((3, 3))
    known = 1.0 / np.square(sigma)
    score, inliers = _fit(table, points, state, prior, known, information)
    x, y, yaw = state.tolist()
    # The kernel fills the lower half.
    information = np.tril(information) + np.tril(information, -1).T
    share = inliers / max(len(points.places), 1)
    return Fit(Pose2(x, y, wrap_angle(yaw)), score, share, information)


def best_start(table: Table, points: ScanPoints, starts: Floats) -> int:
    """Return the row of the pose, of (S, 3), at which a sample of points fits best."""
    step = 1 + len(points.places) // SAMPLED_POINTS
    # Kernels are compiled for contiguous arrays, and anew for any other layout.
    columns = (np.ascontiguousarray(rows[::step]) for rows in points[:3])
    places, along, normals = columns
    some = points._replace(places=places, along=along, normals=normals)
    return int(_best_start(table, some, starts))


@njit_inline
def keep_only(normal: Floats, gradient: Floats, nx: float, ny: float) -> None:
    """Keep of what points say of a translation only what is along a unit vector.

    Source: Zhang, Kaess and Singh, "On degeneracy of optimization-based state
    estimation problems" (2016), with a ratio in place of the absolute threshold.
    """
    # P N P, where P = n n^T acts on x and y, for the lower half. What is known of the
    # yaw alone stays.
    a, b, c = normal[0, 0], normal[1, 0], normal[1, 1]
    most = a * nx * nx + 2.0 * b * nx * ny + c * ny * ny
    normal[0, 0], normal[1, 0] = most * nx * nx, most * nx * ny
    normal[1, 1] = most * ny * ny
    cross = nx * normal[2, 0] + ny * normal[2, 1]
    normal[2, 0], normal[2, 1] = cross * nx, cross * ny
    force = nx * gradient[0] + ny * gradient[1]
    gradient[0], gradient[1] = force * nx, force * ny


@njit_inline
def _factor(normal: Floats) -> None:
    # Cholesky's, in place, of the lower half. numba's linear algebra would allocate
    # arrays and call LAPACK, for three unknowns, at each of a thousand poses.
    for j in range(3):
        for i in range(j, 3):
            for k in range(j):
                normal[i, j] -= normal[i, k] * normal[j, k]
        normal[j, j] = math.sqrt(normal[j, j])
        for i in range(j + 1, 3):
            normal[i, j] /= normal[j, j]


@njit_inline
def solve(normal: Floats, gradient: Floats) -> None:
    """Solve three symmetric equations in place, by Cholesky."""
    _factor(normal)
    for j in range(3):
        for k in range(j):
            gradient[j] -= normal[j, k] * gradient[k]
        gradient[j] /= normal[j, j]
    for j in range(2, -1, -1):
        for k in range(j + 1, 3):
            gradient[j] -= normal[k, j] * gradient[k]
        gradient[j] /= normal[j, j]


@njit_inline
def _information(
    shape: Triple, across: tuple[float, float], spread: float, spots: bool
) -> Triple:
    """Return the information matrix of a distance to a shape, xx, xy and yy, 1/m^2.

    Args:
        shape: Covariance of the map's points, xx, xy and yy.
        across: Unit vector across the beam.
        spread: Standard deviation of the echo along that vector.
        spots: Whether spots count, and not only lines.
    """
    a, b, c = shape
    half, turn = (a + c) / 2, math.hypot((a - c) / 2, b)
    # The eigenvalues; rounding can make the smaller one negative.
    small, large = max(half - turn, 0.0), half + turn
    noise, wide = RANGE_ERROR * RANGE_ERROR, spread * spread
    if large >= LINE_RATIO * small:
        angle = math.atan2(2.0 * b, a - c) / 2
        nx, ny = -math.sin(angle), math.cos(angle)
        # Of the spread across the beam, only the part along the normal moves the echo
        # away from the line.
        facing = nx * across[0] + ny * across[1]
        weight = 1.0 / (small + noise + wide * facing * facing)
        return weight * nx * nx, weight * nx * ny, weight * ny * ny
    if not spots or large > MAX_SPOT:
        return 0.0, 0.0, 0.0
    a += noise + wide * across[0] * across[0]
    b += wide * across[0] * across[1]
    c += noise + wide * across[1] * across[1]
    area = 2.0 * (a * c - b * b)  # twice: both directions are one echo
    return c / area, -b / area, a / area


class _Match(NamedTuple):
    """A point of the scan compared with the map, on the map's axes.

    Attributes:
        rx: x from the robot to the point, m.
        ry: y from the robot to the point, m.
        ex: x from the point to the mean of the map's points around it, m.
        ey: y from the point to the mean of the map's points around it, m.
        information: Information matrix of that distance, xx, xy and yy.
        weight: Robust weight; 0 where the map has no points.
    """

    rx: float
    ry: float
    ex: float
    ey: float
    information: Triple
    weight: float


@njit_inline
def _compare(
    table: Table,
    points: ScanPoints,
    i: int,
    state: Floats,
    turn: tuple[float, float],
    wider: int = 0,
) -> _Match:
    c, s = turn
    px, py = points.places[i, 0], points.places[i, 1]
    dx, dy = points.along[i, 0], points.along[i, 1]
    rx, ry = c * px - s * py, s * px + c * py
    nx, ny = points.normals[i, 0], points.normals[i, 1]
    normal = (c * nx - s * ny, s * nx + c * ny)
    shape = shape_around(table, state[0] + rx, state[1] + ry, normal, wider)
    if not shape.found:
        return _Match(rx, ry, 0.0, 0.0, (0.0, 0.0, 0.0), 0.0)
    # The beam turned by the heading, and by a right angle more.
    across = (-s * dx - c * dy, c * dx - s * dy)
    covariance = shape.xx, shape.xy, shape.yy
    information = _information(covariance, across, points.spread, points.spots)
    ex, ey = shape.dx, shape.dy
    # the squared Mahalanobis distance
    off = (
        information[0] * ex * ex
        + 2.0 * information[1] * ex * ey
        + information[2] * ey * ey
    )
    # Where the map tells nothing, every distance is 0 and would be a perfect fit.
    weight = (
        (ROBUST_SCALE / (ROBUST_SCALE + off)) ** 2
        if information[0] + information[2] > 0.0
        else 0.0
    )
    return _Match(rx, ry, ex, ey, information, weight)


@njit_inline
def _score(information: Triple, weight: float) -> float:
    # Wide shapes are near to every point, so only narrow ones tell poses apart.
    trace = information[0] + information[2]
    return weight * trace / (trace + HALF_SCORE)


@njit_inline
def _add_up(
    table: Table,
    points: ScanPoints,
    state: Floats,
    normal: Floats,
    gradient: Floats,
    wider: int,
) -> tuple[float, int]:
    """Set the normal equations of the points.

    Returns:
        The sum of the points' scores, and the number of inliers.
    """
    normal[:], gradient[:] = 0.0, 0.0
    turn = math.cos(state[2]), math.sin(state[2])
    score, inliers = 0.0, 0
    for i in range(len(points.places)):
        match = _compare(table, points, i, state, turn, wider)
        score += _score(match.information, match.weight)
        inliers += match.weight > INLIER_WEIGHT
        a = match.weight * match.information[0]
        b = match.weight * match.information[1]
        d = match.weight * match.information[2]
        # The Jacobian of the point by x, y and yaw is [1 0 -ry; 0 1 rx].
        fx, fy = a * match.ex + b * match.ey, b * match.ex + d * match.ey
        rx, ry = match.rx, match.ry
        p, q = b * rx - a * ry, d * rx - b * ry
        gradient[0] += fx
        gradient[1] += fy
        gradient[2] += rx * fy - ry * fx
        normal[0, 0] += a
        normal[1, 0] += b
        normal[1, 1] += d
        normal[2, 0] += p
        normal[2, 1] += q
        normal[2, 2] += rx * q - ry * p
    return score, inliers


@njit_inline
def _constraint(
    table: Table, points: ScanPoints, state: Floats
) -> tuple[float, float, float]:
    """Return in which direction points constrain a translation, and how evenly.

    Robust weights do not count: a robot that is off by more than a wall is thick is in
    no corridor for that.

    Returns:
        The least information of a direction by the most, and the unit vector of the
        most.
    """
    turn, a, b, c = (math.cos(state[2]), math.sin(state[2])), 0.0, 0.0, 0.0
    for i in range(len(points.places)):
        match = _compare(table, points, i, state, turn, WIDER_ALONG)
        a += match.information[0]
        b += match.information[1]
        c += match.information[2]
    half, away = (a + c) / 2, math.hypot((a - c) / 2, b)
    angle = math.atan2(2.0 * b, a - c) / 2
    ratio = (half - away) / (half + away) if half > 0.0 else 1.0
    return ratio, math.cos(angle), math.sin(angle)


@njit_cached
def _fit(
    table: Table,
    points: ScanPoints,
    state: Floats,
    prior: Floats,
    known: Floats,
    information: Floats,
) -> tuple[float, int]:
    """Move a pose to where the scan fits.

    Args:
        table: Table of the map.
        points: Points of the scan.
        state: (3,) pose to begin at, and the result.
        prior: (3,) predicted pose.
        known: (3,) information of the predicted pose.
        information: (3, 3), lower half: that of the points, to be filled.

    Returns:
        The score and the number of inliers before the last step.
    """
    normal, gradient, score, inliers = np.zeros((3, 3)), np.zeros(3), 0.0, 0
    # Once, at the start, so that all steps of a fit make the same sum smaller.
    ratio, nx, ny = _constraint(table, points, state)
    wider = WIDER_ALONG if ratio < CORRIDOR_RATIO else WIDER
    for _ in range(MAX_ITERATIONS):
        score, inliers = _add_up(table, points, state, normal, gradient, wider)
        # What is left along the corridor is the error of the normals. It would hold the
        # robot back, or drag it on, by a share of each step.
        if ratio < LEAST_RATIO:
            keep_only(normal, gradient, nx, ny)
        for j in range(3):  # before the prior is added: by the points alone
            for k in range(3):
                information[j, k] = normal[j, k]
        # Yaws need no wrapping: starts are always on the same turn as predictions.
        for k in range(3):
            normal[k, k] += known[k]
            gradient[k] += known[k] * (prior[k] - state[k])
        solve(normal, gradient)
        state += gradient
        # Nothing within 10 m of the robot moves by more than about 0.1 mm any more.
        if max(abs(gradient[0]), abs(gradient[1]), 10.0 * abs(gradient[2])) < 1e-4:
            break
    return score, inliers


@njit_cached
def _best_start(table: Table, points: ScanPoints, starts: Floats) -> int:
    best, best_score = 0, -1.0
    for k in range(len(starts)):
        turn = math.cos(starts[k, 2]), math.sin(starts[k, 2])
        score = 0.0
        # In narrow windows only: poses differ by more than a wide one tells apart.
        for i in range(len(points.places)):
            match = _compare(table, points, i, starts[k], turn)
            score += _score(match.information, match.weight)
        if score > best_score:
            best, best_score = k, score
    return best
