"""Figures 7 and 8: the Hokuyo is stopped by the bushes, the radar sees through them.

Figures 9 and 10: how the readings of the radar fray as its side rays move apart.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from radarsim.geometry import Floats
from radarsim.lab.figures.figure import (
    DrawnFigure,
    ScanSpec,
    draw_small_print,
    draw_title,
    hit_points,
    object_names,
)
from radarsim.lab.figures.foliage_wall import (
    COUNT,
    FAR,
    STEP,
    Changes,
    bush_parts,
    count_changes,
    count_ends,
    count_moved,
    count_over_grid,
    draw_room,
    far_side,
    hokuyo,
    name_hidden_objects,
    new_sheet,
    radar,
)
from radarsim.plotting.annotations import as_words
from radarsim.plotting.palette import LASER, MARKER, RADAR
from radarsim.plotting.style import scan_points
from radarsim.presets.sensor_settings import METRES_PER_UNIT
from radarsim.sensors.range_scanner import load_sensor
from radarsim.sensors.scan import Scan

OFFSETS: Final = (0, 50, 100)  # Unreal units
STILL_AREA, MOVED_AREA = 10.0, 36.0  # square points, of readings
Samples: TypeAlias = dict[str, Line2D]  # of a legend, by their text
_JOIN: Final[Any] = {"colors": "0.45", "linewidths": 0.9, "linestyles": (0, (4, 2))}


def draw_single_scans(seed: int) -> DrawnFigure:
    """Draw figure 9: how far the readings of one scan are off those without noise."""
    shots = [radar(seed, offset) for offset in OFFSETS]
    scans = [shot.take()[0] for shot in shots]
    moved = [count_moved(scan, seed) for scan in scans]
    beams = len(scans[0].ranges)
    drawing, panels = _sheet(shots)
    draw_title(drawing, "One scan: the wider the side rays, the more readings are off")
    still = scan_points(scans[0])
    shown: Samples = {}
    for axes, offset, scan, count in zip(panels, OFFSETS, scans, moved, strict=True):
        _name_panel(axes, offset, f"{count} of {beams} beams are off")
        shown |= _draw_shifts(axes, still, scan)
    _draw_noise_legend(drawing, shown)
    counted = ", ".join(
        f"{count} with N = {offset}"
        for offset, count in zip(OFFSETS, moved, strict=True)
    )
    return DrawnFigure(
        (drawing,),
        "Each beam is one of three rays, drawn by chance, that start N units apart: the"
        " larger N, the more readings are off. A line goes from the reading without"
        " noise to the one that replaces it.",
        tuple(shot.command for shot in shots),
        f"Of {beams} beams these read more than {100 * STEP:g} cm off what they read"
        f" with N = 0: {counted}. A unit is {1000 * METRES_PER_UNIT:g} mm. A reading is"
        " placed along its beam, wherever its ray has been, so that walls fray.",
    )


def draw_repeated_scans(seed: int) -> DrawnFigure:
    """Draw figure 10: how far the readings of many scans lie apart."""
    shots = [replace(radar(seed, offset), count=COUNT) for offset in OFFSETS]
    drawing, panels = _sheet(shots)
    draw_title(
        drawing, f"{COUNT} scans: the wider the side rays, the more readings scatter"
    )
    shown: Samples = {}
    details = []
    for axes, offset, shot in zip(panels, OFFSETS, shots, strict=True):
        scans = shot.take()
        changes = count_changes(shot.scene, scans)
        beams = len(scans[0].ranges)
        _name_panel(axes, offset, f"{sum(changes)} of {beams} beams change")
        shown |= _draw_spans(axes, scans)
        if sum(changes):
            details.append(_describe_changes(offset, changes, beams))
    _draw_noise_legend(drawing, shown)
    return DrawnFigure(
        (drawing,),
        f"The readings of {COUNT} scans from one place: the larger N, the more beams"
        " read now this, now that. A line joins the nearest and the farthest reading of"
        " a beam; most long ones jump from the edge of a bush to what stands behind.",
        tuple(shot.command for shot in shots),
        "\n".join(details),
    )


def _describe_changes(offset: int, changes: Changes, beams: int) -> str:
    return (
        f"N = {offset}: {sum(changes)} of {beams} beams change by more than"
        f" {100 * STEP:g} cm; {changes.jumping} of them jump from one thing to another,"
        f" most at the edge of a bush, {changes.slanting} meet the same solid thing at"
        f" a slant, and {changes.deep} end more or less deep in the bushes."
    )


def _sheet(shots: Sequence[ScanSpec]) -> tuple[Figure, list[Axes]]:
    """Return a figure with a plan of the test map for each offset, side by side."""
    drawing = Figure(figsize=(17, 4.9), dpi=120)
    panels = []
    for column, shot in enumerate(shots):
        axes = drawing.add_axes((0.004 + 0.3327 * column, 0.08, 0.326, 0.76))
        draw_room(axes, shot)
        panels.append(axes)
    return drawing, panels


def _name_panel(axes: Axes, offset: int, text: str) -> None:
    aside = f" ({offset * METRES_PER_UNIT:g} m)" if offset else ""
    axes.set_title(f"N = {offset}{aside}: {text}", fontsize="large", pad=2)


def _draw_shifts(axes: Axes, still: Floats, scan: Scan) -> Samples:
    """Draw readings, and how far they are off where they are without noise.

    Returns:
        Samples for the legend, by their text.
    """
    ends = scan_points(scan)
    off = np.hypot(*(ends - still).T) > STEP
    samples = {"reading as without noise": _dots(axes, ends[~off], MARKER, STILL_AREA)}
    if off.any():
        lines = np.stack([still, ends], axis=1)[off]
        samples["reading that is off"] = _dots(axes, ends[off], RADAR, MOVED_AREA)
        samples["how far it is off"] = _join(axes, lines)
    return samples


def _draw_spans(axes: Axes, scans: Sequence[Scan]) -> Samples:
    """Draw all readings, and from where to where those of a beam change."""
    points = np.array([scan_points(scan) for scan in scans])
    ranges = np.array([scan.ranges for scan in scans])
    beams = np.arange(ranges.shape[1])
    near, far = (points[index, beams] for index in (ranges.argmin(0), ranges.argmax(0)))
    changed = np.ptp(ranges, axis=0) > STEP
    still = np.unique(points[:, ~changed].reshape(-1, 2), axis=0)
    sample = _dots(axes, still, MARKER, STILL_AREA)
    within = f"reading that stays within {100 * STEP:g} cm in all scans"
    samples = {within: sample}
    if changed.any():
        moved = np.unique(points[:, changed].reshape(-1, 2), axis=0)
        sample = _dots(axes, moved, RADAR, MOVED_AREA / 2)
        samples["reading of a beam that changes more"] = sample
        lines = np.stack([near, far], axis=1)[changed]
        samples["from its nearest to its farthest reading"] = _join(axes, lines)
    return samples


def _join(axes: Axes, lines: Floats) -> Line2D:
    """Draw what is no beam: dashed lines, (L, 2, 2) m; return a sample of them."""
    joined = LineCollection(list(lines), zorder=3, **_JOIN)
    axes.add_collection(joined)
    return Line2D([], [], **{key.removesuffix("s"): v for key, v in _JOIN.items()})


def _dots(axes: Axes, points: Floats, colour: str, area: float) -> Line2D:
    """Draw readings, (N, 2) m, and return a sample of them."""
    x, y = points.T
    axes.scatter(x, y, s=area, color=colour, linewidths=0, zorder=4)
    size = area**0.5
    return Line2D([], [], color=colour, linestyle="none", marker="o", markersize=size)


def _draw_noise_legend(drawing: Figure, samples: Samples) -> None:
    drawing.legend(
        list(samples.values()),
        list(samples),
        loc="lower center",
        ncols=len(samples),
        frameon=False,
        fontsize="large",
    )


class BeamStyle(NamedTuple):
    """How the beams that end in one part of the room are drawn.

    Attributes:
        text: Text of the legend.
        width: Width of the lines, points.
        opacity: Opacity of the lines.
        marker: Marker of their ends; none if empty.
        area: Area of the markers, square points.
    """

    text: str
    width: float
    opacity: float
    marker: str
    area: float


# In the order of drawing; what sees through the bushes is the boldest.
NEAR: Final = BeamStyle("is stopped by a wall on this side", 0.5, 0.35, "", 0)
STOPPED: Final = BeamStyle("is stopped by the bushes", 0.7, 0.55, "x", 30)
SPENT: Final = BeamStyle("is spent inside a bush", 0.7, 0.55, "x", 30)
THROUGH: Final = BeamStyle("sees through the bushes", 2.4, 1.0, "o", 130)


def draw_hokuyo(seed: int) -> DrawnFigure:
    """Draw figure 7: the Hokuyo sees nothing behind the bushes."""
    shot = hokuyo(seed)
    (scan,) = shot.take()
    counts = count_ends(shot.scene, scan)
    own = load_sensor(shot.sensor).settings.max_range
    title = (
        f"To the Hokuyo the bushes are a wall: {counts.behind} of {counts.beams} beams"
        " see through"
    )
    reach = f"The Hokuyo's own range is {own:g} m; here it is given {FAR:g} m."
    drawing = _draw(shot, scan, title, LASER, STOPPED)
    draw_small_print(drawing, reach)
    return DrawnFigure(
        (drawing,),
        "The Hokuyo, a laser, scans the test map from the start. To it the bushes are a"
        " wall, and what stands behind them stays hidden.",
        (shot.command,),
        f"{counts.inside} of its {counts.beams} beams end at the near side of the"
        f" bushes and {counts.behind} behind them; the others meet the walls on this"
        f" side. {_everywhere(shot)} Its own range of {own:g} m would not even reach"
        f" the bushes from here, so that it is given {FAR:g} m.",
    )


def draw_radar(seed: int) -> DrawnFigure:
    """Draw figure 8: the radar sees through the bushes."""
    shot = radar(seed, 0)
    (scan,) = shot.take()
    counts = count_ends(shot.scene, scan)
    (noisy_scan,) = ScanSpec(shot.map, shot.sensor, seed).take()
    noisy = count_ends(shot.scene, noisy_scan).behind
    own = load_sensor(shot.sensor).settings.side_offset_uu
    title = (
        f"The radar sees what is behind: {counts.behind} of {counts.beams} beams see"
        " through the bushes"
    )
    drawing = _draw(shot, scan, title, RADAR, SPENT)
    objects = map(as_words, counts.objects)
    draw_small_print(
        drawing,
        "They go through the thin edges of the bushes and read what is behind:"
        f" {', '.join(objects)}.",
    )
    return DrawnFigure(
        (drawing,),
        "The radar scans the test map from the same place. Where the bushes are thin,"
        " its beams go through and read what stands behind; where they are thick, beams"
        " are spent inside.",
        (shot.command,),
        f"{counts.behind} of its {counts.beams} beams go through the thin edges of the"
        f" bushes and end behind them: at {', '.join(map(as_words, counts.objects))}."
        f" {counts.inside} are spent inside a bush, between its near and its far side."
        f" {_everywhere(shot)} N is 0 here: there is no noise. With the radar's own N"
        f" of {own:g}, which `radarsim demo` draws, {noisy} beams see through.",
    )


def _everywhere(shot: ScanSpec) -> str:
    places, beams, behind = count_over_grid(shot)
    return (
        f"From {places} places all over this side, {behind} of {beams} beams end behind"
        " the bushes."
    )


def _draw(
    shot: ScanSpec, scan: Scan, title: str, colour: str, at_bushes: BeamStyle
) -> Figure:
    drawing, axes = new_sheet()
    draw_room(axes, shot)
    name_hidden_objects(axes, shot.scene)
    draw_title(drawing, title)
    ends = hit_points(scan)[:, :2]
    behind = ends[:, 0] > far_side(shot.scene)
    bushes = [part.object_name for part in bush_parts(shot.scene)]
    inside = np.isin(object_names(scan), bushes)
    lines = np.stack([scan.cast.origins[:, :2], ends], axis=1)
    groups = {NEAR: ~behind & ~inside, at_bushes: inside, THROUGH: behind}
    for layer, (style, chosen) in enumerate(groups.items()):
        if chosen.any():
            _draw_beams(axes, lines[chosen], colour, style, zorder=2 + layer)
    _draw_beam_legend(
        drawing, colour, [each for each, some in groups.items() if some.any()]
    )
    return drawing


def _draw_beams(
    axes: Axes, lines: Floats, colour: str, style: BeamStyle, *, zorder: float
) -> None:
    """Draw beams, (B, 2, 2) m, from their origins to their readings."""
    beams = LineCollection(
        list(lines),
        colors=colour,
        linewidths=style.width,
        alpha=style.opacity,
        zorder=zorder,
        label=style.text,
    )
    axes.add_collection(beams)
    if style.marker:
        edge: dict[str, Any] = (
            {"linewidths": 1.4}
            if style.marker == "x"
            else {"edgecolors": "white", "linewidths": 1.2}
        )
        x, y = lines[:, 1].T
        look: dict[str, Any] = {
            "marker": style.marker,
            "color": colour,
            "label": style.text,
        }
        axes.scatter(x, y, s=style.area, zorder=7, **look, **edge)


def _draw_beam_legend(drawing: Figure, colour: str, styles: list[BeamStyle]) -> None:
    samples = [
        Line2D(
            [],
            [],
            color=colour,
            linewidth=style.width,
            marker=style.marker,
            markersize=style.area**0.5,
            label=style.text,
        )
        for style in reversed(styles)
    ]
    drawing.legend(
        handles=samples,
        loc="lower center",
        ncols=len(samples),
        frameon=False,
        fontsize="large",
    )
