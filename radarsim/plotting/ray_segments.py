"""Rays as segments that fade with the power left on them.

Theory of operation
===================
Between two events of a ray its power is constant, or falls linearly inside volumes. A
ray is split at its events, and where its power falls into segments so short that none
loses more than ``MAX_POWER_DROP``; one shade for each segment then shows how it fades.
The loss at a sheet is a step between two segments; at a mirror the direction changes.
"""

from typing import Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.plotting.palette import CENTRE_RAY, LEFT_RAY, RIGHT_RAY, sensor_colour
from radarsim.plotting.style import Legend
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import Tracer, tracer_of
from radarsim.scene.scene import Scene
from radarsim.sensors.beams import CENTRE, LEFT, RIGHT
from radarsim.sensors.scan import Scan

MAX_POWER_DROP: Final = 1 / 12  # share of the full power that one segment may lose


class RaySegments(NamedTuple):
    """Segments of rays, ordered by ray and distance; each has a length above 0.

    Attributes:
        rays: Index of the ray, (P,) int64.
        starts: Distance of the start from the ray's origin, (P,) m.
        ends: Distance of the end from the ray's origin, (P,) m.
        shares: Share of the power left at the middle, (P,); 1 if it is unlimited.
        lines: x and y of both ends, (P, 2, 2) m, map frame.
    """

    rays: NDArray[np.int64]
    starts: Floats
    ends: Floats
    shares: Floats
    lines: Floats


def split_rays(tracer: Tracer, rays: Rays) -> RaySegments:
    """Trace rays and split them where their power changes.

    Raises:
        EngineError: If a column of the rays has a wrong shape or value.
    """
    events = tracer.trace(rays, events=True).events
    ray, t = events["ray"], events["t"]
    arriving = _shares(events["power"], rays.power[ray])
    leaving = _shares(_power_after(events), rays.power[ray])
    first = np.diff(ray, prepend=-1) > 0
    start = np.where(first, 0.0, np.roll(t, 1))
    share = np.where(first, 1.0, np.roll(leaving, 1))
    fall = np.maximum(share - arriving, 0.0)
    # a fall by a whole number of twelfths may be a little more by rounding
    counts = np.maximum(np.ceil(fall / MAX_POWER_DROP - 1e-9), 1).astype(np.int64)
    counts[t <= start] = 0
    each = np.repeat(np.arange(len(events)), counts)
    rank = np.arange(len(each)) - np.repeat(np.cumsum(counts) - counts, counts)
    step = (t - start)[each] / counts[each]
    starts = start[each] + rank * step
    ends = np.where(rank + 1 == counts[each], t[each], starts + step)
    shares = share[each] - fall[each] * (rank + 0.5) / counts[each]
    ends_xy = np.column_stack([events["x"], events["y"]])
    before = np.where(
        first[:, None], rays.origins[ray, :2], np.roll(ends_xy, 1, axis=0)
    )
    step_xy = (ends_xy - before)[each] / counts[each, None]
    near = before[each] + rank[:, None] * step_xy
    lines = np.stack([near, near + step_xy], axis=1)
    return RaySegments(ray[each], starts, ends, shares, lines)


def _shares(power: Floats, full: Floats) -> Floats:
    """Return powers as shares of the full power; 1 where that is infinite or 0."""
    limited = np.isfinite(full) & (full > 0)
    return np.where(limited, power, 1.0) / np.where(limited, full, 1.0)


def _power_after(events: NDArray[np.void]) -> NDArray[np.float64]:
    """Return the power after each event, less what a surface absorbs."""
    return np.asarray(events["power"] - events["absorbed"])


# As in the thesis, the left ray is red and the right ray blue.
RAY_COLOURS: Final = {
    LEFT: (LEFT_RAY, "left ray"),
    CENTRE: (CENTRE_RAY, "centre ray"),
    RIGHT: (RIGHT_RAY, "right ray"),
}
SPENT_OPACITY, FULL_OPACITY = 0.15, 0.6
SPENT_WIDTH, FULL_WIDTH = 0.5, 0.9  # points
NO_RETURN_OPACITY: Final = 0.3  # share of the opacity that a ray without return has


def group_by_ray(scan: Scan) -> list[tuple[NDArray[np.bool_], str, str]]:
    """Group beams by the ray that gave the range: mask (N,), colour and name."""
    if scan.rays is None:
        return [
            (
                np.ones(len(scan.ranges), np.bool_),
                sensor_colour(scan.sensor, "laser"),
                "ray",
            )
        ]
    return [
        (scan.rays == side, colour, name)
        for side, (colour, name) in RAY_COLOURS.items()
    ]


def line_opacity(shares: Floats) -> Floats:
    """Return the opacity of a line by the share of power left on the ray."""
    return SPENT_OPACITY + (FULL_OPACITY - SPENT_OPACITY) * shares


def line_width(shares: Floats) -> Floats:
    """Return the width of a line, points, by the share of power left on the ray."""
    return SPENT_WIDTH + (FULL_WIDTH - SPENT_WIDTH) * shares


def draw_rays(axes: Axes, scene: Scene, scan: Scan, legend: Legend) -> None:
    """Draw the rays that gave the ranges, from their origins to their ends."""
    segments = split_rays(tracer_of(scene), scan.cast)
    came_back = np.isfinite(scan.ranges)
    shades = np.zeros((len(scan.ranges), 4))
    for chosen, colour, _ in group_by_ray(scan):
        shades[chosen, :3] = to_rgb(colour)
    shades = shades[segments.rays]
    shades[:, 3] = line_opacity(segments.shares)
    shades[:, 3] *= np.where(came_back[segments.rays], 1.0, NO_RETURN_OPACITY)
    lines = LineCollection(
        list(segments.lines),
        colors=shades,
        linewidths=line_width(segments.shares),
        capstyle="butt",
        label="rays",
        zorder=2,
    )
    axes.add_collection(lines)
    _add_power_rows(legend, some_lost=not came_back.all())


def _add_power_rows(legend: Legend, *, some_lost: bool) -> None:
    legend.add_heading("Power left on a ray")
    for text, share in (("all", 1.0), ("half", 0.5), ("next to none", 0.0)):
        opacity, width = line_opacity(np.array(share)), line_width(np.array(share))
        legend.add_line(
            text, color="black", alpha=float(opacity), linewidth=float(width)
        )
    if some_lost:
        legend.add_line(
            "no return",
            color="black",
            alpha=FULL_OPACITY * NO_RETURN_OPACITY,
            linewidth=FULL_WIDTH,
        )
