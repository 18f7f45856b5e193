"""Normal equations of a pose: three unknowns, x, y and yaw."""

import math
from typing import Any

from radarsim.jit import njit_inline


@njit_inline
def keep_only(normal: Any, gradient: Any, nx: Any, ny: Any) -> None:
    """Keep of what points say of a translation only what is along a unit vector.

    Source: Zhang, Kaess and Singh, "On degeneracy of optimization-based state
    estimation problems" (2016), with a ratio in place of the absolute threshold.
    """
    a, b, c = normal[0, 0], normal[1, 0], normal[1, 1]
    most = a * nx * nx + 2.0 * b * nx * ny + c * ny * ny
    normal[0, 0], normal[1, 0] = most * nx * nx, most * nx * ny
    normal[1, 1] = most * ny * ny
    cross = nx * normal[2, 0] + ny * normal[2, 1]
    normal[2, 0], normal[2, 1] = cross * nx, cross * ny
    force = nx * gradient[0] + ny * gradient[1]
    gradient[0], gradient[1] = force * nx, force * ny


@njit_inline
def _factor(normal: Any) -> None:
    """Compute the Cholesky factor of (3, 3) in place; only the lower half is read."""
    for j in range(3):
        for i in range(j, 3):
            for k in range(j):
                normal[i, j] -= normal[i, k] * normal[j, k]
        normal[j, j] = math.sqrt(normal[j, j])
        for i in range(j + 1, 3):
            normal[i, j] /= normal[j, j]


@njit_inline
def solve(normal: Any, gradient: Any) -> None:
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
