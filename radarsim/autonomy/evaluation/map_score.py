"""Scores of maps against the ground truth of the scene.

Theory of operation
===================
The scene is sliced at the sensor's height and rasterised to the cells of the map. The
class of a cell is right if the scene has that class within two cells, since a radar's
side rays see objects that far off their beam. The class free is wrong if the cell is
farther than two cells inside an object.

Coverage is computed for the floor around the robot's start. Only floor enclosed by
walls counts, split into the reachable part and the rest. A block of walls that is
closed on all sides is not floor, unless the robot is in it.
"""

import math
from typing import Any, Final, Literal, TypeAlias

import numpy as np
import shapely
from shapely import MultiPoint, Point, Polygon

from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.occupancy_grid import (
    CellClass,
    GridFrame,
    Mask,
    OccupancyGrid,
    distance_field,
)
from radarsim.autonomy.navigation.grid_search import flood_fill
from radarsim.geometry import Floats
from radarsim.presets.robots import load_robot
from radarsim.robots.obstacles import slice_mesh
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.simulation.map_warnings import Position, free_space

Score: TypeAlias = dict[str, Any]  # values by name, see ``score_map``

_SAMPLES: Final = 4  # sample points on a line for each cell
TOLERANCE: Final = 2  # cells that a map cell may be away from the true object
BESIDE: Final = 0.5  # cells of tolerance, so that diagonal neighbours count
MISPLACED: Final = 0.15  # m; obstacles farther from all true obstacles are misplaced


class Truth:
    """The true objects of a scene, rasterised to the cells of a grid.

    Attributes:
        frame: The grid.
        kinds: Cells with obstacle, foliage and smoke, each (R, C); a cell may belong to
            several kinds.
        inside: Cells inside objects of each kind, (R, C).
        indoors: Cells that walls enclose and that are not solid, (R, C).
    """

    def __init__(self, scene: Scene, frame: GridFrame, height: float) -> None:
        """Slice and rasterise a scene.

        Args:
            scene: The map.
            frame: The grid.
            height: Height of the sensor in the map frame, m.
        """
        self.frame = frame
        self.kinds = {
            kind: np.zeros(frame.shape, np.bool_)
            for kind in (CellClass.OBSTACLE, CellClass.FOLIAGE, CellClass.SMOKE)
        }
        self.inside = {kind: cells.copy() for kind, cells in self.kinds.items()}
        starts = MultiPoint([(start.pose.x, start.pose.y) for start in scene.starts])
        for part in scene.parts:
            segments = slice_mesh(part.vertices, part.faces, height)
            if len(segments):
                kind = class_of(part.material)
                filled = _filled(part, segments, starts, frame)
                self.inside[kind] |= filled
                self.kinds[kind] |= filled | _drawn(segments, frame)
        # Cells are indoors if a flood fill from outside does not reach them after
        # openings of one cell are closed. The padding connects all outdoor cells.
        walls = np.pad(self.kinds[CellClass.OBSTACLE], 1)
        near = np.isfinite(distance_field(walls, 1.0))
        outdoors = np.isfinite(distance_field(flood_fill(~near, (0, 0)), 1.5))
        self.indoors: Mask = (~outdoors & ~walls)[1:-1, 1:-1]

    def anything(self) -> Mask:
        """Return the cells with an object of any kind, (R, C)."""
        return np.asarray(np.any(list(self.kinds.values()), axis=0))

    def indoors_around(self, place: Position) -> Mask:
        """Return the indoor cells that are connected with a position, (R, C).

        Empty if the position is outdoors. Openings of less than three cells are closed.
        """
        cell = self.frame.cell(*place)
        if cell is None or not self.indoors[cell]:
            return np.zeros(self.frame.shape, np.bool_)
        walls = self.kinds[CellClass.OBSTACLE]
        is_near = np.isfinite(distance_field(walls, 1.0))
        inner = flood_fill(self.indoors & ~is_near, cell)
        around = np.isfinite(distance_field(inner, 1.5))
        return np.asarray(around & self.indoors)

    def faces(self, *, outdoors: bool) -> Mask:
        """Return the cells with foliage or a visible surface of an obstacle, (R, C).

        Args:
            outdoors: Whether the outer surfaces of walls count, too.
        """
        solid = self.kinds[CellClass.OBSTACLE]
        near = distance_field(~solid if outdoors else self.indoors, 1.5)
        return np.asarray((solid & np.isfinite(near)) | self.kinds[CellClass.FOLIAGE])


def class_of(material: Material) -> CellClass:
    """Return the class that cells of a material should have on a map."""
    if not material.solid:
        return CellClass.SMOKE
    return CellClass.FOLIAGE if material.lets_beams_in else CellClass.OBSTACLE


def _filled(part: Part, segments: Floats, starts: Any, frame: GridFrame) -> Mask:
    """Return the cells inside a part, unless it encloses a start, as rooms do."""
    if part.material.sheet_loss is not None:
        return np.zeros(frame.shape, np.bool_)
    # Points are rounded to a micrometre, since the ends
    # of lines in a polygon have to be exactly equal.
    lines = shapely.linestrings(np.round(segments, 6))
    # A mesh may intersect itself, so lines are split where they cross.
    areas = shapely.get_parts(shapely.polygonize([shapely.union_all(lines)]))
    if class_of(part.material) == CellClass.OBSTACLE:
        areas = areas[~shapely.intersects(areas, starts)]
    return covered_cells(shapely.union_all(areas), frame)


def covered_cells(area: Any, frame: GridFrame) -> Mask:
    """Return the cells whose centres are in a shapely geometry, (R, C)."""
    covered = np.zeros(frame.shape, np.bool_)
    if shapely.is_empty(area):
        return covered
    across, up = frame.cell_centers()
    west, south, east, north = shapely.bounds(area)
    columns = slice(*np.searchsorted(across, (west, east)))
    rows = slice(*np.searchsorted(up, (south, north)))
    x, y = np.meshgrid(across[columns], up[rows])
    shapely.prepare(area)
    covered[rows, columns] = shapely.contains_xy(area, x, y)
    return covered


def _drawn(segments: Floats, frame: GridFrame) -> Mask:
    starts, spans = segments[:, 0], segments[:, 1] - segments[:, 0]
    lengths = np.hypot(*spans.T) / frame.resolution
    # There is a point every quarter of a cell. A line that only touches the corner of a
    # cell may miss the cell, which is far below the tolerance of scores.
    counts = np.ceil(lengths * _SAMPLES).astype(np.int64) + 2
    which = np.repeat(np.arange(len(segments)), counts)
    number = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    along = number / (counts[which] - 1)
    places = starts[which] + along[:, None] * spans[which]
    cells = np.floor(places / frame.resolution).astype(np.int64)
    columns, rows = cells[:, 0] - frame.column, cells[:, 1] - frame.row
    drawn = np.zeros(frame.shape, np.bool_)
    drawn[rows, columns] = True
    return drawn


def find_floor(
    truth: Truth, scene: Scene, *, start: Position, robot_radius: float
) -> dict[str, Mask]:
    """Find the floor cells around a robot's start; none if the start is outdoors.

    Args:
        truth: The ground truth in the cells of a map.
        scene: The scene of that ground truth.
        start: Start of the robot, m.
        robot_radius: Half the diagonal of the robot, m.

    Returns:
        Masks, (R, C): ``indoors``, between the walls around the start, also under
        foliage and smoke; in it ``free``, without any object; in that ``reachable``,
        covered by the robot wherever it can drive, and ``hidden``, where the robot
        would fit but that it cannot reach.
    """
    indoors = truth.indoors_around(start)
    free = indoors & ~truth.anything()
    pieces = list(free_space(scene, robot_radius, places=[start]).geoms)
    # If the robot starts at a wall, its centre may be
    # outside the free space, so the nearest piece is used.
    home = min(pieces, key=Point(start).distance, default=None)
    if home is not None and home.distance(Point(start)) > robot_radius:
        home = None
    others = [piece for piece in pieces if piece is not home]
    within_reach = Polygon() if home is None else home.buffer(robot_radius)
    areas = {"reachable": within_reach, "hidden": shapely.union_all(others)}
    covered = {name: covered_cells(area, truth.frame) for name, area in areas.items()}
    parts = {name: np.asarray(free & cells) for name, cells in covered.items()}
    return {"indoors": indoors, "free": free, **parts}


class FloorPart:
    """The cells of the reachable part or of the hidden part of the free floor.

    ``reachable_coverage`` and ``hidden_coverage`` of a score count these cells, which
    are computed once for many maps.
    """

    def __init__(
        self,
        part: Literal["reachable", "hidden"],
        mapper: Mapper,
        scene: Scene,
        robot_class: str,
        start: Position,
    ) -> None:
        """Find the floor cells of this part.

        Args:
            part: Which part of the floor.
            mapper: The mapper whose maps are scored.
            scene: The mapped scene.
            robot_class: Class of the robot.
            start: Start of the robot, m.
        """
        radius, height = robot_and_sensor(mapper, scene, robot_class, start)
        frame = _with_scene(GridFrame(mapper.grid.frame.resolution), scene)
        truth = Truth(scene, frame, height)
        floor = find_floor(truth, scene, start=start, robot_radius=radius)
        rows, columns = np.nonzero(floor[part])
        self._rows, self._columns = rows + frame.row, columns + frame.column

    def coverage(self, grid: OccupancyGrid) -> float:
        """Return the share of these cells that a map shows as sensed; nan if none."""
        if not len(self._rows):
            return math.nan
        rows, columns = self._rows - grid.frame.row, self._columns - grid.frame.column
        inside = (rows >= 0) & (rows < grid.frame.rows)
        inside &= (columns >= 0) & (columns < grid.frame.columns)
        sensed = grid.sensed_cells()[rows[inside], columns[inside]]
        return float(np.count_nonzero(sensed)) / len(rows)


def _with_scene(frame: GridFrame, scene: Scene) -> GridFrame:
    """Return the frame of a map, extended so that it contains the whole scene."""
    (west, south), (east, north) = scene.bounds[:, :2].tolist()
    return frame.extended_to((west, south), (east, north))


def score_map(
    grid: OccupancyGrid,
    scene: Scene,
    start: Position,
    robot_radius: float,
    height: float,
) -> Score:
    """Return scores that compare a map with the ground truth of its scene.

    Args:
        grid: The map.
        scene: The mapped scene.
        start: Start of the robot, m.
        robot_radius: Half the diagonal of the robot, m.
        height: Height of the sensor in the map frame, m.

    Returns:
        right: Number of known cells with the right class.
        wrong: Number of known cells with a wrong class.
        unknown: Number of floor cells, bare or under foliage or smoke, that no beam has
            crossed; None where no walls enclose the start.
        coverage: Known share of the free floor; None as above.
        near_coverage: Share of the free floor seen at short range; None as above.
        reachable_coverage: Known share of the reachable part of the free floor; None as
            above.
        hidden_coverage: Known share of the part that the robot cannot reach; None if
            there is no such part.
        obstacles: Number of cells classified as obstacle.
        within_one_cell: Share of ``obstacles`` with a solid surface, or foliage, in the
            same or an adjacent cell; None without ``obstacles``.
        within_two_cells: The same share within two cells.
        false_obstacles: Number of ``obstacles`` farther from any solid object, per
            known cell that is empty.
        misplaced: Share of ``obstacles`` more than 15 cm from any solid object, for
            example from a wall that is on the map twice; None without ``obstacles``.
        told_apart: Share of the obstacle and foliage cells near an object of their own
            class; cells near neither class are skipped. None if no cell is left.
    """
    # The frame covers the whole scene, since floor
    # that was never sensed lowers the score.
    frame = _with_scene(grid.frame, scene)
    truth = Truth(scene, frame, height)
    classes = grid.frame.copy_into(grid.classes(), frame)
    near = grid.frame.copy_into(grid.short_range_cells(), frame)
    solid = truth.kinds[CellClass.OBSTACLE] | truth.kinds[CellClass.FOLIAGE]
    smoke = truth.kinds[CellClass.SMOKE]
    blocked = (classes == CellClass.OBSTACLE) | (classes == CellClass.FOLIAGE)
    # A radar with side rays sees objects up to two cells off its beam. So free cells
    # count as wrong only if they are more than two cells inside an object.
    right = blocked & (_distances(solid) <= TOLERANCE + BESIDE)
    right |= (classes == CellClass.SMOKE) & (_distances(smoke) <= TOLERANCE + BESIDE)
    inside = np.any(list(truth.inside.values()), axis=0)
    right |= (classes == CellClass.FREE) & np.isfinite(_distances(~inside))
    known = classes != CellClass.UNKNOWN
    floor = find_floor(truth, scene, start=start, robot_radius=robot_radius)
    is_outdoors = not floor["indoors"].any()
    unknown = int(np.count_nonzero(floor["indoors"] & ~known))
    walls = classes == CellClass.OBSTACLE
    faces = _distances(truth.faces(outdoors=is_outdoors))[walls]
    false = int(np.count_nonzero(np.isinf(_distances(solid)[walls])))
    misplaced = np.isinf(distance_field(solid, MISPLACED / frame.resolution))[walls]
    air = int(np.count_nonzero(known & ~truth.anything()))
    return {
        "right": int(np.count_nonzero(known & right)),
        "wrong": int(np.count_nonzero(known & ~right)),
        "unknown": None if is_outdoors else unknown,
        "coverage": _mean(known[floor["free"]]),
        "near_coverage": _mean(near[floor["free"]]),
        "reachable_coverage": _mean(known[floor["reachable"]]),
        "hidden_coverage": _mean(known[floor["hidden"]]),
        "obstacles": len(faces),
        "within_one_cell": _mean(faces <= 1 + BESIDE),
        "within_two_cells": _mean(faces <= 2 + BESIDE),
        "false_obstacles": false / max(air, 1),
        "misplaced": _mean(misplaced),
        "told_apart": _class_accuracy(classes, truth),
    }


def robot_and_sensor(
    mapper: Mapper, scene: Scene, robot_class: str, start: Position
) -> tuple[float, float]:
    """Return half the diagonal of a robot and the height of its scanner on the map, m.

    Args:
        mapper: The mapper of the scanner.
        scene: The mapped scene.
        robot_class: Class of the robot.
        start: Start of the robot, m.
    """
    robot = load_robot(robot_class)
    above = robot.origin_height + mapper.scanner.mount.z
    radius = math.hypot(robot.length, robot.width) / 2
    return radius, scene.floor_at(*start) + above


def _class_accuracy(classes: Any, truth: Truth) -> float | None:
    # Cells near both an obstacle and foliage always count as right in either class.
    matches: list[Any] = []
    for kind, other in (
        (CellClass.OBSTACLE, CellClass.FOLIAGE),
        (CellClass.FOLIAGE, CellClass.OBSTACLE),
    ):
        cells = classes == kind
        same = _distances(truth.kinds[kind])[cells] <= TOLERANCE + BESIDE
        neither = _distances(truth.kinds[other])[cells] > TOLERANCE + BESIDE
        matches.append(same[same | ~neither])
    return _mean(np.concatenate(matches))


def _distances(cells: Mask) -> Floats:
    """Return each cell's distance to the nearest given cell, in cells; inf if far."""
    return distance_field(cells, TOLERANCE + BESIDE)


def _mean(values: Any) -> float | None:
    return float(np.mean(values)) if len(values) else None
