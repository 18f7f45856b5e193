"""Rays as segments that fade with the power left on them.

Theory of operation
===================
Between two events of a ray its power is constant, or falls linearly inside volumes. A
ray is split at its events, and where its power falls into segments so short that none
loses more than ``MAX_POWER_DROP``; one shade for each segment then shows how it fades.
The loss at a sheet is a step between two segments; at a mirror the direction changes.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.plotting.palette import sensor_colour
from radarsim.plotting.sight import BeamEnd, Sight
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import Tracer, tracer_of
from radarsim.scene.scene import Scene
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
    # From what is left behind the event before: a sheet's loss is a step there.
    share = np.where(first, 1.0, np.roll(leaving, 1))
    fall = np.maximum(share - arriving, 0.0)
    # a fall by a whole number of twelfths may be a little more by rounding
    counts = np.maximum(np.ceil(fall / MAX_POWER_DROP - 1e-9), 1).astype(np.int64)
    # Events at one place, such as faces that touch, have no segment between them.
    counts[t <= start] = 0
    each = np.repeat(np.arange(len(events)), counts)
    rank = np.arange(len(each)) - np.repeat(np.cumsum(counts) - counts, counts)
    step = (t - start)[each] / counts[each]
    starts = start[each] + rank * step
    # The last one ends exactly at the event; sums of steps would miss it by rounding.
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


SPENT_OPACITY, FULL_OPACITY = 0.12, 0.45
SPENT_WIDTH, FULL_WIDTH = 0.4, 0.7  # points
NO_RETURN_OPACITY: Final = 0.3  # share of the opacity that a ray without return has
THROUGH_WIDTH: Final = 1.6  # points, of rays that see through something
BLINDED: Final[Any] = {"linewidths": 0.4, "linestyles": (0, (2, 4)), "alpha": 0.5}


def scan_colour(scan: Scan) -> str:
    """Return the colour of the sensor that took a scan."""
    return sensor_colour(scan.echoes.settings.medium)


def line_opacity(shares: Floats) -> Floats:
    """Return the opacity of a line by the share of power left on the ray."""
    return SPENT_OPACITY + (FULL_OPACITY - SPENT_OPACITY) * shares


def line_width(shares: Floats) -> Floats:
    """Return the width of a line, points, by the share of power left on the ray."""
    return SPENT_WIDTH + (FULL_WIDTH - SPENT_WIDTH) * shares


def cut_at_readings(segments: RaySegments, ranges: Floats) -> RaySegments:
    """Cut segments of rays where the rays' ranges, (N,) m, are read."""
    kept = segments.starts < ranges[segments.rays]
    rays, starts, lines = (
        segments.rays[kept],
        segments.starts[kept],
        segments.lines[kept],
    )
    ends = np.minimum(segments.ends[kept], ranges[rays])
    part = ((ends - starts) / (segments.ends[kept] - starts))[:, None]
    lines[:, 1] = lines[:, 0] + part * (lines[:, 1] - lines[:, 0])
    return RaySegments(rays, starts, ends, segments.shares[kept], lines)


def draw_rays(axes: Axes, scene: Scene, scan: Scan, sight: Sight) -> None:
    """Draw the rays that gave the ranges, from their origins to their readings.

    Behind what they see through they are the boldest, so that near the sensor, where
    all of them lie close together, the map stays in sight; those without return are
    faint.
    A beam that is blinded has no way to its reading: its ray is thinly dashed up to
    where it is spent.
    """
    segments = split_rays(tracer_of(scene), scan.cast)
    colour = to_rgba(scan_colour(scan))
    _draw_blinded(axes, segments, scan.ranges == 0, colour)
    segments = cut_at_readings(segments, scan.ranges)
    through = (sight.ends == BeamEnd.THROUGH)[segments.rays] & (segments.starts > 0)
    shades = np.tile(colour, (len(segments.rays), 1))
    came_back = np.isfinite(scan.ranges)[segments.rays]
    shades[:, 3] = line_opacity(segments.shares)
    shades[:, 3] *= np.where(came_back, 1.0, NO_RETURN_OPACITY)
    shades[through, 3] = 1.0
    widths = np.where(through, THROUGH_WIDTH, line_width(segments.shares))
    for chosen, label, zorder in (
        (~through, "rays", 2.0),
        (through, "rays that see through", 2.2),
    ):
        lines = LineCollection(
            list(segments.lines[chosen]),
            colors=shades[chosen],
            linewidths=widths[chosen],
            capstyle="butt",
            label=label,
            zorder=zorder,
        )
        axes.add_collection(lines)


def _draw_blinded(
    axes: Axes,
    segments: RaySegments,
    blinded: NDArray[np.bool_],
    colour: tuple[float, float, float, float],
) -> None:
    chosen = blinded[segments.rays]
    if chosen.any():
        lines = LineCollection(
            list(segments.lines[chosen]),
            colors=[colour],
            label="blinded rays",
            zorder=2,
            **BLINDED,
        )
        axes.add_collection(lines)
