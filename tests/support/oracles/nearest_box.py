"""The nearest of all boxes on a ray, each of them tried in turn."""

import math

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def nearest_box(
    table: Floats, carrier_id: int, origin: Floats, direction: Floats, max_range: float
) -> tuple[float, int]:
    """Return the distance and the id of the box that a ray meets.

    Args:
        table: Centre, cosine and sine of the yaw, half sizes, radius, and id of boxes.
        carrier_id: The box that does not count.
        origin: (3,) m.
        direction: (3,) unit vector.
        max_range: m, returned with -1 where nothing is met.
    """
    nearest, box_id = max_range, -1
    ex, ey, ez = direction.tolist()
    for x, y, z, c, s, length, width, height, radius, number in table.tolist():
        dx, dy = float(origin[0]) - x, float(origin[1]) - y
        if abs(ex * dy - ey * dx) > radius or number == carrier_id:
            continue
        ahead = slab(c * dx + s * dy, c * ex + s * ey, length)
        aside = slab(c * dy - s * dx, c * ey - s * ex, width)
        above = slab(float(origin[2]) - z, ez, height)
        near = max(ahead[0], aside[0], above[0])
        far = min(ahead[1], aside[1], above[1])
        t = near if near >= 0.0 else far
        if near <= far and 0.0 <= t <= nearest:
            nearest, box_id = t, int(number)
    return nearest, box_id


def slab(start: float, slope: float, half: float) -> tuple[float, float]:
    """Return where a ray enters and leaves the slab from -half to half on one axis."""
    if slope == 0.0:
        inside = abs(start) <= half
        return (-math.inf, math.inf) if inside else (math.inf, -math.inf)
    with np.errstate(over="ignore"):
        first = float(np.float64(-half - start) / slope)
        second = float(np.float64(half - start) / slope)
    return min(first, second), max(first, second)
