"""Directions: of things as a sensor sees them, and of its rays in the map."""

import math
from typing import Any, NamedTuple

import numpy as np

from radarsim.geometry import Floats, Pose3
from radarsim.jit import njit_cached, njit_inline

_FULL = 2 * math.pi


class Extents(NamedTuple):
    """What directions things take up, seen from a sensor; N things.

    Attributes:
        azimuth: (N,) rad, of the right edge, clockwise from straight ahead.
        width: (N,) rad.
        low: (N,) rad, elevation of the lower edge.
        high: (N,) rad, of the upper edge.
        distance: (N,) m, to the middle.
    """

    azimuth: Floats
    width: Floats
    low: Floats
    high: Floats
    distance: Floats


def extents_from(pose: Pose3, bounds: Floats) -> Extents:
    """Return what directions bounding boxes take up.

    Args:
        pose: Pose of the sensor, map frame.
        bounds: (N, 2, 3) m, lower and upper corners, map frame.
    """
    extents = Extents(*np.zeros((5, len(bounds))))
    rotation = np.ascontiguousarray(pose.rotation())
    _measure(np.ascontiguousarray(bounds), pose.position(), rotation, extents)
    return extents


@njit_cached
def _measure(bounds: Any, position: Any, rotation: Any, extents: Any) -> None:
    seen = np.zeros((8, 3))
    for i in range(len(bounds)):
        for corner in range(8):
            seen[corner] = 0.0
            for axis in range(3):
                side = (corner >> axis) & 1
                offset = bounds[i, side, axis] - position[axis]
                for k in range(3):
                    seen[corner, k] += offset * rotation[axis, k]
        x, y, z = seen[:, 0].mean(), seen[:, 1].mean(), seen[:, 2].mean()
        centre = -np.arctan2(y, x)
        first, last, low, high = np.inf, -np.inf, np.inf, -np.inf
        for corner in range(8):
            turned = _wrap(-np.arctan2(seen[corner, 1], seen[corner, 0]) - centre)
            first, last = min(first, turned), max(last, turned)
            level = np.hypot(seen[corner, 0], seen[corner, 1])
            up = np.arctan2(seen[corner, 2], level)
            low, high = min(low, up), max(high, up)
        extents.azimuth[i], extents.width[i] = centre + first, last - first
        extents.low[i], extents.high[i] = low, high
        extents.distance[i] = np.sqrt(x * x + y * y + z * z)


@njit_inline
def _wrap(angle: Any) -> Any:
    """Return an angle between -pi and pi, rad."""
    return (angle + math.pi) % _FULL - math.pi


def turned_directions(directions: Floats, rotation: Floats) -> Floats:
    """Return the directions of rays in the map frame, (M, 3) unit vectors.

    Args:
        directions: (M, 3) sensor frame.
        rotation: (3, 3) of the sensor.
    """
    turned = np.empty_like(directions)
    _turn(directions, np.ascontiguousarray(rotation), turned)
    return turned


@njit_cached
def _turn(directions: Any, rotation: Any, turned: Any) -> None:
    # Not a product of matrices, which rounds by how many rows there are.
    for ray in range(len(directions)):
        ahead, left, up = directions[ray]
        square = 0.0
        for axis in range(3):
            part = ahead * rotation[axis, 0] + left * rotation[axis, 1]
            part += up * rotation[axis, 2]
            turned[ray, axis] = part
            square += part * part
        # Rounding of the product must not make the vectors longer.
        length = np.sqrt(square)
        for axis in range(3):
            turned[ray, axis] /= length
