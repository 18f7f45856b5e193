"""Warnings about valid maps: blocked starts, and trials that no robot can complete.

Free space is the floor that a robot can stand on, with its connected components.

Solid objects at a P3AT's height are grown by a distance, and the rest of the floor is
free. A single object that encloses an area, such as a box, a bush or a trunk, is solid
inside, unless a start is inside, which makes the area a room. Walls of several objects
do not enclose a solid area: the floor between four walls is free, but unreachable.
"""

import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import TypeAlias

import numpy as np
import shapely
from shapely import Geometry, MultiPoint, MultiPolygon, Point, Polygon

from radarsim.geometry import Floats, Pose2
from radarsim.presets.robots import load_robot
from radarsim.robots.footprint import NO_SEGMENTS
from radarsim.robots.obstacles import BUMPER_HEIGHTS, Obstacles, slice_mesh
from radarsim.scene.scene import Part, Scene
from radarsim.simulation.simulation import Simulation

Position: TypeAlias = tuple[float, float]  # x, y in m, map frame

QUARTER = 16  # chords per quarter circle, 0.04 % shorter than the arc
PLAN_HEIGHT = 0.35  # m above the floor; one of BUMPER_HEIGHTS, near a P3AT's scanner
_DIGITS = 6  # decimals of rounded end points, so that adjacent lines share them
_OUTSIDE = 10.0  # m of floor around the grown obstacles


def free_space(
    scene: Scene, distance: float, *, places: Sequence[Position] = ()
) -> MultiPolygon:
    """Return the floor that is at least a given distance from all solid objects.

    It ends 10 m outside of all objects; arcs around corners are approximated by chords.

    Args:
        scene: The map.
        distance: Distance from solid objects, m.
        places: Further positions that the floor must include, m.
    """
    solids = np.array(_solids(scene), dtype=object)
    grown = shapely.buffer(solids, distance, quad_segs=QUARTER)
    floor = shapely.box(*_extent(scene, places, distance + _OUTSIDE))
    free = shapely.difference(floor, shapely.union_all(grown))
    return MultiPolygon(shapely.get_parts(free).tolist())


def component_around(free: MultiPolygon, place: Position) -> Polygon | None:
    """Return the connected area that contains a position; None if there is none."""
    point = Point(place)
    return next((piece for piece in free.geoms if piece.intersects(point)), None)


def is_connected(
    scene: Scene, start: Position, goal: Position, distance: float
) -> bool:
    """Return whether a disc of radius ``distance``, m, can move from start to goal."""
    free = free_space(scene, distance, places=(start, goal))
    piece = component_around(free, start)
    return piece is not None and piece.intersects(Point(goal))


def plan_height(scene: Scene) -> float:
    """Return the height at which plans of a scene are drawn, m, map frame."""
    return _floor_of(scene) + PLAN_HEIGHT


def _floor_of(scene: Scene) -> float:
    """Return the height of the floor at the first start, m."""
    return scene.starts[0].pose.z if scene.starts else 0.0


def _extent(scene: Scene, places: Sequence[Position], margin: float) -> Floats:
    """Return the bounds of the scene plus a margin: min x, min y, max x, max y, m."""
    starts = [(start.pose.x, start.pose.y) for start in scene.starts]
    goals = [scene.trial.goal] if scene.trial else []
    origin = (0.0, 0.0)  # the start pose of a map without starts
    everything = [*_solids(scene), MultiPoint([origin, *starts, *goals, *places])]
    bounds: Floats = shapely.total_bounds(np.array(everything, dtype=object))
    return bounds + np.array([-1.0, -1.0, 1.0, 1.0]) * margin


@lru_cache(maxsize=8)
def _solids(scene: Scene) -> tuple[Geometry, ...]:
    """Return solid areas as polygons, and walls of rooms and open surfaces as lines."""
    floor = _floor_of(scene)
    starts = MultiPoint([(start.pose.x, start.pose.y) for start in scene.starts])
    return tuple(
        solid
        for part in scene.parts
        if part.material.solid
        for segments in _slices(part, floor)
        for solid in _solids_of(segments, starts)
    )


def _slices(part: Part, floor: float) -> Iterator[Floats]:
    """Yield slices of a part at the bumper heights, and skip repeated slices."""
    last = NO_SEGMENTS
    for height in BUMPER_HEIGHTS:
        segments = slice_mesh(part.vertices, part.faces, floor + height)
        segments = Obstacles(np.round(segments, _DIGITS)).segments  # without length 0
        if not np.array_equal(segments, last):
            yield segments
        last = segments


def _solids_of(segments: Floats, starts: MultiPoint) -> Iterator[Geometry]:
    """Yield closed areas without starts, and all lines if some bound no such area."""
    lines = shapely.linestrings(segments)
    areas, *rest = shapely.polygonize_full(lines)
    rooms = shapely.intersects(shapely.get_parts(areas), starts)
    yield from shapely.get_parts(areas)[~rooms]
    if rooms.any() or not all(shapely.is_empty(rest)):
        yield from lines


@lru_cache(maxsize=1)
def _simulation(scene: Scene) -> Simulation:
    """Return a simulation without robots; the cache avoids slicing walls again."""
    return Simulation(scene)


def occupied_starts(scene: Scene) -> list[str]:
    """Return a message for each start pose at which a P3AT cannot be spawned."""
    lines = []
    simulation = _simulation(scene)
    for start in scene.starts:
        wanted = Pose2(start.pose.x, start.pose.y, start.pose.yaw)
        model = load_robot("P3AT")
        vehicle = simulation.spawn("check", model, wanted)
        if vehicle is not None:
            simulation.remove(vehicle)  # robots must not occupy each other's starts
            if vehicle.robot.pose == wanted:
                continue
        in_way = simulation.obstacles_at(model, wanted)
        taken = f"{start.name}: occupied by {', '.join(in_way) or 'objects above'}"
        if vehicle is None:
            lines.append(f"{taken}; no free place for a P3AT within 1 m")
        else:
            pose = vehicle.robot.pose
            position = f"x {pose.x:.2f} m, y {pose.y:.2f} m"
            lines.append(f"{taken}; a P3AT would be placed at {position}")
    return lines


def trial_warnings(scene: Scene) -> list[str]:
    """Return a message for each reason why no robot can complete the map's trial."""
    trial = scene.trial
    if trial is None or (start := scene.start(trial.start)) is None:
        return []
    model, lines = load_robot("P3AT"), []
    clearance = math.hypot(model.length, model.width) / 2
    if trial.safety_distance < clearance:
        lines.append(f"a P3AT needs a safety distance of at least {clearance:.3f} m")
    goal = Pose2(*trial.goal)
    if in_way := _simulation(scene).obstacles_at(model, goal):
        lines.append(f"goal {goal.x:.2f} {goal.y:.2f}: occupied by {', '.join(in_way)}")
    position = start.pose.x, start.pose.y
    if not is_connected(scene, position, trial.goal, trial.safety_distance):
        distance = f"{trial.safety_distance:g} m from solid objects"
        lines.append(f"no path to the goal that keeps {distance}")
    return lines
