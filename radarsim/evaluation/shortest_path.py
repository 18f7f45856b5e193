"""The shortest path on the map, as nobody knows it who has to find the way.

Theory of operation
===================
A shortest path among obstacles is a chain of straight lines between corners of the
obstacles that it bends around (the visibility graph), here of the solid things grown by
the clearance, whose round corners are chords. A* walks that graph and asks what can be
seen only from those corners that it gets to, and only along lines that could be part
of a shortest path: such a line passes both of its corners without cutting into the
obstacle just before or behind.
"""

import heapq
import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.polygon import orient

from radarsim.evaluation.free_space import Place, component_around, free_space
from radarsim.geometry import Floats
from radarsim.scene.scene import Scene

_SLACK = 1e-6  # m; a path may come so much nearer than the clearance


def shortest_path(
    scene: Scene, start: Place, goal: Place, clearance: float
) -> tuple[float, Floats] | None:
    """Find the shortest path of a disc.

    Args:
        scene: Where it is to go.
        start: Where its centre is, m.
        goal: Where its centre is to get to, m.
        clearance: Its radius, m.

    Returns:
        The length, m, and the points where it bends, (N, 2) m, both ends among them.
        None if there is no path. It is less than 0.1 % shorter than the exact one.
    """
    around = free_space(scene, clearance, places=(start, goal))
    piece = component_around(around, start)
    if piece is None or not piece.intersects(shapely.Point(goal)):
        return None
    free = piece.buffer(_SLACK, join_style="mitre")
    return _Search(_corners(piece, start, goal), free).path()


@dataclass(frozen=True)
class _Corners:
    """The start, the goal, and then the corners that a path may bend around.

    Attributes:
        places: (N, 2) m.
        before: (N, 2) m, from each of them to the one before on its boundary; 0 for
            start and goal.
        behind: The same to the one behind.
    """

    places: Floats
    before: Floats
    behind: Floats

    def passed(self, lines: Floats, which: NDArray[np.intp] | int) -> NDArray[np.bool_]:
        """Tell which lines pass corners with the whole boundary on one side.

        Args:
            lines: (L, 2) m, their directions.
            which: The corner of each line, or that of all of them.
        """
        a, b = self.before[which], self.behind[which]
        before = lines[:, 0] * a[..., 1] - lines[:, 1] * a[..., 0]
        behind = lines[:, 0] * b[..., 1] - lines[:, 1] * b[..., 0]
        apart: NDArray[np.bool_] = (before * behind) >= -(_SLACK**2)
        return apart


def _corners(piece: Polygon, start: Place, goal: Place) -> _Corners:
    nothing = np.zeros((2, 2))
    rows = [(np.array([start, goal]), nothing, nothing)]
    for ring in shapely.get_rings(orient(piece)):
        here = shapely.get_coordinates(ring)[:-1]  # what is free is on the left
        before, behind = (
            np.roll(here, 1, axis=0) - here,
            np.roll(here, -1, axis=0) - here,
        )
        bends = before[:, 0] * behind[:, 1] - before[:, 1] * behind[:, 0] > 0
        rows.append((here[bends], before[bends], behind[bends]))
    places, before, behind = (np.concatenate(row) for row in zip(*rows, strict=True))
    return _Corners(places, before, behind)


class _Search:
    """A* from corner 0 to corner 1."""

    def __init__(self, corners: _Corners, free: Polygon) -> None:
        self._corners = corners
        self._free = free
        shapely.prepare(free)
        self._left = np.hypot(*(corners.places - corners.places[1]).T)
        self._lengths = np.full(len(corners.places), math.inf)
        self._lengths[0] = 0.0
        self._from = np.zeros(len(corners.places), dtype=np.intp)

    def path(self) -> tuple[float, Floats] | None:
        """Give the length and the points of the shortest path; None without one."""
        queue = [(float(self._left[0]), 0)]
        done: set[int] = set()
        while queue:
            _, here = heapq.heappop(queue)
            if here == 1:
                return float(self._lengths[1]), self._points()
            if here in done:
                continue
            done.add(here)
            for there in self._step(here).tolist():
                total = float(self._lengths[there] + self._left[there])
                heapq.heappush(queue, (total, there))
        return None

    def _step(self, here: int) -> NDArray[np.intp]:
        """Go on to all that is seen from a corner and is not reached sooner."""
        lines = self._corners.places - self._corners.places[here]
        lengths = self._lengths[here] + np.hypot(*lines.T)
        (there,) = np.nonzero(lengths < self._lengths)
        there = there[self._corners.passed(lines[there], here)]
        there = there[self._corners.passed(lines[there], there)]
        ends = self._corners.places[there]
        starts = np.broadcast_to(self._corners.places[here], ends.shape)
        sights = shapely.linestrings(np.stack([starts, ends], axis=1))
        seen: NDArray[np.intp] = there[shapely.covers(self._free, sights)]
        self._lengths[seen] = lengths[seen]
        self._from[seen] = here
        return seen

    def _points(self) -> Floats:
        way = [1]
        while way[-1] != 0:
            way.append(int(self._from[way[-1]]))
        points: Floats = self._corners.places[way[::-1]]
        return points
