"""Scores of maps by the ground truth of the scene.

Theory of operation
===================
The scene is sliced at the sensor's height and rasterised to the cells of the map. A
cell's class is right if something of that class is within two cells, since a radar's
side rays see objects that far aside. The class free is wrong if the cell is deeper than
that inside of an object.

Only the floor that walls enclose counts as floor that could be known. Its hidden part
is what the robot cannot reach from its start.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import shapely
from shapely import MultiPoint

from radarsim.evaluation.free_space import Position, component_around, free_space
from radarsim.geometry import Floats, Pose2
from radarsim.mapping.distance_field import distance_field
from radarsim.mapping.mapper import Mapper
from radarsim.mapping.occupancy_grid import (
    CellClass,
    GridFrame,
    Mask,
    OccupancyGrid,
)
from radarsim.navigation.grid_path import flood_fill
from radarsim.presets.robots import load_robot
from radarsim.robots.obstacles import slice_mesh
from radarsim.scene.scene import Part, Scene

TOLERANCE: Final = 2  # cells
BESIDE: Final = 0.5  # cells more, so that corners of a cell count as beside it
_SAMPLES: Final = 4  # along a line, for each cell


@dataclass(frozen=True, slots=True)
class MapScore:
    """The score of a map, in cells.

    Attributes:
        right: Number of known cells with the right class.
        wrong: Number of known cells with a wrong class.
        unknown: Number of cells of floor, bare or under foliage or smoke, that no beam
            has crossed; None where no walls enclose the start.
        coverage: Share of the free floor that is known; None as above.
        near_coverage: Share of it that was seen at short range; None as above.
        hidden_coverage: Known share of the part that the robot cannot reach; None if
            there is no such part.
        obstacles: Number of cells classified as obstacle.
        within_one_cell: Share of ``obstacles`` with a solid surface, or foliage, in the
            cell itself or beside it; None if there are none.
        within_two_cells: The same with one cell more.
        false_obstacles: Number of ``obstacles`` farther from everything solid, per
            known cell that is empty.
        class_accuracy: Share of the obstacle and foliage cells near something of their
            own class; cells near neither class do not count. None if none is left.
    """

    right: int
    wrong: int
    unknown: int | None
    coverage: float | None
    near_coverage: float | None
    hidden_coverage: float | None
    obstacles: int
    within_one_cell: float | None
    within_two_cells: float | None
    false_obstacles: float
    class_accuracy: float | None

    def to_dict(self) -> dict[str, Any]:
        """Return the score for JSON, with shares rounded to four digits."""
        rounded = {
            key: round(value, 4) if isinstance(value, float) else value
            for key, value in asdict(self).items()
        }
        rounded["told_apart"] = rounded.pop("class_accuracy")
        return rounded


class Truth:
    """The ground truth, rasterised to the cells of a grid.

    Attributes:
        kinds: Cells with obstacle, foliage and smoke, each (R, C); where two meet, a
            cell has both.
        inside: Cells that are inside of each kind, (R, C).
        indoors: Cells that walls enclose and that are not solid, (R, C).
    """

    def __init__(self, scene: Scene, frame: GridFrame, height: float) -> None:
        """Slice and rasterise a scene.

        Args:
            scene: The map.
            frame: The grid.
            height: Height of the sensor in the map frame, m.
        """
        self.kinds = {
            kind: np.zeros(frame.shape, np.bool_)
            for kind in (CellClass.OBSTACLE, CellClass.FOLIAGE, CellClass.SMOKE)
        }
        self.inside = {kind: cells.copy() for kind, cells in self.kinds.items()}
        starts = MultiPoint([(start.pose.x, start.pose.y) for start in scene.starts])
        for part in scene.parts:
            segments = slice_mesh(part.vertices, part.faces, height)
            if len(segments):
                kind = class_of(part)
                filled = _filled(part, segments, starts, frame)
                self.inside[kind] |= filled
                self.kinds[kind] |= filled | _drawn(segments, frame)
        self.indoors = self._enclosed()

    def anything(self) -> Mask:
        """Return the cells with anything in them, (R, C)."""
        return np.asarray(np.any(list(self.kinds.values()), axis=0))

    def free(self) -> Mask:
        """Return the empty indoor cells, (R, C)."""
        return np.asarray(self.indoors & ~self.anything())

    def faces(self, *, outdoors: bool) -> Mask:
        """Return the cells with exposed obstacle surfaces, and with foliage, (R, C).

        Args:
            outdoors: Whether surfaces that face the outside of walls count too.
        """
        solid = self.kinds[CellClass.OBSTACLE]
        beside = distance_field(~solid if outdoors else self.indoors, 1.5)
        return np.asarray((solid & np.isfinite(beside)) | self.kinds[CellClass.FOLIAGE])

    def _enclosed(self) -> Mask:
        walls = np.pad(self.kinds[CellClass.OBSTACLE], 1)
        near = np.isfinite(distance_field(walls, 1.0))
        outdoors = flood_fill(~near, (0, 0))
        outdoors = np.isfinite(distance_field(outdoors, 1.5))
        return np.asarray(~outdoors & ~walls)[1:-1, 1:-1]


def class_of(part: Part) -> CellClass:
    """Return the class that a part should have on a map."""
    material = part.material
    if not material.solid:
        return CellClass.SMOKE
    seen_through = material.penetrable or material.sheet_loss is not None
    return CellClass.FOLIAGE if seen_through else CellClass.OBSTACLE


def score_map(
    grid: OccupancyGrid,
    scene: Scene,
    *,
    start: Position,
    robot_radius: float,
    height: float,
) -> MapScore:
    """Score a map.

    Args:
        grid: The map.
        scene: The mapped scene.
        start: Start of the robot, m.
        robot_radius: Half the diagonal of the robot, m.
        height: Height of its sensor in the map frame, m.
    """
    frame = _around(grid.frame, scene)
    truth = Truth(scene, frame, height)
    classes = grid.frame.copy_into(grid.classes(), frame)
    near = grid.frame.copy_into(grid.short_range_cells(), frame)
    right = _is_right(classes, truth)
    known = classes != CellClass.UNKNOWN
    indoors = truth.indoors if _is_inside(truth.indoors, frame, start) else None
    free = truth.free()
    hidden = free & unreachable_floor(scene, frame, start, robot_radius)
    walls = classes == CellClass.OBSTACLE
    away = _distances(truth.faces(outdoors=indoors is None))[walls]
    astray = _distances(
        truth.kinds[CellClass.OBSTACLE] | truth.kinds[CellClass.FOLIAGE]
    )[walls]
    false = int(np.count_nonzero(np.isinf(astray)))
    air = int(np.count_nonzero(known & ~truth.anything()))
    return MapScore(
        right=int(np.count_nonzero(known & right)),
        wrong=int(np.count_nonzero(known & ~right)),
        unknown=None if indoors is None else int(np.count_nonzero(indoors & ~known)),
        coverage=None if indoors is None else _share(known, free),
        near_coverage=None if indoors is None else _share(near, free),
        hidden_coverage=_share(known, hidden),
        obstacles=len(away),
        within_one_cell=_mean(away <= 1 + BESIDE),
        within_two_cells=_mean(away <= 2 + BESIDE),
        false_obstacles=false / max(air, 1),
        class_accuracy=_class_accuracy(classes, truth),
    )


def score_mapper(
    mapper: Mapper, scene: Scene, *, robot_class: str, start: Pose2
) -> MapScore:
    """Score the map that a robot has made with its scanner.

    Args:
        mapper: Holds the map.
        scene: The mapped scene.
        robot_class: Class of the robot.
        start: Start pose of the robot, map frame.
    """
    robot = load_robot(robot_class)
    floor = scene.floor_at(start.x, start.y)
    return score_map(
        mapper.grid,
        scene,
        start=(start.x, start.y),
        robot_radius=math.hypot(robot.length, robot.width) / 2,
        height=floor + robot.origin_height + mapper.scanner.mount.z,
    )


def _is_right(classes: Any, truth: Truth) -> Mask:
    solid = truth.kinds[CellClass.OBSTACLE] | truth.kinds[CellClass.FOLIAGE]
    blocked = (classes == CellClass.OBSTACLE) | (classes == CellClass.FOLIAGE)
    right = blocked & (_distances(solid) <= TOLERANCE + BESIDE)
    right |= (classes == CellClass.SMOKE) & (
        _distances(truth.kinds[CellClass.SMOKE]) <= TOLERANCE + BESIDE
    )
    inside = np.any(list(truth.inside.values()), axis=0)
    shallow = np.isfinite(distance_field(~inside, TOLERANCE + BESIDE))
    return np.asarray(right | ((classes == CellClass.FREE) & shallow))


def _class_accuracy(classes: Any, truth: Truth) -> float | None:
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
    """Return the distance of each cell to the nearest of some, cells; inf if far."""
    return distance_field(cells, TOLERANCE + BESIDE)


def unreachable_floor(
    scene: Scene, frame: GridFrame, start: Position, robot_radius: float
) -> Mask:
    """Return the cells where the robot would fit, but that it cannot reach."""
    free = free_space(scene, robot_radius, places=[start])
    home = component_around(free, start)
    others = [piece for piece in free.geoms if home is None or not piece.equals(home)]
    return _covered(shapely.union_all(others), frame)


def _around(frame: GridFrame, scene: Scene) -> GridFrame:
    """Return the frame extended to hold the whole scene."""
    low, high = scene.bounds[0], scene.bounds[1]
    return frame.extended_to(
        (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))
    )


def _filled(part: Part, segments: Floats, starts: Any, frame: GridFrame) -> Mask:
    """Return the cells in a part; a part around a start is a room, and hollow."""
    if part.material.sheet_loss is not None:
        return np.zeros(frame.shape, np.bool_)
    lines = shapely.linestrings(np.round(segments, 6))
    # Split where they cross: one mesh may intersect itself
    areas = shapely.get_parts(shapely.polygonize([shapely.union_all(lines)]))
    if class_of(part) == CellClass.OBSTACLE:
        areas = areas[~shapely.intersects(areas, starts)]
    return _covered(shapely.union_all(areas), frame)


def _covered(area: Any, frame: GridFrame) -> Mask:
    """Return the cells whose centres are in an area."""
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
    """Return the cells that lines cross."""
    starts, spans = segments[:, 0], segments[:, 1] - segments[:, 0]
    lengths = np.hypot(*spans.T) / frame.resolution
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


def _is_inside(indoors: Mask, frame: GridFrame, place: Position) -> bool:
    cell = frame.cell(*place)
    return cell is not None and bool(indoors[cell])


def _share(known: Mask, of: Mask) -> float | None:
    return _mean(known[of])


def _mean(values: Any) -> float | None:
    return float(np.mean(values)) if len(values) else None
