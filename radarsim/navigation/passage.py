"""Rule of passage: where a robot's centre may be, and how gladly it goes there.

The centre keeps the safety distance from what blocks robots, so a passage is wide
enough if twice the safety distance, and what the sensor and the cells blur, fits in.
Where there is room, paths keep farther away. All planners that work on grids follow
this rule, so that what one of them can reach is what all can reach.
"""

import math
from typing import Final

import numpy as np

from radarsim.geometry import Floats

COSTLY: Final = 0.4  # m beyond the safety distance, where a step costs more
COSTLY_FACTOR: Final = 3.0  # added at its inner edge to the cost of a step, which is 1
CHEAP: Final = 2.0  # cost of a step that a short cut may lead over


def step_cost(clearance: Floats, safety_distance: float) -> Floats:
    """Return the cost of a step of one cell into each; inf where none may be made.

    Args:
        clearance: (R, C) m from the centre of each cell to the nearest centre of a cell
            that blocks robots; inf if that is far away.
        safety_distance: m from the robot's centre.

    Returns:
        (R, C).
    """
    depth = np.clip(1 - (clearance - safety_distance) / COSTLY, 0.0, 1.0)
    cost: Floats = 1.0 + COSTLY_FACTOR * depth
    return np.where(clearance < safety_distance, math.inf, cost)
