"""The floor of a scene in the cells of a map: what a robot can get to, and the rest.

Only what walls enclose counts as floor that could be known. A block of walls that is
closed on all sides is no floor, unless the robot is in it.
"""

from dataclasses import dataclass

import numpy as np
import shapely
from shapely import Point, Polygon

from radarsim.evaluation.free_space import Position, free_space
from radarsim.evaluation.map_truth import Truth, covered_cells
from radarsim.mapping.occupancy_grid import Mask
from radarsim.scene.scene import Scene


@dataclass(frozen=True, slots=True, eq=False)
class TrueFloor:
    """Cells of floor, each mask (R, C); all are empty if the robot starts outdoors.

    Attributes:
        indoors: Cells between the walls around the start, also under foliage and smoke.
        free: Those of them with nothing in them.
        reachable: Free cells that the robot covers wherever it can get to.
        hidden: Free cells where it would fit, but that it cannot get to.
    """

    indoors: Mask
    free: Mask
    reachable: Mask
    hidden: Mask


def find_floor(
    truth: Truth, scene: Scene, *, start: Position, robot_radius: float
) -> TrueFloor:
    """Find the floor around the start of a robot.

    Args:
        truth: The scene in the cells of a map.
        scene: The same scene.
        start: Start of the robot, m.
        robot_radius: Half the diagonal of the robot, m.
    """
    indoors = truth.indoors_around(start)
    free = indoors & ~truth.anything()
    pieces = list(free_space(scene, robot_radius, places=[start]).geoms)
    home = _home(pieces, Point(start), robot_radius)
    others = [piece for piece in pieces if piece is not home]
    within_reach = Polygon() if home is None else home.buffer(robot_radius)
    return TrueFloor(
        indoors,
        free,
        np.asarray(free & covered_cells(within_reach, truth.frame)),
        np.asarray(free & covered_cells(shapely.union_all(others), truth.frame)),
    )


def _home(pieces: list[Polygon], start: Point, robot_radius: float) -> Polygon | None:
    """Return the piece that the robot is in, or beside, if it starts at a wall."""
    home = min(pieces, key=start.distance, default=None)
    return None if home is None or home.distance(start) > robot_radius else home
