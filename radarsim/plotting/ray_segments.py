"""Rays cut into pieces, each with the share of the power that is left on it.

Theory of operation
===================
Power changes at what happens to a ray, and between two such events in a straight line:
it stays where nothing is, and falls evenly inside volumes. So a ray is cut at its
events, and where it falls into pieces so short that no piece loses much; then one
shade for each of them shows how it fades. A sheet takes its toll at one point, which
the next piece shows; at a mirror the way turns.
"""

from typing import Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.plotting.style import Legend
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import Tracer, tracer_of
from radarsim.scene.scene import Scene
from radarsim.sensors.beams import CENTRE, LEFT, RIGHT
from radarsim.sensors.scan import Scan

FALL: Final = 1 / 12  # share of the full power that one piece may lose


class RaySegments(NamedTuple):
    """Pieces of rays, ray by ray, the nearest first; none has no length.

    Attributes:
        rays: (P,) int64, the number of the ray.
        starts: (P,) m from the start of the ray.
        ends: (P,) m from the start of the ray.
        shares: (P,) 0 to 1, what is left halfway; 1 if the power is unlimited.
        lines: (P, 2, 2) m, both ends seen from above, map frame.
    """

    rays: NDArray[np.int64]
    starts: Floats
    ends: Floats
    shares: Floats
    lines: Floats


def cut(tracer: Tracer, rays: Rays) -> RaySegments:
    """Follow rays and cut them where their power changes.

    Raises:
        EngineError: If a column of the rays is not what it has to be.
    """
    events = tracer.trace(rays, events=True).events
    ray, t = events["ray"], events["t"]
    arriving = _shares(events["power"], rays.power[ray])
    leaving = _shares(_behind(events), rays.power[ray])
    first = np.diff(ray, prepend=-1) > 0
    start = np.where(first, 0.0, np.roll(t, 1))
    share = np.where(first, 1.0, np.roll(leaving, 1))
    fall = np.maximum(share - arriving, 0.0)
    # by rounding, what falls by a whole number of twelfths may fall by a little more
    counts = np.maximum(np.ceil(fall / FALL - 1e-9), 1).astype(np.int64)
    counts[t <= start] = 0
    each = np.repeat(np.arange(len(events)), counts)
    rank = np.arange(len(each)) - np.repeat(np.cumsum(counts) - counts, counts)
    step = (t - start)[each] / counts[each]
    starts = start[each] + rank * step
    ends = np.where(rank + 1 == counts[each], t[each], starts + step)
    shares = share[each] - fall[each] * (rank + 0.5) / counts[each]
    there = np.column_stack([events["x"], events["y"]])
    before = np.where(first[:, None], rays.origins[ray, :2], np.roll(there, 1, axis=0))
    way = (there - before)[each] / counts[each, None]
    near = before[each] + rank[:, None] * way
    lines = np.stack([near, near + way], axis=1)
    return RaySegments(ray[each], starts, ends, shares, lines)


def _shares(power: Floats, full: Floats) -> Floats:
    """Give powers as shares of full ones; 1 where these have no end, or are none."""
    limited = np.isfinite(full) & (full > 0)
    return np.where(limited, power, 1.0) / np.where(limited, full, 1.0)


def _behind(events: NDArray[np.void]) -> NDArray[np.float64]:
    """Give the power behind each event: behind sheets, less than in front of them."""
    return np.asarray(events["power"] - events["absorbed"])


# Section from picture.strokes.
# Rays as lines that fade with the power that is left on them.

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
