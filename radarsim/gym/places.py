"""Random starts and goals on the floor that robots can get to."""

from collections.abc import Sequence
from typing import Final

import numpy as np
import shapely
from shapely import MultiPolygon, Polygon

from radarsim.evaluation.free_space import Position, component_around, free_space
from radarsim.scene.scene import Scene

_DRAWN_TOGETHER: Final = 16  # places, of which the first that is free is taken
_MAX_DRAWS: Final = 1000  # of so many places


class FreePlaces:
    """The floor on which a robot fits in every direction, by connected pieces.

    These are the pieces in which the map's starts are, or that around the origin of a
    map without starts: the floor outside a room's walls is none of them.
    """

    def __init__(self, scene: Scene, clearance: float) -> None:
        """Find the free floor.

        Args:
            scene: The map.
            clearance: Distance that places have from everything solid, m.

        Raises:
            ValueError: If no start of the map is on free floor.
        """
        free = free_space(scene, clearance)
        starts = [(start.pose.x, start.pose.y) for start in scene.starts]
        found = [component_around(free, place) for place in starts or [(0.0, 0.0)]]
        pieces = {piece.wkb: piece for piece in found if piece is not None}
        if not pieces:
            raise ValueError(
                f"map {scene.name!r}: no start has {clearance:.2f} m of free floor"
                " around it, expected one at least"
            )
        self._pieces = tuple(pieces.values())
        self._floor = MultiPolygon(self._pieces)
        shapely.prepare([self._floor, *self._pieces])

    def draw(
        self,
        rng: np.random.Generator,
        others: Sequence[Position] = (),
        distance: float = 0.0,
    ) -> Position:
        """Draw a place, uniformly distributed over the floor; x and y, m.

        Args:
            rng: Source of randomness.
            others: Places that it is not to be near, m.
            distance: Least distance from these, m.

        Raises:
            ValueError: If there is hardly such a place.
        """
        return _draw(self._floor, rng, others, distance)

    def draw_goal(
        self, rng: np.random.Generator, start: Position, distance: float
    ) -> Position:
        """Draw a place that can be reached from another; arguments as of ``draw``."""
        point = shapely.Point(start)
        piece = next((p for p in self._pieces if p.covers(point)), self._floor)
        return _draw(piece, rng, [start], distance)


def _draw(
    floor: Polygon | MultiPolygon,
    rng: np.random.Generator,
    others: Sequence[Position],
    distance: float,
) -> Position:
    low, high = np.reshape(floor.bounds, (2, 2))
    near = np.reshape(others, (-1, 1, 2))
    for _ in range(_MAX_DRAWS):
        places = rng.uniform(low, high, (_DRAWN_TOGETHER, 2))
        gaps = np.hypot(*np.moveaxis(places - near, -1, 0))
        is_free = shapely.contains_xy(floor, *places.T) & (gaps >= distance).all(axis=0)
        if is_free.any():
            x, y = places[is_free.argmax()].tolist()
            return x, y
    raise ValueError(
        f"no free place {distance:g} m from {len(others)} others among"
        f" {_MAX_DRAWS * _DRAWN_TOGETHER} that were drawn"
    )
