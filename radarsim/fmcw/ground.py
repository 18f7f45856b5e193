"""Level ground: where it is, and how rays graze it.

Open ground does not end at the edge of the map: a ray that passes over that edge meets
it farther on.
"""

import math
from typing import Any, Final, NamedTuple

import numpy as np

from radarsim.geometry import Floats
from radarsim.jit import njit_inline
from radarsim.raycast.tracer import Tracer

OVERLAP: Final = 4.0  # by how much the ranges of a ray reach over those of the next
_LEVEL: Final = 1e-6  # how far the normal of level ground is off the vertical, at most


class Ground(NamedTuple):  # compiled into kernels
    """The ground of a scene; P parts.

    Attributes:
        edges: (P + 1, 4) m, least x and y of each part and greatest ones, map frame.
            Open ground has none; the last row, of robots, is empty.
        open_part: The part that is open ground; -1 for none.
        open_height: m, of that; map frame.
    """

    edges: Floats
    open_part: int
    open_height: float


class Grazing(NamedTuple):
    """A ray that meets level ground.

    Attributes:
        t: Its length, m.
        depth: m, from the antenna down to the ground.
        angle: rad, of elevations for which the ray stands.
        near: m, range at which the ground begins.
        far: m, range at which it ends.
    """

    t: float
    depth: float
    angle: float
    near: float
    far: float


def find_ground(tracer: Tracer) -> Ground:
    """Return the ground of a scene."""
    edges = np.zeros((len(tracer.parts) + 1, 4))
    open_part, area = -1, 0.0
    for i, part in enumerate(tracer.parts):
        if not part.faces.size:
            continue
        low, high = part.bounds
        edges[i] = low[0], low[1], high[0], high[1]
        own = float((high[0] - low[0]) * (high[1] - low[1]))
        if part.material.constant_gamma:
            edges[i] = -math.inf, -math.inf, math.inf, math.inf
            if own > area:
                open_part, area = i, own
    height = float(tracer.parts[open_part].bounds[1][2]) if open_part >= 0 else 0.0
    return Ground(edges, open_part, height)


@njit_inline
def is_level(direction: Any, cosine: Any) -> Any:
    """Return whether a surface is level that a ray from above meets.

    Args:
        direction: (3,) unit vector of the ray.
        cosine: Cosine of its angle of incidence.
    """
    return abs(cosine + direction[2]) < _LEVEL


@njit_inline
def grazing_at(
    ground: Any, part: Any, event: Any, direction: Any, angle: Any, end: Any
) -> Any:
    """Return the ``Grazing`` of a ray that meets level ground.

    Args:
        ground: The ``Ground``.
        part: Its row there.
        event: That at which the ray meets it.
        direction: (3,) unit vector of the ray.
        angle: rad, of elevations for which it stands.
        end: m, where the view over the ground ends.
    """
    back, ahead = np.inf, np.inf
    for axis in range(2):
        step = direction[axis]
        if abs(step) > 1e-9:
            place = event.x if axis == 0 else event.y
            first = (ground.edges[part, axis] - place) / step
            second = (ground.edges[part, 2 + axis] - place) / step
            back = min(back, -min(first, second))
            ahead = min(ahead, max(first, second))
    t = event.t
    near, far = t - max(back, 0.0), min(t + max(ahead, 0.0), end)
    return Grazing(t, -t * direction[2], angle, near, far)


@njit_inline
def way_to_open(ground: Any, end: Any, direction: Any) -> Any:
    """Return how far a ray goes until it meets open ground, m; inf if it does not.

    Args:
        ground: The ``Ground``.
        end: An event on the ray.
        direction: (3,) unit vector of the ray.
    """
    if ground.open_part < 0 or direction[2] >= 0.0:
        return np.inf
    return end.t + (ground.open_height - end.z) / direction[2]
