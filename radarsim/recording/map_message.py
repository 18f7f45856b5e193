"""Maps as messages."""

import numpy as np

from radarsim.geometry import Pose3
from radarsim.mapping.export import sensed_window
from radarsim.mapping.occupancy_grid import CellClass, OccupancyGrid
from radarsim.recording.messages import occupancy_grid
from radarsim.recording.robot_topics import MAP, TopicMessage

UNKNOWN, FREE, OCCUPIED = -1, 0, 100  # of ``nav_msgs/OccupancyGrid``


def map_message(grid: OccupancyGrid, time: float) -> TopicMessage:
    """Return the sensed part of a map; foliage is occupied, as robots drive into it.

    Args:
        grid: The map; it has cells.
        time: Simulated time, s.
    """
    levels = np.full(len(CellClass), FREE, np.int8)
    levels[CellClass.UNKNOWN] = UNKNOWN
    levels[[CellClass.OBSTACLE, CellClass.FOLIAGE]] = OCCUPIED
    rows, columns = sensed_window(grid)
    x, y = grid.frame.origin
    size = grid.frame.resolution
    corner = Pose3(x + columns.start * size, y + rows.start * size, 0.0)
    cells = levels[grid.classes()[rows, columns]]
    return TopicMessage(
        "/map", occupancy_grid(time, MAP, cells, corner, size), latched=True
    )
