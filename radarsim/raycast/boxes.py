"""Upright boxes that stop every ray: robots, which move while the scene is sealed."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit

from radarsim.geometry import Floats


@dataclass(frozen=True, slots=True)
class Boxes:
    """Upright boxes that stop every ray: robots.

    Attributes:
        rows: (B, 8): x, y, yaw, lower and upper z, half the length, half the width
            (m, rad), and a number that names the box.
    """

    rows: Floats

    @classmethod
    def none(cls) -> "Boxes":
        """Give no boxes."""
        return cls(np.zeros((0, 8)))


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def _slab(at: Any, step: Any, half: Any) -> Any:
    """Give where a ray enters and leaves the slab from -half to half along one axis."""
    if step == 0.0:
        return (-np.inf, np.inf) if abs(at) <= half else (np.inf, -np.inf)
    first, second = (-half - at) / step, (half - at) / step
    return min(first, second), max(first, second)


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def meet_boxes(rows: Any, own: Any, origin: Any, direction: Any, reach: Any) -> Any:
    """Find the nearest surface of all boxes but one's own.

    A ray that starts in a box meets it from within.

    Returns:
        How far it is, m, at most ``reach``; and the box's number, -1 for none.
    """
    nearest, name = reach, np.int64(-1)
    for i in range(len(rows)):
        x, y, yaw, low, high, length, width, number = rows[i]
        if number == own:
            continue
        c, s = np.cos(yaw), np.sin(yaw)
        dx, dy = origin[0] - x, origin[1] - y
        ahead = _slab(c * dx + s * dy, c * direction[0] + s * direction[1], length)
        beside = _slab(c * dy - s * dx, c * direction[1] - s * direction[0], width)
        above = _slab(origin[2] - (low + high) / 2, direction[2], (high - low) / 2)
        near = max(ahead[0], beside[0], above[0])
        far = min(ahead[1], beside[1], above[1])
        t = near if near >= 0.0 else far
        if near <= far and 0.0 <= t <= nearest:
            nearest, name = t, np.int64(number)
    return nearest, name
