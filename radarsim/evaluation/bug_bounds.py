"""How long the way of a bug may be, and how short it could have been.

Theory of operation
===================
A bug that keeps Choset's rules goes at most D + 1.5 p1 + 1.5 p2 + ... with Bug1, where
D is the distance from start to goal and each p is the perimeter of an obstacle that it
can meet, and D + n1 p1 / 2 + n2 p2 / 2 + ... with Bug2, where each n counts how often
the line from start to goal crosses that perimeter. Where n is odd, the obstacle is
around the goal, and Bug2 goes all round it once more than the n that come in pairs say.

A bug that keeps away from obstacles goes round grown ones. The boundaries of the place
where it starts are those that it can meet: from inside of a room that is the wall that
it looks at, and not the outside of the house.

Source: H. Choset et al., Principles of Robot Motion, MIT Press 2005, chapter 2.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import shapely
from shapely import LinearRing, LineString, Point, Polygon

from radarsim.evaluation.free_space import (
    Place,
    component_around,
    free_space,
    is_connected,
)
from radarsim.evaluation.shortest_path import shortest_path
from radarsim.scene.scene import Scene

__all__ = [
    "Boundary",
    "BugBounds",
    "Place",
    "bug_bounds",
    "free_space",
    "is_connected",
    "shortest_path",
]

PRESSED = 0.5  # m beyond the safety distance at which a bug takes to a boundary


@dataclass(frozen=True, slots=True)
class Boundary:
    """A boundary that a bug can meet.

    Attributes:
        perimeter: m.
        crossings: How often the line from start to goal crosses it.
    """

    perimeter: float
    crossings: int


@dataclass(frozen=True, slots=True)
class BugBounds:
    """The longest ways that bugs may go.

    Attributes:
        direct: Distance from start to goal, m.
        boundaries: Those no farther from the goal than the start is.
    """

    direct: float
    boundaries: tuple[Boundary, ...]

    @property
    def bug1(self) -> float:
        """Of Bug1, m."""
        return self.direct + 1.5 * sum(each.perimeter for each in self.boundaries)

    @property
    def bug2(self) -> float:
        """Of Bug2, m."""
        rounds = (
            (each.crossings + 1) // 2 * each.perimeter for each in self.boundaries
        )
        return self.direct + sum(rounds)


def bug_bounds(
    scene: Scene, start: Place, goal: Place, safety_distance: float
) -> BugBounds:
    """Find out how far a bug may go that presses its bumpers as a rule.

    Args:
        scene: Where it goes. The passages that it is to use are wider than twice the
            safety distance and 1 m.
        start: Where it sets out, m.
        goal: Where it is to go, m.
        safety_distance: m; obstacles are grown by it and 0.5 m.

    Raises:
        ValueError: If the start is nearer than the safety distance to something, or
            everything is within 0.5 m more of something where it gets to from there.
    """
    ends = (start, goal)
    home = component_around(free_space(scene, safety_distance, places=ends), start)
    pressed = safety_distance + PRESSED
    free = free_space(scene, pressed, places=ends)
    rooms = [room for room in free.geoms if home is not None and room.intersects(home)]
    if not rooms:
        expected = f"expected a place {pressed:g} m from everything that it gets to"
        raise ValueError(f"start {start}, {expected}")
    # a start that is a little nearer to something belongs to the nearest of them
    piece = min(rooms, key=Point(start).distance)
    direct = math.dist(start, goal)
    line = LineString([start, goal])
    boundaries = tuple(
        Boundary(ring.length, _crossings(ring, line))
        for ring in _boundaries(piece, free.envelope)
        if ring.distance(Point(goal)) <= direct
    )
    return BugBounds(direct, boundaries)


def _boundaries(piece: Polygon, floor: Polygon) -> Iterator[LinearRing]:
    """Give the rings around a piece that are not the end of the floor."""
    rings = shapely.get_rings(piece)
    yield from (ring for ring in rings if not ring.equals(floor.exterior))


def _crossings(ring: LinearRing, line: LineString) -> int:
    return len(shapely.get_coordinates(shapely.intersection(ring, line)))
