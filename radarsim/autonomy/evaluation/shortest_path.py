"""The shortest path of a disc on a map, as a reference for the paths of robots.

Theory of operation
===================
A shortest path among obstacles is a chain of straight lines between corners of the
obstacles that it bends around (the visibility graph). Here the obstacles are the solid
objects grown by the disc's radius, with arcs made of chords. A* searches this graph. It
computes only edges from the corners that it expands, and only edges that can be part of
a shortest path: such an edge touches the obstacles at both of its ends without entering
them.
"""

import heapq
import math

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.polygon import orient

from radarsim.geometry import Floats
from radarsim.scene.scene import Scene
from radarsim.simulation.map_warnings import Position, component_around, free_space

_TOLERANCE = 1e-6  # m by which a path may come closer than the clearance


def shortest_path(
    scene: Scene, start: Position, goal: Position, clearance: float
) -> tuple[float, Floats] | None:
    """Compute the shortest path of a disc between two points of a map.

    Args:
        scene: The map.
        start: Start of the disc's centre, m.
        goal: Goal of the disc's centre, m.
        clearance: Radius of the disc, m.

    Returns:
        The length, m, and the points where it bends, (N, 2) m, with both ends; None
        without a path. The length is at most 0.1 % below the exact one.
    """
    free = free_space(scene, clearance, places=(start, goal))
    piece = component_around(free, start)
    if piece is None or not piece.intersects(shapely.Point(goal)):
        return None
    return _Search(piece, start, goal).path()


class _Search:
    """A* search over visible corners, from the start, corner 0, to the goal, corner 1.

    networkx and scipy are not used: they need all edges in advance, which takes far
    longer than the search.
    """

    def __init__(self, piece: Polygon, start: Position, goal: Position) -> None:
        """Find the corners of obstacles that a path may bend around."""
        no_edges = np.zeros((2, 2))
        rows = [(np.array([start, goal]), no_edges, no_edges)]
        for ring in shapely.get_rings(orient(piece)):
            points = shapely.get_coordinates(ring)[:-1]  # free space is on the left
            before = np.roll(points, 1, axis=0) - points
            behind = np.roll(points, -1, axis=0) - points
            # A shortest path bends only around convex corners of obstacles.
            bends = before[:, 0] * behind[:, 1] - before[:, 1] * behind[:, 0] > 0
            rows.append((points[bends], before[bends], behind[bends]))
        # (N, 2) m: corners, and vectors to the
        # previous and the next corner of the boundary
        self._points, self._before, self._behind = map(
            np.concatenate, zip(*rows, strict=True)
        )
        # Rounding may put lines along an edge
        # slightly outside, so the area is enlarged.
        self._visible = piece.buffer(_TOLERANCE, join_style="mitre")
        shapely.prepare(self._visible)
        self._to_goal = np.hypot(*(self._points - self._points[1]).T)
        self._lengths = np.full(len(self._points), math.inf)
        self._lengths[0] = 0.0
        self._previous = np.zeros(len(self._points), dtype=np.intp)

    def path(self) -> tuple[float, Floats] | None:
        """Return length and points of the shortest path; None if there is no path."""
        queue = [(float(self._to_goal[0]), 0)]
        done: set[int] = set()
        while queue:
            _, corner = heapq.heappop(queue)
            if corner == 1:
                return float(self._lengths[1]), self._bends()
            if corner in done:  # a shorter path to it was found after it was queued
                continue
            done.add(corner)
            for neighbour in self._expand(corner).tolist():
                total = float(self._lengths[neighbour] + self._to_goal[neighbour])
                heapq.heappush(queue, (total, neighbour))
        return None

    def _expand(self, corner: int) -> NDArray[np.intp]:
        """Return visible corners that get a shorter path through the given corner."""
        points = self._points
        lines = points - points[corner]
        lengths = self._lengths[corner] + np.hypot(*lines.T)
        (others,) = np.nonzero(lengths < self._lengths)
        # A shortest path bends around a corner, so both edges of the corner are on one
        # side of a line. All other lines skip the slow visibility test.
        others = others[self._pass(lines[others], corner)]
        others = others[self._pass(lines[others], others)]
        ends = points[others]
        starts = np.broadcast_to(points[corner], ends.shape)
        sights = shapely.linestrings(np.stack([starts, ends], axis=1))
        seen: NDArray[np.intp] = others[shapely.covers(self._visible, sights)]
        self._lengths[seen] = lengths[seen]
        self._previous[seen] = corner
        return seen

    def _pass(self, lines: Floats, which: NDArray[np.intp] | int) -> NDArray[np.bool_]:
        """Return which lines pass a corner with both of its edges on the same side.

        Args:
            lines: (L, 2) m, vectors of the lines.
            which: Index of each line's corner, or one index for all lines.
        """
        a, b = self._before[which], self._behind[which]
        before = lines[:, 0] * a[..., 1] - lines[:, 1] * a[..., 0]
        behind = lines[:, 0] * b[..., 1] - lines[:, 1] * b[..., 0]
        same_side: NDArray[np.bool_] = (before * behind) >= -(_TOLERANCE**2)
        return same_side

    def _bends(self) -> Floats:
        """Return the points where the shortest path bends, and its ends, (N, 2) m."""
        indices = [1]
        while indices[-1] != 0:
            indices.append(int(self._previous[indices[-1]]))
        points: Floats = self._points[indices[::-1]]
        return points
