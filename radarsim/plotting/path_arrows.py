"""Arrow heads along a path, which show the direction in which it was driven."""

from typing import Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.path import Path
from matplotlib.transforms import Affine2D

from radarsim.geometry import Floats
from radarsim.plotting.palette import MARKER, PAPER

_HEAD: Final = Path(
    np.array([(1.0, 0.0), (-0.8, 0.8), (-0.3, 0.0), (-0.8, -0.8), (1.0, 0.0)]),
    closed=True,
)
_SIZE: Final = 11.0  # points
_EVERY: Final = 0.25  # of the width of the panel from one to the next
_AROUND: Final = 0.15  # m of the path before and after, which give the direction


def arrow_places(path: Floats, spacing: float) -> Floats:
    """Return where arrow heads stand on a path, and the direction there.

    Args:
        path: The path, (N, 2) m.
        spacing: Length of the path from one to the next, m; the first is after half.

    Returns:
        x and y in m, and the direction in rad from the x axis, (M, 3).
    """
    if len(path) < 2:
        return np.zeros((0, 3))
    steps = np.hypot(*np.diff(path, axis=0).T)
    along = np.concatenate([np.zeros(1), np.cumsum(steps)])
    places = np.arange(spacing / 2, along[-1], spacing)

    def at(lengths: Floats) -> Floats:
        return np.column_stack([np.interp(lengths, along, axis) for axis in path.T])

    x, y = (at(places + _AROUND) - at(places - _AROUND)).T
    return np.column_stack([at(places), np.arctan2(y, x)])


def draw_arrows(axes: Axes, path: Floats, zorder: float) -> list[Artist]:
    """Draw arrow heads at equal distances along a path, (N, 2) m."""
    drawn: list[Artist] = []
    for x, y, direction in arrow_places(path, _EVERY * axes.viewLim.width).tolist():
        drawn += axes.plot(
            x,
            y,
            marker=_HEAD.transformed(Affine2D().rotate(direction)),
            markersize=_SIZE,
            markerfacecolor=MARKER,
            markeredgecolor=PAPER,
            markeredgewidth=0.7,
            zorder=zorder,
        )
    return drawn
