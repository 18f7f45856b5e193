"""Moved things: what stands on a map where the robot could have been before.

Theory of operation
===================
What blocks floor that was open has moved there, be it a robot, a person or a crate: an
obstacle that stands is seen larger from afar, not smaller, and open floor keeps the
safety distance from all that has been seen. A thing is a connected piece of blocked
cells, most of them on such floor; walls are larger.
"""

from typing import Final

import numpy as np
from scipy import ndimage

from radarsim.autonomy.mapping.occupancy_grid import Mask

SHARE: Final = 0.5  # of the cells of a thing that are where floor was open, at least
SMALLEST: Final = 6  # cells, of a thing; fewer are errors of poses and beams
LARGEST: Final = 1.5  # m, of a thing; larger ones are walls


def moved_things(blocked: Mask, was_open: Mask, resolution: float) -> Mask:
    """Return the cells of things that have moved to where they are, (R, C).

    Args:
        blocked: Cells that robots cannot enter, (R, C).
        was_open: Cells of floor where the robot could have been, (R, C).
        resolution: Side of a cell, m.
    """
    things = np.zeros_like(blocked)
    if not (blocked & was_open).any():
        return things
    labels, _ = ndimage.label(blocked, np.ones((3, 3)))
    for number, place in enumerate(ndimage.find_objects(labels), 1):
        cells = labels[place] == number
        is_thing = max(cells.shape) <= LARGEST / resolution
        is_thing &= np.count_nonzero(cells) >= SMALLEST
        if is_thing and was_open[place][cells].mean() >= SHARE:
            things[place] |= cells
    return things
