"""Surface normals: which way the surfaces face that the points of a scan are on.

Both faces of a wall are on a map once a robot has seen it from both sides. They are
nearer to each other than echoes of a thick beam scatter, and only the direction in
which they face tells them apart. It is that of the line through the neighbours of a
point in its scan, on the side where the scanner is.
"""

import math
from typing import Any, Final

import numpy as np

from radarsim.geometry import Floats
from radarsim.jit import njit_cached
from radarsim.mapping.point_map import is_line

NEIGHBOURS: Final = 8  # points of the scan, to each side, that may count
RADIUS: Final = 0.4  # m, within which they do
MIN_NEIGHBOURS: Final = 4  # of a line, the point itself included
# Least share of a beam that is along the normal; lines nearly along the beam are the
# scatter of single points.
LEAST_FACING: Final = 0.2


def inward_normals(places: Floats, along: Floats) -> Floats:
    """Return unit vectors from points into the surfaces that they are on, (K, 2).

    Where the neighbours of a point form no line, it is the direction of the beam.

    Args:
        places: (K, 2) points of a scan in the order of their beams, m.
        along: (K, 2) unit vectors along the beams.
    """
    normals: Floats = along.copy()
    if len(places):
        _fill_normals(np.ascontiguousarray(places), along, normals)
    return normals


@njit_cached
def _fill_normals(places: Any, along: Any, normals: Any) -> None:
    count = len(places)
    side = min(NEIGHBOURS, (count - 1) // 2)  # scans go all around
    for i in range(count):
        n, x, y, xx, xy, yy = 0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(i - side, i + side + 1):
            j = k % count
            u, v = places[j, 0] - places[i, 0], places[j, 1] - places[i, 1]
            if u * u + v * v < RADIUS * RADIUS:
                n += 1
                x += u
                y += v
                xx += u * u
                xy += u * v
                yy += v * v
        if n < MIN_NEIGHBOURS:
            continue
        x, y = x / n, y / n
        xx, xy, yy = xx / n - x * x, xy / n - x * y, yy / n - y * y
        if not is_line(xx, xy, yy):
            continue
        angle = math.atan2(2.0 * xy, xx - yy) / 2
        nx, ny = -math.sin(angle), math.cos(angle)
        facing = nx * along[i, 0] + ny * along[i, 1]
        if abs(facing) > LEAST_FACING:
            inward = math.copysign(1.0, facing)
            normals[i, 0], normals[i, 1] = inward * nx, inward * ny
