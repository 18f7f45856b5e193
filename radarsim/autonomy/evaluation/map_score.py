"""Scores of maps by the ground truth of the scene.

Theory of operation
===================
The scene is rasterised to the cells of the map (``map_truth``). A cell's class is right
if something of that class is within two cells, since a radar's side rays see objects
that far aside. The class free is wrong if the cell is deeper than that inside of an
object. Coverage is that of the floor around the robot's start (``true_floor``).
"""

import math
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from radarsim.autonomy.evaluation.map_truth import Truth, find_floor
from radarsim.autonomy.evaluation.navigation_run import rounded
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.occupancy_grid import (
    CellClass,
    Mask,
    OccupancyGrid,
    distance_field,
)
from radarsim.geometry import Floats, Pose2
from radarsim.presets.robots import load_robot
from radarsim.scene.scene import Scene
from radarsim.simulation.map_warnings import Position

TOLERANCE: Final = 2  # cells
BESIDE: Final = 0.5  # cells more, so that corners of a cell count as beside it
MISPLACED: Final = 0.15  # m; obstacles farther from everything true are a second wall


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
        reachable_coverage: Known share of the part that the robot can get to; None as
            above.
        hidden_coverage: Known share of the part that the robot cannot reach; None if
            there is no such part.
        obstacles: Number of cells classified as obstacle.
        within_one_cell: Share of ``obstacles`` with a solid surface, or foliage, in the
            cell itself or beside it; None if there are none.
        within_two_cells: The same with one cell more.
        false_obstacles: Number of ``obstacles`` farther from everything solid, per
            known cell that is empty.
        misplaced: Share of ``obstacles`` more than 15 cm from everything solid, as of a
            wall that is on the map twice; None if there are none.
        class_accuracy: Share of the obstacle and foliage cells near something of their
            own class; cells near neither class do not count. None if none is left.
    """

    right: int
    wrong: int
    unknown: int | None
    coverage: float | None
    near_coverage: float | None
    reachable_coverage: float | None
    hidden_coverage: float | None
    obstacles: int
    within_one_cell: float | None
    within_two_cells: float | None
    false_obstacles: float
    misplaced: float | None
    class_accuracy: float | None

    def to_dict(self) -> dict[str, Any]:
        """Return the score for JSON, with shares rounded to four digits."""
        values: dict[str, Any] = rounded(asdict(self), 4)
        values["told_apart"] = values.pop("class_accuracy")
        return values


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
    low, high = scene.bounds[:, :2].tolist()
    frame = grid.frame.extended_to(tuple(low), tuple(high))
    truth = Truth(scene, frame, height)
    classes = grid.frame.copy_into(grid.classes(), frame)
    near = grid.frame.copy_into(grid.short_range_cells(), frame)
    solid = truth.kinds[CellClass.OBSTACLE] | truth.kinds[CellClass.FOLIAGE]
    smoke = truth.kinds[CellClass.SMOKE]
    blocked = (classes == CellClass.OBSTACLE) | (classes == CellClass.FOLIAGE)
    # Side rays see objects two cells beside their beam. Free is wrong only deeper than
    # that inside of an object.
    right = blocked & (_distances(solid) <= TOLERANCE + BESIDE)
    right |= (classes == CellClass.SMOKE) & (_distances(smoke) <= TOLERANCE + BESIDE)
    inside = np.any(list(truth.inside.values()), axis=0)
    right |= (classes == CellClass.FREE) & np.isfinite(_distances(~inside))
    known = classes != CellClass.UNKNOWN
    floor = find_floor(truth, scene, start=start, robot_radius=robot_radius)
    is_outdoors = not floor.indoors.any()
    walls = classes == CellClass.OBSTACLE
    faces = _distances(truth.faces(outdoors=is_outdoors))[walls]
    false = int(np.count_nonzero(np.isinf(_distances(solid)[walls])))
    misplaced = np.isinf(distance_field(solid, MISPLACED / frame.resolution))[walls]
    air = int(np.count_nonzero(known & ~truth.anything()))
    return MapScore(
        right=int(np.count_nonzero(known & right)),
        wrong=int(np.count_nonzero(known & ~right)),
        unknown=None if is_outdoors else int(np.count_nonzero(floor.indoors & ~known)),
        coverage=_mean(known[floor.free]),
        near_coverage=_mean(near[floor.free]),
        reachable_coverage=_mean(known[floor.reachable]),
        hidden_coverage=_mean(known[floor.hidden]),
        obstacles=len(faces),
        within_one_cell=_mean(faces <= 1 + BESIDE),
        within_two_cells=_mean(faces <= 2 + BESIDE),
        false_obstacles=false / max(air, 1),
        misplaced=_mean(misplaced),
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


def _class_accuracy(classes: Any, truth: Truth) -> float | None:
    # of cells near one kind only: where both are near, either class may be right
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


def _mean(values: Any) -> float | None:
    return float(np.mean(values)) if len(values) else None
