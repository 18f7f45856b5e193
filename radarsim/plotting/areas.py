"""Areas that lines enclose."""

from typing import Final

import numpy as np
import shapely
from shapely import Geometry

from radarsim.geometry import Floats

_DIGITS: Final = 6  # of rounded end points, so that lines that meet share them


def enclosed_area(segments: Floats) -> Geometry:
    """Return the area that line segments, (S, 2, 2) m, enclose; see ``area_within``."""
    return area_within(shapely.multilinestrings(np.round(segments, _DIGITS)))


def area_within(lines: Geometry) -> Geometry:
    """Return the area that lines enclose; empty if they enclose nothing.

    A ring inside another one is a hole. Where lines cross, as those of branches that
    grew into each other, all that is enclosed belongs to the area.
    """
    try:
        return shapely.build_area(lines)
    except shapely.errors.GEOSException:  # lines cross
        return shapely.union_all(shapely.polygonize([shapely.node(lines)]))
