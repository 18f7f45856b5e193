"""Rays, readings and echoes of scans as lines and markers in a plan.

For a single scan the end of each ray is marked; readings behind foliage or smoke have
the largest markers. For several scans each reading is a small, pale dot, so that the
picture shows the density of the readings. The shape of an echo's marker shows the kind
of the echo, its colour the material.

Theory of operation
===================
The opacity of a ray shows the power that is left. Between two events the power of a ray
is constant, or falls linearly inside volumes. A ray is split at its events and, where
its power falls, into segments that lose at most ``MAX_POWER_DROP`` each; each segment
has a single opacity. The loss at a sheet is a step between two segments; at a mirror
the direction changes.
"""

import math
from collections.abc import Iterable, Sequence
from itertools import chain
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.plotting.palette import (
    MARKER,
    PAPER,
    Family,
    family_of,
    sensor_colour,
)
from radarsim.plotting.sight import BeamEnd, Sight, name_materials
from radarsim.plotting.style import Legend, area_style, echo_points, scan_points
from radarsim.raycast.rays import EventKind, Rays
from radarsim.raycast.tracer import Tracer, tracer_of
from radarsim.scene.material import Material
from radarsim.scene.scene import Scene
from radarsim.sensors.scan import ROBOT, Echoes, Scan

MAX_POWER_DROP: Final = 1 / 12  # share of the full power that one segment may lose
SPENT_OPACITY, FULL_OPACITY = 0.12, 0.45
SPENT_WIDTH, FULL_WIDTH = 0.4, 0.7  # points
NO_RETURN_OPACITY: Final = 0.3  # opacity of rays without return, as a share of others
THROUGH_WIDTH: Final = 1.6  # points; width of rays that see through a material
BLINDED: Final[Any] = {"linewidths": 0.4, "linestyles": (0, (2, 4)), "alpha": 0.5}


class RaySegments(NamedTuple):
    """Rays split into short segments, ordered by ray and by distance from its origin.

    Attributes:
        rays: Index of the ray, (P,) int64.
        starts: Distance of the start from the ray's origin, (P,) m.
        ends: Distance of the end from the ray's origin, (P,) m.
        shares: Share of the power that is left at the middle, (P,); 1 if unlimited.
        lines: x and y of both ends, (P, 2, 2) m, map frame.
    """

    rays: NDArray[np.int64]
    starts: Floats
    ends: Floats
    shares: Floats
    lines: Floats


def split_rays(tracer: Tracer, rays: Rays) -> RaySegments:
    """Trace rays, and split them into segments where their power changes.

    Raises:
        EngineError: If a column of the rays has a wrong shape or value.
    """
    events = tracer.trace(rays, events=True).events
    ray, t = events["ray"], events["t"]
    arriving = _shares(events["power"], rays.power[ray])
    # The share of the power that is left after the absorption at a surface.
    leaving = _shares(events["power"] - events["absorbed"], rays.power[ray])
    first = np.diff(ray, prepend=-1) > 0
    start = np.where(first, 0.0, np.roll(t, 1))
    # The loss at a sheet is sudden, so a segment starts
    # with the power that is left behind the previous event.
    share = np.where(first, 1.0, np.roll(leaving, 1))
    fall = np.maximum(share - arriving, 0.0)
    # Rounding errors must not add a segment if the quotient is an integer.
    counts = np.maximum(np.ceil(fall / MAX_POWER_DROP - 1e-9), 1).astype(np.int64)
    # Events at the same distance, such as touching faces, have no segment between them.
    counts[t <= start] = 0
    each = np.repeat(np.arange(len(events)), counts)
    rank = np.arange(len(each)) - np.repeat(np.cumsum(counts) - counts, counts)
    step = (t - start)[each] / counts[each]
    starts = start[each] + rank * step
    # Rounding errors would make the sum of steps miss the
    # event, so the last segment ends at the event itself.
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
    """Return powers as shares of full powers; 1 if a full power is infinite or 0."""
    limited = np.isfinite(full) & (full > 0)
    return np.where(limited, power, 1.0) / np.where(limited, full, 1.0)


def scan_colour(scan: Scan) -> str:
    """Return the colour of the sensor that recorded a scan."""
    return sensor_colour(scan.echoes.settings.medium)


def line_opacity(shares: Floats) -> Floats:
    """Return the opacity of lines from the shares of power that rays still have."""
    return SPENT_OPACITY + (FULL_OPACITY - SPENT_OPACITY) * shares


def cut_at_readings(segments: RaySegments, ranges: Floats) -> RaySegments:
    """Remove the parts of segments that lie beyond the range, (N,) m, of their ray."""
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
    """Draw each ray from its origin to its reading.

    Rays that see through a material are bold, but only behind their first event, so
    that they do not hide the map near the sensor. Rays without return are faint. The
    ray of a blinded beam, which reads 0, is a thin dashed line up to the point where
    its power is depleted.
    """
    segments = split_rays(tracer_of(scene), scan.cast)
    colour = to_rgba(scan_colour(scan))
    blinded = segments.lines[(scan.ranges == 0)[segments.rays]]
    if len(blinded):
        lines = LineCollection(
            list(blinded), colors=[colour], label="blinded rays", zorder=2, **BLINDED
        )
        axes.add_collection(lines)
    segments = cut_at_readings(segments, scan.ranges)
    through = (sight.ends == BeamEnd.THROUGH)[segments.rays] & (segments.starts > 0)
    shades = np.tile(colour, (len(segments.rays), 1))
    came_back = np.isfinite(scan.ranges)[segments.rays]
    shades[:, 3] = line_opacity(segments.shares)
    shades[:, 3] *= np.where(came_back, 1.0, NO_RETURN_OPACITY)
    shades[through, 3] = 1.0
    faded = SPENT_WIDTH + (FULL_WIDTH - SPENT_WIDTH) * segments.shares
    widths = np.where(through, THROUGH_WIDTH, faded)
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


class EchoMarker(NamedTuple):
    """How a plot marks the echoes of one kind.

    Attributes:
        text: Text of the legend.
        marker: Marker style of matplotlib.
        filled: Whether the marker is filled or only outlined.
        area: Area of the marker of the strongest echo, square points.
    """

    text: str
    marker: str
    filled: bool
    area: float


ECHO_MARKERS: Final = {
    EventKind.ENTER: EchoMarker("enters a volume", "^", filled=False, area=14),
    EventKind.LEAVE: EchoMarker("leaves a volume", "v", filled=False, area=14),
    EventKind.SHEET: EchoMarker("crosses a sheet", "D", filled=False, area=12),
    EventKind.HIT: EchoMarker("hits a surface", "s", filled=True, area=14),
    EventKind.SPENT: EchoMarker("is spent inside", "x", filled=True, area=18),
    EventKind.RAIN: EchoMarker("rain shows", "*", filled=True, area=24),
}
MIN_AREA: Final = 0.3  # ratio of the markers' areas of the weakest and strongest echo


def draw_echoes(axes: Axes, scan: Scan) -> None:
    """Draw a marker for each echo that the sensor reports.

    Each pair of kind and material has its own collection of markers, labelled with
    both.
    """
    echoes = scan.echoes
    points, areas = echo_points(scan, echoes), _areas(echoes)
    materials = {part: material_of(echoes, part) for part in echoes.targets}
    names = np.array([materials[part].name for part in echoes.parts.tolist()], np.str_)
    found = {material.name: material for material in materials.values()}
    for kind, shape in ECHO_MARKERS.items():
        for name in sorted(found):
            chosen = (echoes.kinds == kind) & (names == name)
            if chosen.any():
                axes.scatter(
                    points[chosen, 0],
                    points[chosen, 1],
                    areas[chosen],
                    label=f"{shape.text}: {name}",
                    **_style(shape, found[name]),
                )


def material_of(echoes: Echoes, part: int) -> Material:
    """Return the material of a part that gave echoes, or ``ROBOT`` for a robot."""
    parts = echoes.scene_parts
    return parts[part].material if part < len(parts) else ROBOT


def _style(shape: EchoMarker, material: Material) -> dict[str, Any]:
    fill = area_style(family_of(material))
    outline = fill["edgecolor"]
    style: dict[str, Any] = {"marker": shape.marker, "linewidths": 0.7, "zorder": 3}
    if shape.marker == "x":
        return {**style, "color": outline}
    inside = fill["facecolor"][:3] if shape.filled else "none"
    return {**style, "facecolors": inside, "edgecolors": outline}


def _areas(echoes: Echoes) -> Floats:
    """Return the areas of echo markers, (E,) square points; strong echoes get more."""
    levels = 1 + echoes.decibels / echoes.settings.margin_db
    shares = MIN_AREA + (1 - MIN_AREA) * np.clip(levels, 0.0, 1.0)
    full = np.array(
        [ECHO_MARKERS[EventKind(kind)].area for kind in echoes.kinds.tolist()]
    )
    return np.asarray(full * shares)


def add_echo_rows(legend: Legend, scans: Sequence[Scan]) -> None:
    """Add a row to the legend for each kind of echo in the scans."""
    kinds = {kind for scan in scans for kind in scan.echoes.kinds.tolist()}
    legend.add_heading("Echoes (larger: stronger)")
    for kind, shape in ECHO_MARKERS.items():
        if kind in kinds:
            legend.add_marker(
                shape.text,
                shape.marker,
                markeredgecolor=MARKER,
                markerfacecolor="0.7" if shape.filled else "none",
                markersize=5,
            )


THROUGH_AREA: Final = 42.0  # square points; marker of rays that see through a material
_CROSS: Final[Any] = {"marker": "x", "markersize": 4.5, "markeredgewidth": 0.9}
# Marker styles of the ends of rays.
END_MARKS: Final[dict[BeamEnd, dict[str, Any]]] = {
    BeamEnd.THROUGH: {
        "marker": "o",
        "markersize": math.sqrt(THROUGH_AREA),
        "markerfacecolor": PAPER,
        "markeredgewidth": 1.6,
    },
    BeamEnd.SPENT: {**_CROSS, "marker": "+"},
    BeamEnd.STOPPED: _CROSS,
    BeamEnd.TOUCHING: {"marker": "s", "markersize": 3.0, "markerfacecolor": PAPER},
    BeamEnd.FREE: {"marker": ".", "markersize": 3.5},
}
# Line styles of rays in the legend, for rays with full power.
_FULL_RAY: Final[Any] = {"linewidth": FULL_WIDTH, "alpha": 0.5 + FULL_OPACITY}
_FAINT: Final = 2 * FULL_OPACITY * NO_RETURN_OPACITY
_RAYS: Final[dict[BeamEnd, dict[str, Any]]] = {
    **dict.fromkeys(END_MARKS, _FULL_RAY),
    BeamEnd.THROUGH: {"linewidth": THROUGH_WIDTH},
    BeamEnd.NO_RETURN: {"linewidth": FULL_WIDTH, "alpha": _FAINT},
    BeamEnd.BLINDED: {"linewidth": 0.6, "linestyle": (0, (2, 4))},
}
MANY_AREA: Final = 5.0  # square points; reading in a picture of several scans
MANY_OPACITY: Final = 0.3
MANY_THROUGH_AREA: Final = 36.0  # square points; such a reading behind foliage


def describe_end(end: BeamEnd, *sights: Sight) -> str:
    """Describe how beams end, for example "see through foliage"."""
    met = chain.from_iterable(sight.materials.get(end, ()) for sight in sights)
    words = name_materials(met) or "something"
    return {
        BeamEnd.THROUGH: f"see through {words}",
        BeamEnd.SPENT: f"spent in {words}",
        BeamEnd.STOPPED: f"stopped by {words}",
        BeamEnd.TOUCHING: f"read what stands in or at {words}",
        BeamEnd.FREE: "reach a surface directly",
        BeamEnd.NO_RETURN: "without return",
        BeamEnd.BLINDED: "blinded: reads 0",
    }[end]


def draw_ray_ends(
    axes: Axes, scan: Scan, sight: Sight, ends: Iterable[BeamEnd]
) -> None:
    """Draw a marker at the end of each ray, in the style of its ``BeamEnd``."""
    read = np.isfinite(scan.ranges)
    ranges = np.where(read, scan.ranges, 0.0)[:, None]
    points = (scan.cast.origins + ranges * scan.cast.directions)[:, :2]
    for end in ends:
        chosen = sight.ends == end
        if chosen.any():
            style = {"color": scan_colour(scan), **END_MARKS[end]}
            style["zorder"] = 5 if end == BeamEnd.THROUGH else 4
            label = end.name.lower()
            axes.plot(*points[chosen].T, linestyle="none", label=label, **style)


def add_ray_rows(
    legend: Legend, scans: Sequence[Scan], sights: Sequence[Sight]
) -> None:
    """Add a row to a legend for each kind of ray end in the scans.

    Args:
        legend: The legend to which rows are added.
        scans: Scans, one of each sensor.
        sights: A ``Sight`` for each scan.
    """
    legend.add_heading("Rays")
    for end, style in _RAYS.items():
        pairs = zip(scans, sights, strict=True)
        having = [(scan, sight) for scan, sight in pairs if (sight.ends == end).any()]
        # In a picture that marks echoes instead of
        # readings, rays with these ends all look the same.
        is_plain = end in END_MARKS and end != BeamEnd.THROUGH
        marked = [each for each in having if not (is_plain and lists_echoes(each[0]))]
        colour = legend.ray_colour or scan_colour(scans[0])
        if len(marked) < len(having):
            legend.add_line("other ray", color=colour, **style)
        if marked:
            text = describe_end(end, *(sight for _, sight in marked))
            legend.add_line(text, color=colour, **style, **END_MARKS.get(end, {}))


def draw_many(
    axes: Axes, scans: Sequence[Scan], sights: Sequence[Sight], legend: Legend
) -> None:
    """Draw the readings or the echoes of several scans as pale dots.

    Args:
        axes: Axes in m.
        scans: Scans of one sensor.
        sights: A ``Sight`` for each scan.
        legend: The legend to which rows for the marks are added.
    """
    colour, pairs = scan_colour(scans[0]), [*zip(scans, sights, strict=True)]
    if lists_echoes(scans[0]):
        _draw_echo_dots(axes, scans, legend)
    else:
        points = [
            scan_points(scan)[(s.ends >= BeamEnd.FREE) & (s.ends != BeamEnd.THROUGH)]
            for scan, s in pairs
        ]
        legend.add_heading("Readings")
        if len(dots := np.concatenate(points)):
            _draw_dots(axes, dots, colour, "reading")
            legend.add_marker("reading", ".", color=colour, alpha=0.6)
    seen = [scan_points(scan)[s.ends == BeamEnd.THROUGH] for scan, s in pairs]
    if len(hits := np.concatenate(seen)):
        style: dict[str, Any] = {
            "color": colour,
            "markersize": math.sqrt(MANY_THROUGH_AREA),
            "markeredgecolor": PAPER,
            "markeredgewidth": 0.5,
        }
        axes.plot(*hits.T, "o", **style, label="seen through", zorder=5)
        through = chain.from_iterable(s.materials[BeamEnd.THROUGH] for s in sights)
        legend.add_marker(f"seen through {name_materials(through)}", "o", **style)


def _draw_echo_dots(axes: Axes, scans: Sequence[Scan], legend: Legend) -> None:
    """Draw a dot for each echo, in the outline colour of its material."""
    legend.add_heading("Echoes")
    found: dict[Family, list[Floats]] = {}
    for scan in scans:
        points = echo_points(scan, scan.echoes)
        for part in scan.echoes.targets:
            family = family_of(material_of(scan.echoes, part))
            found.setdefault(family, []).append(points[scan.echoes.parts == part])
    for family in sorted(found, key=list(Family).index):
        colour = area_style(family)["edgecolor"]
        text = f"echo of {family.value}"
        _draw_dots(axes, np.concatenate(found[family]), colour, text)
        legend.add_marker(text, ".", color=colour)


def _draw_dots(axes: Axes, points: Floats, colour: Any, label: str) -> None:
    axes.scatter(
        points[:, 0],
        points[:, 1],
        MANY_AREA,
        color=colour,
        alpha=MANY_OPACITY,
        linewidths=0,
        label=label,
        zorder=3,
    )


def lists_echoes(scan: Scan) -> bool:
    """Return whether plots show all echoes of a scan instead of its readings."""
    return scan.echoes.settings.return_mode == "all" and scan.targets is None
