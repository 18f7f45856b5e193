"""Figures 9 and 10: the readings of the radar scatter as its side rays move apart."""

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from bushes import PLAIN
from common import (
    BUSHES,
    ROOM,
    STEP,
    Drawn,
    bush_parts,
    draw_legend,
    draw_room,
    draw_title,
    load_scene,
    object_names,
    take_scans,
)
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from radarsim.geometry import Floats
from radarsim.plotting.palette import MARKER, RADAR
from radarsim.plotting.style import scan_points
from radarsim.presets.sensor_settings import METRES_PER_UNIT
from radarsim.sensors.scan import Scan

OFFSETS: Final = (0, 50, 100)  # N, Unreal units
COUNT: Final = 20  # scans of figure 10
JOIN: Final[Any] = {"color": "0.45", "linewidth": 0.9, "linestyle": (0, (4, 2))}


def radar_scans(offset: int, count: int = 1) -> list[Scan]:
    """Scan the test map with side rays at an offset, Unreal units."""
    settings = {"side_offset_uu": offset} if offset else PLAIN
    return take_scans(ROOM, "radar", count, **settings)


def count_changes(scans: Sequence[Scan]) -> tuple[int, int, int]:
    """Count the beams whose range changes from scan to scan, by the cause.

    Returns:
        Number of beams that read different objects, that read the same solid object,
        and that always end in bushes.
    """
    changed = np.ptp([scan.ranges for scan in scans], axis=0) > STEP
    names = np.array([object_names(scan) for scan in scans])
    # Bushes overlap: from one to its neighbour a beam does not jump to another object.
    bushes = [bush.object_name for bush in bush_parts(load_scene(ROOM))]
    names[np.isin(names, bushes)] = BUSHES
    same, inside = (names == names[0]).all(axis=0), names[0] == BUSHES
    return (
        int((changed & ~same).sum()),
        int((changed & same & ~inside).sum()),
        int((changed & same & inside).sum()),
    )


class Sheet:
    """Plans of the test map side by side, one for each offset, and their legend."""

    def __init__(self) -> None:
        """Draw the plans."""
        self.drawing = Figure(figsize=(17, 4.9), dpi=120)
        self.samples: dict[str, Line2D] = {}
        places = [(0.004 + 0.3327 * column, 0.08, 0.326, 0.76) for column in range(3)]
        self.panels = [self.drawing.add_axes(place) for place in places]
        for axes in self.panels:
            draw_room(axes)

    def name_panel(self, axes: Axes, offset: int, text: str) -> None:
        """Write the offset of a panel and a text above it."""
        aside = f" ({offset * METRES_PER_UNIT:g} m)" if offset else ""
        axes.set_title(f"N = {offset}{aside}: {text}", fontsize="large", pad=2)

    def draw_dots(
        self, axes: Axes, text: str, points: Floats, colour: str, area: float
    ) -> None:
        """Draw readings, (N, 2) m, as dots of an area in square points."""
        if len(points):
            x, y = points.T
            axes.scatter(x, y, s=area, color=colour, linewidths=0, zorder=4)
            look: Any = {"marker": "o", "linestyle": "none", "markersize": area**0.5}
            self.samples[text] = Line2D([], [], color=colour, **look)

    def join(self, axes: Axes, text: str, lines: Floats) -> None:
        """Draw dashed lines between readings, (L, 2, 2) m."""
        if len(lines):
            axes.add_collection(LineCollection(list(lines), zorder=3, **JOIN))
            self.samples[text] = Line2D([], [], **JOIN)

    def finish(self, title: str) -> Figure:
        """Write the title and the legend; return the figure."""
        draw_title(self.drawing, title)
        draw_legend(self.drawing, self.samples, "large")
        return self.drawing


def draw_single_scans() -> tuple[Figure, str]:
    """Draw figure 9: how far the readings of one scan are off those without noise."""
    sheet, counted = Sheet(), []
    (reference,) = radar_scans(0)
    still, beams = scan_points(reference), len(reference.ranges)
    for axes, offset in zip(sheet.panels, OFFSETS, strict=True):
        (scan,) = radar_scans(offset)
        ends = scan_points(scan)
        off = np.abs(scan.ranges - reference.ranges) > STEP
        sheet.name_panel(axes, offset, f"{off.sum()} of {beams} beams are off")
        sheet.draw_dots(axes, "reading as without noise", ends[~off], MARKER, 10)
        sheet.draw_dots(axes, "reading that is off", ends[off], RADAR, 36)
        lines = np.stack([still, ends], axis=1)[off]
        sheet.join(axes, "how far it is off", lines)
        counted.append(f"{off.sum()} with N = {offset}")
    title = "One scan: the wider the side rays, the more readings are off"
    caption = (
        "Each beam is one of three rays, drawn by chance, that start N units apart."
        f" Of {beams} beams these read more than {100 * STEP:g} cm off what they read"
        f" with N = 0: {', '.join(counted)}."
    )
    return sheet.finish(title), caption


def draw_repeated_scans() -> tuple[Figure, str]:
    """Draw figure 10: how far the readings of many scans lie apart."""
    sheet, counted = Sheet(), []
    for axes, offset in zip(sheet.panels, OFFSETS, strict=True):
        scans = radar_scans(offset, COUNT)
        jumping, slanting, deep = count_changes(scans)
        points = np.array([scan_points(scan) for scan in scans])
        ranges = np.array([scan.ranges for scan in scans])
        changed = np.ptp(ranges, axis=0) > STEP
        text = f"{changed.sum()} of {len(changed)} beams change"
        sheet.name_panel(axes, offset, text)
        still, moved = (
            # readings of several scans often lie on each other
            np.unique(points[:, chosen].reshape(-1, 2), axis=0)
            for chosen in (~changed, changed)
        )
        within = f"reading that stays within {100 * STEP:g} cm in all scans"
        sheet.draw_dots(axes, within, still, MARKER, 10)
        sheet.draw_dots(axes, "reading of a beam that changes more", moved, RADAR, 18)
        ends = (ranges.argmin(axis=0), ranges.argmax(axis=0))
        pairs = [points[index, np.arange(len(changed))] for index in ends]
        lines = np.stack(pairs, axis=1)[changed]
        sheet.join(axes, "from its nearest to its farthest reading", lines)
        counted.append(
            f"with N = {offset} {changed.sum()}: {jumping} jump from one object to"
            f" another, {slanting} meet a solid object at a slant and {deep} end in"
            " bushes"
        )
    title = f"{COUNT} scans: the wider the side rays, the more readings scatter"
    caption = f"Beams whose range changes in {COUNT} scans: {'; '.join(counted)}."
    return sheet.finish(title), caption


def draw() -> Drawn:
    """Draw figures 9 and 10."""
    return {
        "figure_09.png": draw_single_scans(),
        "figure_10.png": draw_repeated_scans(),
    }
