"""Figures 7 and 8: the Hokuyo is stopped by the bushes, the radar sees through them."""

from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from radarsim.figures.figure import DrawnFigure, draw_small_print, draw_title
from radarsim.figures.foliage_wall import (
    FAR,
    bush_parts,
    count_ends,
    count_over_grid,
    far_side,
    hokuyo,
    radar,
)
from radarsim.figures.room_plan import draw_room, name_hidden_objects, new_sheet
from radarsim.figures.scan_spec import ScanSpec, hit_points, object_names
from radarsim.geometry import Floats
from radarsim.plotting.annotations import as_words
from radarsim.plotting.palette import LASER, RADAR
from radarsim.sensors.range_scanner import load_sensor
from radarsim.sensors.scan import Scan


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
    _draw_legend(drawing, colour, [each for each, some in groups.items() if some.any()])
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


def _draw_legend(drawing: Figure, colour: str, styles: list[BeamStyle]) -> None:
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
