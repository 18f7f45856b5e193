"""What of the floor a robot may stand on, and which places belong together.

What is solid at a P3AT's height is grown by a distance, and the rest of the floor is
free. What encloses an area by itself is solid all through: a box, a bush, a trunk. An
area in which a robot starts is a room, and walls that are several objects enclose
nothing: the inside of a closed box of four walls is floor, though nothing gets there.
"""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import shapely
from shapely import Geometry, MultiPoint, MultiPolygon, Point, Polygon

from radarsim.geometry import Floats
from radarsim.robots.footprint import NO_SEGMENTS
from radarsim.robots.obstacles import BUMPER_HEIGHTS, Obstacles, slice_mesh, slice_parts
from radarsim.scene.scene import Part, Scene

Place: TypeAlias = tuple[float, float]  # x, y in m, map frame

QUARTER = 16  # chords for a quarter of a circle: 0.04 % shorter than the arc
PLAN_HEIGHT = 0.35  # m above the floor; that of a P3AT's scanner, and it bumps there
_DIGITS = 6  # to which ends of lines are rounded, so that those that meet are the same
_OUTSIDE = 10.0  # m of floor around what is grown


def free_space(
    scene: Scene, distance: float, *, places: Sequence[Place] = ()
) -> MultiPolygon:
    """Give the floor that is at least some distance away from all that is solid.

    It ends 10 m outside of everything, and round corners of what is solid are chords.

    Args:
        scene: What there is.
        distance: m.
        places: More places, m, that are to be inside of its end.
    """
    solids = np.array(_solids(scene), dtype=object)
    grown = shapely.buffer(solids, distance, quad_segs=QUARTER)
    floor = shapely.box(*_extent(scene, places, distance + _OUTSIDE))
    free = shapely.difference(floor, shapely.union_all(grown))
    return MultiPolygon(shapely.get_parts(free).tolist())


def component_around(free: MultiPolygon, place: Place) -> Polygon | None:
    """Give the piece that a place is in; None if it is in none of them."""
    point = Point(place)
    return next((piece for piece in free.geoms if piece.intersects(point)), None)


def is_connected(scene: Scene, start: Place, goal: Place, distance: float) -> bool:
    """Tell whether one gets from place to place always so far from what is solid, m."""
    free = free_space(scene, distance, places=(start, goal))
    piece = component_around(free, start)
    return piece is not None and piece.intersects(Point(goal))


def floor_plan(scene: Scene) -> Floats:
    """Give the lines of what is solid where robots bump into it, (S, 2, 2) m."""
    solid = (part for part in scene.parts if part.material.solid)
    return slice_parts(solid, _floor_of(scene) + PLAN_HEIGHT)


def _floor_of(scene: Scene) -> float:
    """Give the height of the floor that robots start on, m."""
    return scene.starts[0].pose.z if scene.starts else 0.0


def _extent(scene: Scene, places: Sequence[Place], beyond: float) -> Floats:
    """Give the lower and upper x, y of all that there is, and m beyond, (4,)."""
    starts = [(start.pose.x, start.pose.y) for start in scene.starts]
    goals = [scene.trial.goal] if scene.trial else []
    origin = (0.0, 0.0)  # where robots start if there is no start
    everything = [*_solids(scene), MultiPoint([origin, *starts, *goals, *places])]
    bounds: Floats = shapely.total_bounds(np.array(everything, dtype=object))
    return bounds + np.array([-1.0, -1.0, 1.0, 1.0]) * beyond


@lru_cache(maxsize=8)
def _solids(scene: Scene) -> tuple[Geometry, ...]:
    """Give what robots cannot be in: areas, and lines of open surfaces and rooms."""
    floor = _floor_of(scene)
    starts = MultiPoint([(start.pose.x, start.pose.y) for start in scene.starts])
    return tuple(
        solid
        for part in scene.parts
        if part.material.solid
        for segments in _sections(part, floor)
        for solid in _solids_of(segments, starts)
    )


def _sections(part: Part, floor: float) -> Iterator[Floats]:
    """Cut a part at the bumpers' heights; upright sides give their lines once."""
    last = NO_SEGMENTS
    for height in BUMPER_HEIGHTS:
        segments = slice_mesh(part.vertices, part.faces, floor + height)
        segments = Obstacles(np.round(segments, _DIGITS)).segments  # no mere points
        if not np.array_equal(segments, last):
            yield segments
        last = segments


def _solids_of(segments: Floats, starts: MultiPoint) -> Iterator[Geometry]:
    """Give the areas that lines enclose; the lines, if they enclose a room or none."""
    lines = shapely.linestrings(segments)
    areas, *rest = shapely.polygonize_full(lines)
    rooms = shapely.intersects(shapely.get_parts(areas), starts)
    yield from shapely.get_parts(areas)[~rooms]
    if rooms.any() or not all(shapely.is_empty(rest)):
        yield from lines
