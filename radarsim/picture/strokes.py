"""Rays as lines that fade with the power that is left on them."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.picture.legend import Legend
from radarsim.picture.pieces import cut
from radarsim.raycast.tracers import tracer_of
from radarsim.scene.scene import Scene
from radarsim.sensors.beams import CENTRE, LEFT, RIGHT
from radarsim.sensors.scan import Scan

# Figures of beams show the left ray red and the right one blue.
RAY_COLOURS: Final = {
    LEFT: ("tab:red", "left ray"),
    CENTRE: ("0.35", "centre ray"),
    RIGHT: ("tab:blue", "right ray"),
}
LASER_COLOUR: Final = "tab:purple"
SPENT_OPACITY, FULL_OPACITY = 0.15, 0.6
SPENT_WIDTH, FULL_WIDTH = 0.5, 0.9  # points
LOST: Final = 0.3  # opacity of a ray without return, as a share of that of others


def kinds_of_rays(scan: Scan) -> list[tuple[NDArray[np.bool_], str, str]]:
    """Group beams by the ray that gave the range: (N,) which, colour and name."""
    if scan.rays is None:
        return [(np.ones(len(scan.ranges), np.bool_), LASER_COLOUR, "ray")]
    return [
        (scan.rays == side, colour, name)
        for side, (colour, name) in RAY_COLOURS.items()
    ]


def opacity_of(shares: Floats) -> Floats:
    """Give the opacity of a line for the share of its power that a ray has left."""
    return SPENT_OPACITY + (FULL_OPACITY - SPENT_OPACITY) * shares


def width_of(shares: Floats) -> Floats:
    """Give the width of a line, points, for the share of power that is left."""
    return SPENT_WIDTH + (FULL_WIDTH - SPENT_WIDTH) * shares


def draw_rays(axes: Axes, scene: Scene, scan: Scan, legend: Legend) -> None:
    """Draw the rays that gave the ranges, from their own starts to where they end."""
    pieces = cut(tracer_of(scene), scan.cast)
    came_back = np.isfinite(scan.ranges)
    shades = np.zeros((len(scan.ranges), 4))
    for chosen, colour, _ in kinds_of_rays(scan):
        shades[chosen, :3] = to_rgb(colour)
    shades = shades[pieces.rays]
    shades[:, 3] = opacity_of(pieces.shares)
    shades[:, 3] *= np.where(came_back[pieces.rays], 1.0, LOST)
    strokes = LineCollection(
        list(pieces.lines),
        colors=shades,
        linewidths=width_of(pieces.shares),
        capstyle="butt",
        label="rays",
        zorder=2,
    )
    axes.add_collection(strokes)
    _tell_shades(legend, some_lost=not came_back.all())


def _tell_shades(legend: Legend, *, some_lost: bool) -> None:
    legend.head("Power left on a ray")
    for text, share in (("all", 1.0), ("half", 0.5), ("next to none", 0.0)):
        opacity, width = opacity_of(np.array(share)), width_of(np.array(share))
        legend.line(text, color="black", alpha=float(opacity), linewidth=float(width))
    if some_lost:
        legend.line(
            "no return", color="black", alpha=FULL_OPACITY * LOST, linewidth=FULL_WIDTH
        )
