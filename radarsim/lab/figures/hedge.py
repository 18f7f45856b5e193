"""Figures 7 and 8: the Hokuyo is stopped by the bushes, the radar sees through them.

Figures 9 and 10 show how the readings of the radar fray as its side rays move apart.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from radarsim.geometry import Floats
from radarsim.lab.figures.figure import (
    DrawnFigure,
    ScanSpec,
    draw_legend,
    draw_title,
    hit_points,
    object_names,
)
from radarsim.lab.figures.foliage_wall import (
    COUNT,
    FAR,
    STEP,
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
from radarsim.plotting.palette import LASER, MARKER, RADAR
from radarsim.plotting.style import (
    as_words,
    scan_points,
)
from radarsim.presets.sensor_settings import METRES_PER_UNIT
from radarsim.sensors.range_scanner import load_sensor
from radarsim.sensors.scan import Scan

OFFSETS: Final = (0, 50, 100)  # Unreal units
STILL_AREA, MOVED_AREA = 10.0, 36.0  # square points, of readings
_JOIN: Final[Any] = {"color": "0.45", "linewidth": 0.9, "linestyle": (0, (4, 2))}


def draw_single_scans(seed: int) -> DrawnFigure:
    """Draw figure 9: how far the readings of one scan are off those without noise."""
    shots = [radar(seed, offset) for offset in OFFSETS]
    scans = [shot.take()[0] for shot in shots]
    moved = [count_moved(scan, seed) for scan in scans]
    beams = len(scans[0].ranges)
    sheet = NoiseSheet(shots)
    title = "One scan: the wider the side rays, the more readings are off"
    still = scan_points(scans[0])
    for axes, scan, count in zip(sheet.panels, scans, moved, strict=True):
        sheet.name_panel(axes, f"{count} of {beams} beams are off")
        ends = scan_points(scan)
        off = np.hypot(*(ends - still).T) > STEP
        lines = np.stack([still, ends], axis=1)[off]
        sheet.draw_dots(axes, "reading as without noise", ends[~off])
        sheet.draw_dots(axes, "reading that is off", ends[off], MOVED_AREA)
        sheet.join(axes, "how far it is off", lines)
    counted = ", ".join(
        f"{count} with N = {offset}"
        for offset, count in zip(OFFSETS, moved, strict=True)
    )
    return DrawnFigure(
        sheet.finish(title),
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
    sheet = NoiseSheet(shots)
    title = f"{COUNT} scans: the wider the side rays, the more readings scatter"
    details = []
    for axes, offset, shot in zip(sheet.panels, OFFSETS, shots, strict=True):
        scans = shot.take()
        changes = count_changes(shot.scene, scans)
        beams = len(scans[0].ranges)
        sheet.name_panel(axes, f"{sum(changes)} of {beams} beams change")
        points = np.array([scan_points(scan) for scan in scans])
        ranges = np.array([scan.ranges for scan in scans])
        changed = np.ptp(ranges, axis=0) > STEP
        ends = ranges.argmin(0), ranges.argmax(0)
        near, far = (points[index, np.arange(beams)] for index in ends)
        still, moved = (
            # readings of several scans often lie on each other
            np.unique(points[:, chosen].reshape(-1, 2), axis=0)
            for chosen in (~changed, changed)
        )
        within = f"reading that stays within {100 * STEP:g} cm in all scans"
        sheet.draw_dots(axes, within, still)
        text = "reading of a beam that changes more"
        sheet.draw_dots(axes, text, moved, MOVED_AREA / 2)
        lines = np.stack([near, far], axis=1)[changed]
        sheet.join(axes, "from its nearest to its farthest reading", lines)
        if sum(changes):
            details.append(
                f"N = {offset}: {sum(changes)} of {beams} beams change by more than"
                f" {100 * STEP:g} cm; {changes.jumping} of them jump from one thing to"
                f" another, most at the edge of a bush, {changes.slanting} meet the"
                f" same solid thing at a slant, and {changes.deep} end more or less"
                " deep in the bushes."
            )
    return DrawnFigure(
        sheet.finish(title),
        f"The readings of {COUNT} scans from one place: the larger N, the more beams"
        " read now this, now that. A line joins the nearest and the farthest reading of"
        " a beam; most long ones jump from the edge of a bush to what stands behind.",
        tuple(shot.command for shot in shots),
        "\n".join(details),
    )


class NoiseSheet:
    """Plans of the test map side by side, one for each offset, and their legend.

    Attributes:
        panels: The axes of the plans.
    """

    def __init__(self, shots: Sequence[ScanSpec]) -> None:
        """Draw the plans."""
        self._drawing = Figure(figsize=(17, 4.9), dpi=120)
        self._samples: dict[str, Line2D] = {}
        self.panels: list[Axes] = []
        for column, shot in enumerate(shots):
            place = (0.004 + 0.3327 * column, 0.08, 0.326, 0.76)
            self.panels.append(self._drawing.add_axes(place))
            draw_room(self.panels[-1], shot)

    def name_panel(self, axes: Axes, text: str) -> None:
        """Write the offset of a panel and a text above it."""
        offset = OFFSETS[self.panels.index(axes)]
        aside = f" ({offset * METRES_PER_UNIT:g} m)" if offset else ""
        axes.set_title(f"N = {offset}{aside}: {text}", fontsize="large", pad=2)

    def draw_dots(
        self, axes: Axes, text: str, points: Floats, area: float = STILL_AREA
    ) -> None:
        """Draw readings, (N, 2) m: those that are still, or larger ones."""
        if not len(points):
            return
        colour = MARKER if area == STILL_AREA else RADAR
        x, y = points.T
        axes.scatter(x, y, s=area, color=colour, linewidths=0, zorder=4)
        sample: Any = {"marker": "o", "linestyle": "none", "markersize": area**0.5}
        self._samples[text] = Line2D([], [], color=colour, **sample)

    def join(self, axes: Axes, text: str, lines: Floats) -> None:
        """Draw what is no beam: dashed lines, (L, 2, 2) m."""
        if len(lines):
            axes.add_collection(LineCollection(list(lines), zorder=3, **_JOIN))
            self._samples[text] = Line2D([], [], **_JOIN)

    def finish(self, title: str) -> Figure:
        """Write the title and the legend; return the figure."""
        draw_title(self._drawing, title)
        draw_legend(self._drawing, self._samples, "large")
        return self._drawing


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
    drawing = _draw_beams(shot, scan, LASER, STOPPED)
    draw_title(
        drawing,
        f"To the Hokuyo the bushes are a wall: {counts.behind} of {counts.beams} beams"
        " see through",
        f"The Hokuyo's own range is {own:g} m; here it is given {FAR:g} m.",
    )
    return DrawnFigure(
        drawing,
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
    objects = ", ".join(map(as_words, counts.objects))
    drawing = _draw_beams(shot, scan, RADAR, SPENT)
    draw_title(
        drawing,
        f"The radar sees what is behind: {counts.behind} of {counts.beams} beams see"
        " through the bushes",
        "They go through the thin edges of the bushes and read what is behind:"
        f" {objects}.",
    )
    return DrawnFigure(
        drawing,
        "The radar scans the test map from the same place. Where the bushes are thin,"
        " its beams go through and read what stands behind; where they are thick, beams"
        " are spent inside.",
        (shot.command,),
        f"{counts.behind} of its {counts.beams} beams go through the thin edges of the"
        f" bushes and end behind them: at {objects}."
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


def _draw_beams(
    shot: ScanSpec, scan: Scan, colour: str, at_bushes: BeamStyle
) -> Figure:
    """Draw the test map, and beams from their origins to their readings."""
    drawing, axes = new_sheet()
    draw_room(axes, shot)
    name_hidden_objects(axes, shot.scene)
    ends = hit_points(scan)[:, :2]
    behind = ends[:, 0] > far_side(shot.scene)
    bushes = [part.object_name for part in bush_parts(shot.scene)]
    inside = np.isin(object_names(scan), bushes)
    lines = np.stack([scan.cast.origins[:, :2], ends], axis=1)
    groups = {NEAR: ~behind & ~inside, at_bushes: inside, THROUGH: behind}
    samples = {}
    for layer, (style, chosen) in enumerate(groups.items()):
        if not chosen.any():
            continue
        beams = LineCollection(
            list(lines[chosen]),
            colors=colour,
            linewidths=style.width,
            alpha=style.opacity,
            zorder=2 + layer,
            label=style.text,
        )
        axes.add_collection(beams)
        if style.marker:
            edge: dict[str, Any] = {"edgecolors": "white", "linewidths": 1.2}
            if style.marker == "x":
                edge = {"linewidths": 1.4}
            look: dict[str, Any] = {"marker": style.marker, "label": style.text, **edge}
            x, y = lines[chosen, 1].T
            axes.scatter(x, y, s=style.area, zorder=7, color=colour, **look)
        samples[style.text] = Line2D(
            [],
            [],
            color=colour,
            linewidth=style.width,
            marker=style.marker,
            markersize=style.area**0.5,
        )
    # The boldest was drawn last, and is the first to be explained.
    draw_legend(drawing, dict(reversed(samples.items())), "large")
    return drawing
