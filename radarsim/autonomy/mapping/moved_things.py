"""Moved things: what stands on a map where floor was known to be free before.

Theory of operation
===================
Floor where a robot may be keeps the safety distance from all that was seen by then.
What stands on such floor, or so near to it, has moved there, be it a robot, a person or
a crate: an obstacle that stands is seen larger from afar, not smaller. Few cells are
errors of poses and beams.
"""

from typing import Final

import numpy as np
from scipy import ndimage

from radarsim.autonomy.mapping.occupancy_grid import Mask, OccupancyGrid, distance_field

SMALLEST: Final = 6  # cells, of a thing, on floor where the robot could have been
GAP: Final = 0.1  # m between pieces of a thing, half of it
MARGIN: Final = 0.13  # m by which the safety distance may be kept less, in whole tiles


def moved_things(grid: OccupancyGrid, was_open: Mask, safety: float) -> Mask:
    """Return the cells of things that have moved to where they are, (R, C).

    Args:
        grid: The map.
        was_open: Cells of floor where the robot could have been, (R, C).
        safety: Distance of the robot's centre from what it could not enter, m.
    """
    blocked, size = grid.blocked_cells(), grid.frame.resolution
    reach = max(safety - MARGIN, 0.0) / size
    near = blocked & np.isfinite(distance_field(was_open, reach))
    # Pieces near each other are one: between two beams there is a gap.
    joined = np.isfinite(distance_field(near, GAP / size))
    labels, count = ndimage.label(joined, np.ones((3, 3)))
    sizes = np.bincount(labels[blocked & was_open], minlength=count + 1)
    return np.asarray(near & (sizes[labels] >= SMALLEST))
