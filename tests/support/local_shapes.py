"""Shapes of a point map, as scans are matched with them."""

from typing import NamedTuple

import numpy as np

from radarsim.engine import Packed, engine


class LocalShape(NamedTuple):
    """How the points around a point are distributed; zeros if there are too few."""

    found: bool
    dx: float
    dy: float
    xx: float
    xy: float
    yy: float


def shape_around(
    table: Packed, x: float, y: float, normal: tuple[float, float] = (0.0, 0.0)
) -> LocalShape:
    shapes = np.zeros(1, engine.rows["LocalShape"])
    engine.find_shape(table, x, y, *normal, shapes)
    return LocalShape(*shapes.item())
