"""The floor that a robot cannot reach, and how much of it a growing map shows."""

import numpy as np

from radarsim.evaluation.map_truth import Truth
from radarsim.evaluation.true_floor import find_floor
from radarsim.mapping.occupancy_grid import GridFrame, OccupancyGrid
from radarsim.scene.scene import Scene


class HiddenFloor:
    """The free floor where a robot would fit, but that it cannot reach from its start.

    It is what ``MapScore.hidden_coverage`` counts, computed once for many maps.
    """

    def __init__(
        self,
        scene: Scene,
        resolution: float,
        *,
        start: tuple[float, float],
        robot_radius: float,
        height: float,
    ) -> None:
        """Find the cells.

        Args:
            scene: The mapped scene.
            resolution: Side of a cell of the maps, m.
            start: Start of the robot, m.
            robot_radius: Half the diagonal of the robot, m.
            height: Height of its sensor in the map frame, m.
        """
        low, high = scene.bounds[:, :2].tolist()
        frame = GridFrame(resolution).extended_to(tuple(low), tuple(high))
        truth = Truth(scene, frame, height)
        floor = find_floor(truth, scene, start=start, robot_radius=robot_radius)
        rows, columns = np.nonzero(floor.hidden)
        self._rows, self._columns = rows + frame.row, columns + frame.column

    def coverage(self, grid: OccupancyGrid) -> float | None:
        """Return the share of it that is sensed; None if there is no such floor."""
        if not len(self._rows):
            return None
        rows, columns = self._rows - grid.frame.row, self._columns - grid.frame.column
        inside = (rows >= 0) & (rows < grid.frame.rows)
        inside &= (columns >= 0) & (columns < grid.frame.columns)
        sensed = grid.sensed_cells()[rows[inside], columns[inside]]
        return float(np.count_nonzero(sensed)) / len(rows)
