"""How right a map is, by the scene that it is of.

Theory of operation
===================
The scene is cut at the sensor's height and laid onto the cells of the map. What a robot
made of a cell is right if something of that sort is within two cells: so far aside does
a radar with side rays of a hand's breadth see things. Free is wrong deep in something
that is not.

Only what walls enclose counts as floor that could be known. Of that floor the hidden
part is what the robot cannot get to from where it starts.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
import shapely
from shapely import MultiPoint

from radarsim.evaluation.free_space import Position, component_around, free_space
from radarsim.exploration.shortest_path import flood_fill
from radarsim.geometry import Floats, Pose2
from radarsim.mapping.distance_field import distance_field
from radarsim.mapping.mapper import Mapper
from radarsim.mapping.occupancy_grid import (
    CellClass,
    GridFrame,
    Mask,
    OccupancyGrid,
)
from radarsim.presets.robots import load_robot
from radarsim.robots.obstacles import slice_mesh
from radarsim.scene.scene import Part, Scene

TOLERANCE: Final = 2  # cells
BESIDE: Final = 0.5  # cells more, so that corners of a cell count as beside it
_SAMPLES: Final = 4  # along a line, for each cell


@dataclass(frozen=True, slots=True)
class MapScore:
    """How right a map is, in cells.

    Attributes:
        right: What is known and so.
        wrong: What is known and not so.
        unknown: Floor, or foliage or smoke over it, that no beam has been in; None
            where no walls enclose the start.
        coverage: Share of the free floor that is sensed; None as before.
        near_coverage: Share of it that was seen at short range; None as before.
        hidden_coverage: The same of the part that the robot cannot get to; None if
            there is no such part.
        obstacles: Cells taken for something solid.
        within_one_cell: Share of them that have a surface of it, or foliage, in the
            cell itself or beside it; None if there are none.
        within_two_cells: The same with one cell more.
        false_obstacles: Those farther from all that is solid, per cell of nothing that
            is sensed.
        class_accuracy: Share of the right cells in which robots cannot be that are also
            right on whether it is foliage; None if there are none.
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
    """What is where, on the cells of a grid.

    Attributes:
        kinds: What cells are of: obstacle, foliage and smoke, each (R, C); where
            two meet, a cell is of both.
        inside: Where cells are deep in anything of a kind, (R, C).
        indoors: What walls enclose and is not solid, (R, C).
    """

    def __init__(self, scene: Scene, frame: GridFrame, height: float) -> None:
        """Cut a scene.

        Args:
            scene: What there is.
            frame: Where cells are.
            height: Of the sensor in the map frame, m.
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
        """Give cells with anything in them, (R, C)."""
        return np.asarray(np.any(list(self.kinds.values()), axis=0))

    def free(self) -> Mask:
        """Give indoor cells with nothing in them, (R, C)."""
        return np.asarray(self.indoors & ~self.anything())

    def faces(self, *, outdoors: bool) -> Mask:
        """Give where something solid has a surface towards the open, and foliage.

        Args:
            outdoors: Whether surfaces towards what no walls enclose count too.
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
    """Tell what a map should take a part for."""
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
    body: float,
    height: float,
) -> MapScore:
    """Judge a map.

    Args:
        grid: The map.
        scene: What it is of.
        start: Where the robot began, m.
        body: Half its diagonal, m.
        height: Of its sensor in the map frame, m.
    """
    frame = _around(grid.frame, scene)
    truth = Truth(scene, frame, height)
    classes = grid.frame.copy_into(grid.classes(), frame)
    near = grid.frame.copy_into(grid.short_range_cells(), frame)
    right = _is_right(classes, truth)
    known = classes != CellClass.UNKNOWN
    indoors = truth.indoors if _is_inside(truth.indoors, frame, start) else None
    free = truth.free()
    hidden = free & _beyond(scene, frame, start, body)
    walls = classes == CellClass.OBSTACLE
    away = _away(truth.faces(outdoors=indoors is None))[walls]
    astray = _away(truth.kinds[CellClass.OBSTACLE] | truth.kinds[CellClass.FOLIAGE])[
        walls
    ]
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
        class_accuracy=_told_apart(classes, truth),
    )


def score_mapper(
    mapper: Mapper, scene: Scene, *, robot_class: str, start: Pose2
) -> MapScore:
    """Judge what a robot has mapped by its scanner.

    Args:
        mapper: Has the map.
        scene: What it is of.
        robot_class: Of the robot.
        start: Where it began, map frame.
    """
    robot = load_robot(robot_class)
    floor = scene.floor_at(start.x, start.y)
    return score_map(
        mapper.grid,
        scene,
        start=(start.x, start.y),
        body=math.hypot(robot.length, robot.width) / 2,
        height=floor + robot.origin_height + mapper.scanner.mount.z,
    )


def _is_right(classes: Any, truth: Truth) -> Mask:
    solid = truth.kinds[CellClass.OBSTACLE] | truth.kinds[CellClass.FOLIAGE]
    blocked = (classes == CellClass.OBSTACLE) | (classes == CellClass.FOLIAGE)
    right = blocked & (_away(solid) <= TOLERANCE + BESIDE)
    right |= (classes == CellClass.SMOKE) & (
        _away(truth.kinds[CellClass.SMOKE]) <= TOLERANCE + BESIDE
    )
    inside = np.any(list(truth.inside.values()), axis=0)
    shallow = np.isfinite(distance_field(~inside, TOLERANCE + BESIDE))
    return np.asarray(right | ((classes == CellClass.FREE) & shallow))


def _told_apart(classes: Any, truth: Truth) -> float | None:
    told: list[Any] = []
    for kind, other in (
        (CellClass.OBSTACLE, CellClass.FOLIAGE),
        (CellClass.FOLIAGE, CellClass.OBSTACLE),
    ):
        cells = classes == kind
        same = _away(truth.kinds[kind])[cells] <= TOLERANCE + BESIDE
        neither = _away(truth.kinds[other])[cells] > TOLERANCE + BESIDE
        told.append(same[same | ~neither])
    return _mean(np.concatenate(told))


def _away(cells: Mask) -> Floats:
    """Give how far each cell is from the nearest of some, cells; inf if farther."""
    return distance_field(cells, TOLERANCE + BESIDE)


def _beyond(scene: Scene, frame: GridFrame, start: Position, body: float) -> Mask:
    """Give where a robot would have room and cannot get to."""
    free = free_space(scene, body, places=[start])
    home = component_around(free, start)
    others = [piece for piece in free.geoms if home is None or not piece.equals(home)]
    return _covered(shapely.union_all(others), frame)


def _around(frame: GridFrame, scene: Scene) -> GridFrame:
    """Give a frame that holds the whole scene too."""
    low, high = scene.bounds[0], scene.bounds[1]
    return frame.extended_to(
        (float(low[0]), float(low[1])), (float(high[0]), float(high[1]))
    )


def _filled(part: Part, segments: Floats, starts: Any, frame: GridFrame) -> Mask:
    """Give the cells in a part; a part around a start is a room, and hollow."""
    if part.material.sheet_loss is not None:
        return np.zeros(frame.shape, np.bool_)
    lines = shapely.linestrings(np.round(segments, 6))
    # cut where they cross: one mesh may have surfaces that do
    areas = shapely.get_parts(shapely.polygonize([shapely.union_all(lines)]))
    if class_of(part) == CellClass.OBSTACLE:
        areas = areas[~shapely.intersects(areas, starts)]
    return _covered(shapely.union_all(areas), frame)


def _covered(area: Any, frame: GridFrame) -> Mask:
    """Give the cells whose middles are in an area."""
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
    """Give the cells that lines go through."""
    starts, ways = segments[:, 0], segments[:, 1] - segments[:, 0]
    lengths = np.hypot(*ways.T) / frame.resolution
    counts = np.ceil(lengths * _SAMPLES).astype(np.int64) + 2
    which = np.repeat(np.arange(len(segments)), counts)
    number = np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)
    along = number / (counts[which] - 1)
    places = starts[which] + along[:, None] * ways[which]
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
