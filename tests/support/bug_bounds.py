"""Bounds of the path length of Bug1 and Bug2, as an oracle for their runs.

Theory of operation
===================
By Choset's rules Bug1 drives at most D + 1.5 p1 + 1.5 p2 + ..., where D is the distance
from start to goal and each p is the perimeter of an obstacle that it can meet, and Bug2
at most D + n1 p1 / 2 + n2 p2 / 2 + ..., where each n counts how often the line from
start to goal crosses that perimeter. Where n is odd, the obstacle encloses the goal,
and Bug2 drives around it once more than the crossings that come in pairs imply.

A bug that keeps a distance from obstacles drives around grown obstacles. It can meet
the boundaries of the free area that it starts in: inside a room that is the wall that
faces it, and not the outside of the house.

Source: H. Choset et al., Principles of Robot Motion, MIT Press 2005, chapter 2.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import shapely
from shapely import LinearRing, LineString, Point, Polygon

from radarsim.scene.scene import Scene
from radarsim.simulation.map_warnings import Position, component_around, free_space

PRESSED = 0.5  # m beyond the safety distance at which a bug follows a boundary


@dataclass(frozen=True, slots=True)
class Boundary:
    """A boundary that a bug can meet."""

    perimeter: float  # m
    crossings: int  # of the line from start to goal


@dataclass(frozen=True, slots=True)
class BugBounds:
    """Upper bounds of path lengths."""

    direct: float  # m from start to goal
    boundaries: tuple[Boundary, ...]  # no farther from the goal than the start

    @property
    def bug1(self) -> float:
        """Longest path of Bug1, m."""
        return self.direct + 1.5 * sum(each.perimeter for each in self.boundaries)

    @property
    def bug2(self) -> float:
        """Longest path of Bug2, m."""
        circuits = (
            (each.crossings + 1) // 2 * each.perimeter for each in self.boundaries
        )
        return self.direct + sum(circuits)


def bug_bounds(
    scene: Scene, start: Position, goal: Position, safety_distance: float
) -> BugBounds:
    """Compute bounds for a bug whose bumpers are pressed by a share of their beams."""
    ends = (start, goal)
    home = component_around(free_space(scene, safety_distance, places=ends), start)
    pressed = safety_distance + PRESSED
    free = free_space(scene, pressed, places=ends)
    pieces = [
        piece for piece in free.geoms if home is not None and piece.intersects(home)
    ]
    if not pieces:
        expected = f"expected a place {pressed:g} m from everything that it gets to"
        raise ValueError(f"start {start}, {expected}")
    # a start that is a little nearer to an obstacle belongs to the nearest of them
    piece = min(pieces, key=Point(start).distance)
    direct = math.dist(start, goal)
    line = LineString([start, goal])
    boundaries = tuple(
        Boundary(ring.length, _crossings(ring, line))
        for ring in _boundaries(piece, free.envelope)
        if ring.distance(Point(goal)) <= direct
    )
    return BugBounds(direct, boundaries)


def _boundaries(piece: Polygon, floor: Polygon) -> Iterator[LinearRing]:
    """Yield the rings of a piece that are not the edge of the floor."""
    rings = shapely.get_rings(piece)
    yield from (ring for ring in rings if not ring.equals(floor.exterior))


def _crossings(ring: LinearRing, line: LineString) -> int:
    return len(shapely.get_coordinates(shapely.intersection(ring, line)))
