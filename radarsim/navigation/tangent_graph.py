"""The local tangent graph: how far it is to the goal over the edges that a scan shows.

What a scan shows of an obstacle is a thin wall, and what it does not show is open. The
shortest ways around thin walls lead straight from edge to edge, and to the goal; where
a wall goes out of sight behind an obstacle, it may end.

Source: I. Kamon, E. Rimon, E. Rivlin, TangentBug: a range-sensor-based navigation
algorithm, International Journal of Robotics Research 17, 1998.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from radarsim.geometry import Floats
from radarsim.navigation.open_directions import OpenDirections, Point

MOST_PAIRS: Final = 1_000_000  # of segments and walls at once, which bounds the memory


def ways_to_goal(edges: Floats, goal: Point, directions: OpenDirections) -> Floats:
    """Return the length of the shortest way from each edge to the goal.

    Args:
        edges: (M, 2) m, map frame.
        goal: m, map frame.
        directions: What a scan shows.

    Returns:
        (M,) m; ``inf`` where thin walls close all ways.
    """
    places = np.vstack([goal, edges, directions.hidden_ends()])
    lengths = np.hypot(*(places[:, None] - places).transpose(2, 0, 1))
    first, second = np.triu_indices(len(places), 1)
    closed = crosses_any(places[first], places[second], directions.walls())
    lengths[first[closed], second[closed]] = np.inf
    ways: Floats = dijkstra(np.triu(lengths), directed=False, indices=0)
    return ways[1 : len(edges) + 1]


def crosses_any(
    begins: Floats, ends: Floats, walls: tuple[Floats, Floats]
) -> NDArray[np.bool_]:
    """Return which segments cross a wall.

    Args:
        begins: (N, 2) m.
        ends: (N, 2) m.
        walls: Both ends of the walls, (K, 2) m each.

    Returns:
        (N,)
    """
    c, d = walls
    closed = np.zeros(len(begins), np.bool_)
    block = max(1, MOST_PAIRS // max(len(c), 1))
    for first in range(0, len(begins), block):
        rows = slice(first, first + block)
        a, b = begins[rows, None], ends[rows, None]
        sides_of_wall = _side(c, d, a) * _side(c, d, b)
        sides_of_segment = _side(a, b, c) * _side(a, b, d)
        closed[rows] = ((sides_of_wall < 0) & (sides_of_segment < 0)).any(axis=1)
    return closed


def _side(begin: Floats, end: Floats, point: Floats) -> Floats:
    """Return the cross product that tells on which side of a line a point is."""
    along, to = end - begin, point - begin
    cross: Floats = along[..., 0] * to[..., 1] - along[..., 1] * to[..., 0]
    return cross
