"""Where a scan fits best into a map of points: Gauss and Newton, with robust weights.

Theory of operation
===================
Each point of the scan is compared with the shape of the map's points around it. Where
these lie along a line, only the distance across it counts, as points slide along walls;
where they are a spot, as of a pole, both directions do. A distance is weighed by how
much it is worth: less where the map's points are spread, as in foliage, and less where
the beam grazes, since an echo may come from anywhere across the beam. What is far off
for its spread counts next to nothing (Geman and McClure's weights).

What the robot knows of its motion is one more distance, from the predicted pose. Where
the scan says nothing, in the open or along a corridor, that alone is left, and the
solution is the prediction; so it cannot run away.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np

from radarsim.geometry import Floats, Pose2, wrap_angle
from radarsim.jit import njit_cached, njit_inline
from radarsim.mapping.point_map import Table, shape_around

ROUNDS: Final = 12
ROBUST: Final = 4.0  # squared distance, in variances, at which the weight is a quarter
TRIED: Final = 150  # points for which starts are compared
SLIM: Final = 4.0  # variance along a line by that across it, at least
SHARP: Final = 1 / 0.05**2  # 1/m^2; what is known to 5 cm counts half in comparisons
SPOT: Final = 0.15**2  # m^2, largest variance of what is a spot
RANGE_ERROR: Final = 0.02  # m, of ranges and of the map's own lines


class Points(NamedTuple):
    """Where the beams of a scan ended, in the robot's frame.

    Attributes:
        places: (K, 2) m.
        along: (K, 2) unit vectors along the beams.
        spread: m, standard deviation of where across its beam an echo comes from.
        spots: Whether spots count; not where some ends may be of spent beams.
    """

    places: Floats
    along: Floats
    spread: float
    spots: bool


def fit(
    table: Table, points: Points, start: Pose2, predicted: Pose2, sigma: Floats
) -> tuple[Pose2, float]:
    """Find the pose at which a scan fits best, near a start.

    Args:
        table: The map.
        points: The scan.
        start: Where to begin.
        predicted: What the robot's motion says.
        sigma: (3,) standard deviations of that, m, m and rad.

    Returns:
        The pose, and the sum of the merits of all points there.
    """
    state = np.array([start.x, start.y, start.yaw])
    prior = np.array([predicted.x, predicted.y, predicted.yaw])
    score = float(_fit(table, points, state, prior, 1.0 / np.square(sigma)))
    x, y, yaw = state.tolist()
    return Pose2(x, y, wrap_angle(yaw)), score


def best_start(table: Table, points: Points, starts: Floats) -> int:
    """Give the row of the pose, of (S, 3), at which a part of the points fits best."""
    step = 1 + len(points.places) // TRIED
    places, along = (np.ascontiguousarray(rows[::step]) for rows in points[:2])
    some = points._replace(places=places, along=along)
    return int(_best_start(table, some, starts))


@njit_inline
def _worth(shape: Any, across: Any, spread: Any, spots: Any) -> Any:
    """Give the information matrix of a distance to a shape, xx, xy and yy, 1/m^2.

    Args:
        shape: Covariance of the map's points, xx, xy and yy.
        across: Unit vector across the beam.
        spread: Of the echo along that.
        spots: Whether what is no line counts.
    """
    a, b, c = shape
    half, turn = (a + c) / 2, math.hypot((a - c) / 2, b)
    small, large = max(half - turn, 0.0), half + turn
    noise, wide = RANGE_ERROR * RANGE_ERROR, spread * spread
    if large >= SLIM * small:
        angle = math.atan2(2.0 * b, a - c) / 2
        nx, ny = -math.sin(angle), math.cos(angle)
        facing = nx * across[0] + ny * across[1]
        worth = 1.0 / (small + noise + wide * facing * facing)
        return worth * nx * nx, worth * nx * ny, worth * ny * ny
    if not spots or large > SPOT:
        return 0.0, 0.0, 0.0
    a += noise + wide * across[0] * across[0]
    b += wide * across[0] * across[1]
    c += noise + wide * across[1] * across[1]
    area = 2.0 * (a * c - b * b)  # twice: both directions are one echo
    return c / area, -b / area, a / area


@njit_inline
def _compare(table: Any, points: Any, i: Any, state: Any, turn: Any) -> Any:
    """Compare a point with the map.

    Returns:
        Its place as seen from the robot on the map's axes, its way to the map's points,
        its worth, and its robust weight.
    """
    c, s = turn
    px, py = points.places[i, 0], points.places[i, 1]
    dx, dy = points.along[i, 0], points.along[i, 1]
    rx, ry = c * px - s * py, s * px + c * py
    found, ex, ey, a, b, d = shape_around(table, state[0] + rx, state[1] + ry)
    if not found:
        return rx, ry, 0.0, 0.0, (0.0, 0.0, 0.0), 0.0
    across = (-s * dx - c * dy, c * dx - s * dy)
    worth = _worth((a, b, d), across, points.spread, points.spots)
    off = worth[0] * ex * ex + 2.0 * worth[1] * ex * ey + worth[2] * ey * ey
    weight = (ROBUST / (ROBUST + off)) ** 2 if worth[0] + worth[2] > 0.0 else 0.0
    return rx, ry, ex, ey, worth, weight


@njit_inline
def _merit(worth: Any, weight: Any) -> Any:
    """Give what a point counts when poses are compared.

    Coarse shapes are near to everything; what is sharp tells poses apart.
    """
    sharp = worth[0] + worth[2]
    return weight * sharp / (sharp + SHARP)


@njit_inline
def _add_up(table: Any, points: Any, state: Any, normal: Any, pull: Any) -> Any:
    """Add the points to the normal equations; give their merits' sum."""
    turn = math.cos(state[2]), math.sin(state[2])
    score = 0.0
    for i in range(len(points.places)):
        rx, ry, ex, ey, worth, weight = _compare(table, points, i, state, turn)
        score += _merit(worth, weight)
        a, b, d = weight * worth[0], weight * worth[1], weight * worth[2]
        fx, fy = a * ex + b * ey, b * ex + d * ey
        p, q = b * rx - a * ry, d * rx - b * ry
        pull[0] += fx
        pull[1] += fy
        pull[2] += rx * fy - ry * fx
        normal[0, 0] += a
        normal[1, 0] += b
        normal[1, 1] += d
        normal[2, 0] += p
        normal[2, 1] += q
        normal[2, 2] += rx * q - ry * p
    return score


@njit_inline
def _factor(normal: Any) -> None:
    """Factor three equations in place, after Cholesky; the lower half is read."""
    for j in range(3):
        for i in range(j, 3):
            for k in range(j):
                normal[i, j] -= normal[i, k] * normal[j, k]
        normal[j, j] = math.sqrt(normal[j, j])
        for i in range(j + 1, 3):
            normal[i, j] /= normal[j, j]


@njit_inline
def _solve(normal: Any, pull: Any) -> None:
    """Solve three equations in place."""
    _factor(normal)
    for j in range(3):
        for k in range(j):
            pull[j] -= normal[j, k] * pull[k]
        pull[j] /= normal[j, j]
    for j in range(2, -1, -1):
        for k in range(j + 1, 3):
            pull[j] -= normal[k, j] * pull[k]
        pull[j] /= normal[j, j]


@njit_cached
def _fit(table: Any, points: Any, state: Any, prior: Any, trust: Any) -> Any:
    """Move a pose to where the scan fits; give the score before the last step."""
    normal, pull, score = np.zeros((3, 3)), np.zeros(3), 0.0
    for _ in range(ROUNDS):
        normal[:] = 0.0
        for k in range(3):
            normal[k, k] = trust[k]
            pull[k] = trust[k] * (prior[k] - state[k])
        score = _add_up(table, points, state, normal, pull)
        _solve(normal, pull)
        state += pull
        if max(abs(pull[0]), abs(pull[1]), 10.0 * abs(pull[2])) < 1e-4:
            break
    return score


@njit_cached
def _best_start(table: Any, points: Any, starts: Any) -> Any:
    best, most = 0, -1.0
    for k in range(len(starts)):
        turn = math.cos(starts[k, 2]), math.sin(starts[k, 2])
        score = 0.0
        for i in range(len(points.places)):
            _, _, _, _, worth, weight = _compare(table, points, i, starts[k], turn)
            score += _merit(worth, weight)
        if score > most:
            best, most = k, score
    return best
