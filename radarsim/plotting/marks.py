"""Marks of readings: what is seen through something is the largest.

A single scan has a mark at the end of each ray. Of several scans each reading is a
small, pale dot, so that the picture shows how densely they lie.

Marks of echoes: their shape tells the kind, their colour the material.
"""

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.plotting.palette import MARKER, PAPER, Family, family_of
from radarsim.plotting.ray_segments import (
    FULL_OPACITY,
    FULL_WIDTH,
    NO_RETURN_OPACITY,
    THROUGH_WIDTH,
    scan_colour,
)
from radarsim.plotting.sight import Sight, name_materials
from radarsim.plotting.style import Legend, area_style, echo_points, scan_points
from radarsim.raycast.attenuation import EventKind
from radarsim.scene.material import Material
from radarsim.sensors.echoes import ROBOT, Echoes
from radarsim.sensors.scan import Scan


class EchoMarker(NamedTuple):
    """Marker for the echoes of one kind.

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
MIN_AREA: Final = 0.3  # share of the area that an echo without strength has


def draw_echoes(axes: Axes, scan: Scan) -> None:
    """Draw the echoes that the sensor keeps.

    Each kind and material gets its own collection of markers, labelled with both.
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
                    *(points[chosen, 0], points[chosen, 1], areas[chosen]),
                    label=f"{shape.text}: {name}",
                    **_style(shape, found[name]),
                )


def material_of(echoes: Echoes, part: int) -> Material:
    """Return the material of a part of echoes, or that of robots."""
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
    """Return the areas of markers, (E,) square points, larger for stronger echoes."""
    levels = 1 + echoes.decibels / echoes.settings.margin_db
    shares = MIN_AREA + (1 - MIN_AREA) * np.clip(levels, 0.0, 1.0)
    full = np.array(
        [ECHO_MARKERS[EventKind(kind)].area for kind in echoes.kinds.tolist()]
    )
    return np.asarray(full * shares)


def add_echo_rows(legend: Legend, scans: Sequence[Scan]) -> None:
    """Add the kinds of echoes that there are to a legend."""
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


THROUGH_AREA: Final = 42.0  # square points of the hit of a ray that sees through
DOT: Final = 3.5  # points, of other readings
CROSS: Final = 4.5  # points, of rays that are spent or stopped
SQUARE: Final = 3.0  # points, of readings in or at what rays enter
# How rays end that do not see through anything.
SPENT: Final = "spent"
STOPPED: Final = "stopped"
TOUCHING: Final = "in or at something"
FREE: Final = "nothing in the way"
_CROSSED: Final[Any] = {"marker": "x", "markersize": CROSS, "markeredgewidth": 0.9}
_MARKS: Final[Any] = {
    SPENT: _CROSSED,
    STOPPED: _CROSSED,
    TOUCHING: {"marker": "s", "markersize": SQUARE, "markerfacecolor": PAPER},
    FREE: {"marker": ".", "markersize": DOT},
}
MANY_AREA: Final = 5.0  # square points, of a reading of several scans
MANY_OPACITY: Final = 0.3
MANY_THROUGH_AREA: Final = 36.0  # square points, if it is seen through something

Mask = NDArray[np.bool_]


def draw_ray_ends(axes: Axes, scan: Scan, sight: Sight) -> None:
    """Mark the end of each ray of a scan that came back."""
    rays, colour = scan.cast, scan_colour(scan)
    read = _read(scan)
    ranges = np.where(read, scan.ranges, 0.0)[:, None]
    ends = (rays.origins + ranges * rays.directions)[:, :2]
    style: dict[str, Any] = {"linestyle": "none", "color": colour, "zorder": 4}
    for label, chosen in _group(scan, sight).items():
        if chosen.any():
            axes.plot(*ends[chosen].T, label=label, **style, **_MARKS[label])
    draw_hits(axes, scan, sight)


def draw_hits(axes: Axes, scan: Scan, sight: Sight) -> None:
    """Circle what is read by rays that see through something: the largest marks."""
    seeing = np.flatnonzero(sight.through)
    if not len(seeing):
        return
    ranges, directions = scan.ranges[seeing, None], scan.cast.directions[seeing]
    points = scan.cast.origins[seeing] + ranges * directions
    axes.scatter(
        *(points[:, 0], points[:, 1], THROUGH_AREA),
        facecolors=PAPER,
        edgecolors=scan_colour(scan),
        linewidths=1.6,
        label="seen through",
        zorder=5,
    )


def add_ray_rows(legend: Legend, scan: Scan, sight: Sight) -> None:
    """Add how the rays of a scan end to a legend.

    Args:
        legend: Gets the rows.
        scan: A scan.
        sight: How its beams see.
    """
    echoing = lists_echoes(scan)
    groups = _group(scan, sight)
    circle = {
        "marker": "o",
        "markersize": math.sqrt(THROUGH_AREA),
        "markerfacecolor": PAPER,
        "markeredgewidth": 1.6,
    }
    thin = {"linewidth": FULL_WIDTH, "alpha": 0.5 + FULL_OPACITY}
    faint = {"linewidth": FULL_WIDTH, "alpha": 2 * FULL_OPACITY * NO_RETURN_OPACITY}
    dashed = {"linewidth": 0.6, "linestyle": (0, (2, 4))}
    rows: list[tuple[Mask, str, dict[str, Any]]] = [
        (
            sight.through,
            f"sees through {sight.words}",
            {"linewidth": THROUGH_WIDTH, **circle},
        ),
        *_rows_of_others(scan, sight, groups, thin, echoing=echoing),
        (np.isinf(scan.ranges), "no return", faint),
        (scan.ranges == 0, "blinded: reads 0", dashed),
    ]
    colour = legend.ray_colour or scan_colour(scan)
    legend.add_heading("Rays")
    for mask, text, style in rows:
        if mask.any():
            legend.add_line(text, color=colour, **style)


def _rows_of_others(
    scan: Scan,
    sight: Sight,
    groups: dict[str, Mask],
    line: dict[str, Any],
    *,
    echoing: bool,
) -> list[tuple[Mask, str, dict[str, Any]]]:
    """Return the rows of rays that come back and do not see through anything."""
    if echoing:  # echoes are marked instead, and all these rays look the same
        return [(_read(scan) & ~sight.through, "other ray", line)]
    spent, stopping = _spent_in(scan), _stopping(scan, sight, groups[STOPPED])
    texts = {
        SPENT: f"is spent in {name_materials(spent)}",
        STOPPED: f"is stopped by {name_materials(stopping)}",
        TOUCHING: f"reads what stands in or at {name_materials(sight.entered)}",
        FREE: _say_free([*sight.materials, *spent, *stopping, *sight.entered]),
    }
    return [(groups[each], texts[each], line | _MARKS[each]) for each in texts]


def _group(scan: Scan, sight: Sight) -> dict[str, Mask]:
    """Return how rays end that come back and do not see through anything."""
    others = _read(scan) & ~sight.through
    spent = _spent(scan) & others
    stopped = sight.stopped & others & ~spent
    touching = sight.touching & others & ~spent
    free = others & ~spent & ~stopped & ~touching
    return {SPENT: spent, STOPPED: stopped, TOUCHING: touching, FREE: free}


def draw_many(
    axes: Axes, scans: Sequence[Scan], sights: Sequence[Sight], legend: Legend
) -> None:
    """Draw the readings of several scans as pale dots, or their echoes.

    Args:
        axes: Axes in m.
        scans: Scans of one sensor.
        sights: How their beams see.
        legend: Gets rows for the marks.
    """
    colour = scan_colour(scans[0])
    if lists_echoes(scans[0]):
        _draw_echo_dots(axes, scans, legend)
    else:
        pairs = zip(scans, sights, strict=True)
        points = [scan_points(scan)[_read(scan) & ~s.through] for scan, s in pairs]
        legend.add_heading("Readings")
        if len(dots := np.concatenate(points)):
            _draw_dots(axes, dots, colour, "reading")
            legend.add_marker("reading", ".", color=colour, alpha=0.6)
    seen = [scan_points(scan)[s.through] for scan, s in zip(scans, sights, strict=True)]
    if len(hits := np.concatenate(seen)):
        style: dict[str, Any] = {"markeredgecolor": PAPER, "markeredgewidth": 0.5}
        size = math.sqrt(MANY_THROUGH_AREA)
        axes.plot(
            *hits.T,
            "o",
            color=colour,
            markersize=size,
            label="seen through",
            zorder=5,
            **style,
        )
        materials = (material for sight in sights for material in sight.materials)
        text = f"seen through {name_materials(materials)}"
        legend.add_marker(text, "o", color=colour, markersize=size, **style)


def _draw_echo_dots(axes: Axes, scans: Sequence[Scan], legend: Legend) -> None:
    """Draw a dot for each echo, in the shade of the outlines of its material."""
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
        *(points[:, 0], points[:, 1], MANY_AREA),
        color=colour,
        alpha=MANY_OPACITY,
        linewidths=0,
        label=label,
        zorder=3,
    )


def lists_echoes(scan: Scan) -> bool:
    """Return whether a scan has all echoes of its beams, which are drawn instead."""
    return scan.echoes.settings.return_mode == "all" and scan.targets is None


def _read(scan: Scan) -> Mask:
    return np.isfinite(scan.ranges) & (scan.ranges > 0)


def _spent(scan: Scan) -> Mask:
    """Return which beams read the place where their power is spent, (N,)."""
    echoes = scan.echoes
    spent = np.zeros(len(scan.ranges), np.bool_)
    at_end = np.isclose(echoes.ranges, scan.ranges[echoes.beams])
    spent[echoes.beams[at_end & (echoes.kinds == EventKind.SPENT)]] = True
    return spent


def _say_free(met: Sequence[Material]) -> str:
    """Say what the rays do that meet none of the materials that others meet."""
    if len({family_of(material) for material in met}) > 1:
        return "meets none of these"
    return f"meets no {name_materials(met)}" if met else "reads a surface"


def _spent_in(scan: Scan) -> list[Material]:
    """Return what power is spent in."""
    echoes = scan.echoes
    parts = np.unique(echoes.parts[echoes.kinds == EventKind.SPENT]).tolist()
    return [material_of(echoes, part) for part in parts]


def _stopping(scan: Scan, sight: Sight, stopped: Mask) -> list[Material]:
    """Return what stops beams, (N,)."""
    if scan.targets is not None:  # it has no echoes
        found = (sight.read[beam] for beam in np.flatnonzero(stopped).tolist())
        return list({each.name: each for each in found if each is not None}.values())
    echoes = scan.echoes
    at_end = np.isclose(echoes.ranges, scan.ranges[echoes.beams])
    parts = np.unique(echoes.parts[at_end & stopped[echoes.beams]]).tolist()
    return [material_of(echoes, part) for part in parts]
