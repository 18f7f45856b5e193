"""Markers of a navigation run: start, goals, hit and leave points, sensed cells.

A hit point has the colour of the boundary path that begins there, and a leave point the
colour of the path to the goal. A cross marks a goal that the robot does not reach.

Cells where beams ended are tinted; inside foliage and smoke they are dots.
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import shapely
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.lines import Line2D
from matplotlib.transforms import Bbox

from radarsim.autonomy.mapping.occupancy_grid import CellClass
from radarsim.autonomy.navigation.controller import Activity
from radarsim.autonomy.navigation.run_log import CELL, RunLog
from radarsim.autonomy.plotting.outlines import Outline
from radarsim.autonomy.plotting.panels import add_cell_image, show_cells
from radarsim.geometry import Floats, Point
from radarsim.plotting.palette import FOLLOWING, GOING, MARKER, PAPER, TARGET
from radarsim.plotting.style import HALO, figure_of
from radarsim.robots.obstacles import area_within

FAINTEST, STRONGEST = 0.12, 0.5  # opacity at one beam end, and at the most
_BLOCK: Final = 3  # cells along a side of the square of a dot
_LEAST, _MOST = 0.2, 0.5  # diameter of a dot, relative to its square
_SAMPLE: Final = 7.0  # points; size of a cell in the legend
_DOT_SAMPLE: Final = 3.0  # points; size of a dot in the legend
_ENTERED: Final = (CellClass.FOLIAGE, CellClass.SMOKE)  # beams can enter these
_CELL_ZORDER: Final = 2.5
_TOGETHER: Final = 0.35  # m; nearer markers share a label


@dataclass(frozen=True, slots=True)
class MarkerStyle:
    """How the markers of one kind are drawn.

    Attributes:
        text: Text in the legend; empty if labels are sufficient.
        label: Label; followed by numbers if there are several markers.
        marker: Matplotlib marker.
        size: Size in points.
        offset: Offset of the label from the marker, points.
        colour: Fill colour.
    """

    text: str
    label: str
    marker: str
    size: float
    offset: tuple[float, float]
    colour: str

    @property
    def options(self) -> dict[str, Any]:
        """Options of the marker for matplotlib."""
        return {
            "color": self.colour,
            "marker": self.marker,
            "markersize": self.size,
            "markeredgecolor": MARKER,
            "markeredgewidth": 1.0,
            "linestyle": "none",
        }


START: Final = MarkerStyle("", "start", "o", 9.0, (0, 6), PAPER)
GOAL: Final = MarkerStyle("", "goal", "*", 19.0, (0, -17), TARGET)
MISSED: Final = MarkerStyle("goal, not reached", "goal", "X", 14.0, (0, -10), TARGET)
HIT: Final = MarkerStyle("hit point", "H", "v", 11.0, (-8, -4), FOLLOWING)
LEAVE: Final = MarkerStyle("leave point", "L", "^", 11.0, (8, 4), GOING)
STYLES: Final = (START, HIT, LEAVE, GOAL, MISSED)


def marker_places(
    run_log: RunLog, *, is_over: bool = True
) -> dict[MarkerStyle, list[Point]]:
    """Return the positions of a run's markers, by their styles.

    Args:
        run_log: The run.
        is_over: Whether the run has ended, so that an unreached goal is missed.
    """
    goals = [leg.goal for leg in run_log.legs]
    activity = run_log.rows[-1].activity
    is_missed = activity is Activity.NO_PATH
    if is_over:
        is_missed = activity is not Activity.REACHED
    reached = len(goals) - is_missed
    places = {
        START: [leg.start for leg in run_log.legs[:1]],
        HIT: run_log.hit_points,
        LEAVE: run_log.leave_points,
        GOAL: goals[:reached],
        MISSED: goals[reached:],
    }
    return {style: points for style, points in places.items() if points}


def draw_markers(
    axes: Axes, run_log: RunLog, *, text: float, is_over: bool
) -> list[Artist]:
    """Draw the markers of a run and their labels.

    Args:
        axes: Axes in m, map frame.
        run_log: The run.
        text: Size of labels, points.
        is_over: Whether the run has ended, so that an unreached goal is missed.
    """
    drawn: list[Artist] = []
    goals = len(run_log.legs)
    for style, points in marker_places(run_log, is_over=is_over).items():
        drawn += axes.plot(*np.array(points).T, **style.options, zorder=7.0)
        is_goal = style in (GOAL, MISSED)
        first = goals if style is MISSED else 1
        numbered = style in (HIT, LEAVE) or (is_goal and goals > 1)
        space = " " if is_goal else ""
        for place, numbers in _groups(points, first):
            texts = (f"{space}{number}" if numbered else "" for number in numbers)
            names = (f"{style.label}{text}" for text in texts)
            drawn.append(_label(axes, ", ".join(names), place, style, text))
    return drawn


def marker_rows(styles: Collection[MarkerStyle]) -> list[Artist]:
    """Return the rows of a legend for marker styles that have a legend text."""
    return [
        Line2D([], [], **style.options, label=style.text)
        for style in STYLES
        if style.text and style in styles
    ]


def _label(
    axes: Axes, text: str, place: Point, style: MarkerStyle, size: float
) -> Artist:
    right, up = style.offset
    return axes.annotate(
        text,
        place,
        xytext=style.offset,
        textcoords="offset points",
        ha="center" if right == 0 else "left" if right > 0 else "right",
        va="bottom" if up > 0 else "top",
        color=MARKER,
        fontsize=size,
        fontweight="bold",
        path_effects=[HALO],
        zorder=8.0,
        annotation_clip=True,
    )


def _groups(places: Sequence[Point], count_from: int) -> list[tuple[Point, list[int]]]:
    """Number points in order, and group the points that are close to each other."""
    groups: list[tuple[Point, list[int]]] = []
    for number, place in enumerate(places, count_from):
        for first, numbers in groups:
            if np.hypot(first[0] - place[0], first[1] - place[1]) < _TOGETHER:
                numbers.append(number)
                break
        else:
            groups.append((place, [number]))
    return groups


class SensedCells:
    """Draws the cells where beams ended; more beam ends make a cell more opaque.

    Cells in the open are tinted. A tint over foliage would look like another material,
    so each square of a few cells has a dot there, which does not change the colour of
    foliage.
    """

    def __init__(self, axes: Axes, colour: str, outlines: Sequence[Outline]) -> None:
        """Create an image without cells.

        Args:
            axes: The panel, m, map frame, with its limits.
            colour: Colour of sensed cells.
            outlines: True outlines of the scene.
        """
        self._axes, self._colour = axes, colour
        self._image = add_cell_image(axes, zorder=_CELL_ZORDER)
        entered = [each for each in outlines if each.kind in _ENTERED]
        lines = [shapely.linestrings(line) for each in entered for line in each.lines]
        self._entered = area_within(shapely.geometrycollections(lines))
        shapely.prepare(self._entered)
        self._dots: list[Artist] = []

    def update(self, run_log: RunLog) -> None:
        """Show the cells within the panel that a run has sensed so far."""
        for artist in self._dots:
            artist.remove()
        ends = run_log.beam_ends
        # A film zooms out during the run, so cells outside come into view later.
        low, high = self._axes.viewLim.min, self._axes.viewLim.max
        shown = ((ends[:, :2] > low) & (ends[:, :2] < high)).all(axis=1)
        within = shapely.contains_xy(self._entered, ends[:, 0], ends[:, 1])
        most = ends[:, 2].max(initial=1.0)
        self._tint(ends[shown & ~within], most)
        self._dots = self._draw_dots(ends[shown & within], most * _BLOCK)

    @property
    def artists(self) -> list[Artist]:
        """All artists that draw the sensed cells."""
        return [self._image, *self._dots]

    def _tint(self, ends: Floats, most: float) -> None:
        """Tint cells where beams ended, (M, 3); see ``RunLog.beam_ends``."""
        cells = np.floor(ends[:, :2] / CELL).astype(np.int64)
        if not len(cells):
            # An image has at least one cell; this one is transparent.
            cells, ends = np.zeros((1, 2), np.int64), np.zeros((1, 3))
        first, last = cells.min(axis=0), cells.max(axis=0) + 1
        columns, rows = last - first
        pixels = np.zeros((rows, columns, 4), np.uint8)
        pixels[:, :, :3] = np.round(255 * np.array(to_rgb(self._colour)))
        # Counts are drawn on a log scale, since cells near the robot contain a hundred
        # times as many beam ends as distant cells.
        often = np.log1p(ends[:, 2]) / np.log1p(most)
        opacity = (FAINTEST + (STRONGEST - FAINTEST) * often) * (ends[:, 2] > 0)
        x, y = (cells - first).T
        pixels[y, x, 3] = np.round(255 * opacity)
        show_cells(self._image, pixels, Bbox(np.array([first, last]) * CELL))

    def _draw_dots(self, ends: Floats, most: float) -> list[Artist]:
        """Draw a dot in each square that contains beam ends, (M, 3)."""
        if not len(ends):
            return []
        side = _BLOCK * CELL
        squares = np.floor(ends[:, :2] / side).astype(np.int64)
        places, numbers = np.unique(squares, axis=0, return_inverse=True)
        # numpy 2.0 returns the inverse in another shape than all other versions.
        counts = np.bincount(numbers.reshape(-1), ends[:, 2])
        often = np.minimum(np.log1p(counts) / np.log1p(most), 1.0)
        axes = self._axes
        points = side * axes.bbox.width / axes.viewLim.width * 72 / figure_of(axes).dpi
        sizes = (points * (_LEAST + (_MOST - _LEAST) * often)) ** 2
        x, y = ((places + 0.5) * side).T
        style: dict[str, Any] = {"color": self._colour, "linewidths": 0.0}
        return [axes.scatter(x, y, sizes, **style, zorder=_CELL_ZORDER)]


def sensed_rows(colour: str, by: str, outlines: Iterable[Outline]) -> list[Artist]:
    """Return the rows of a legend for sensed cells.

    Args:
        colour: Colour of sensed cells.
        by: Text that follows ``sensed``, such as `` by the radar``.
        outlines: True outlines of the scene.
    """
    cell: dict[str, Any] = {"color": colour, "alpha": STRONGEST, "marker": "s"}
    plain: dict[str, Any] = {"markeredgewidth": 0.0, "linestyle": "none"}
    label = f"sensed{by}"
    rows: list[Artist] = [
        Line2D([], [], **cell, markersize=_SAMPLE, **plain, label=label)
    ]
    kinds = {outline.kind for outline in outlines}
    if names := [kind.name.lower() for kind in _ENTERED if kind in kinds]:
        dot: dict[str, Any] = {"color": colour, "marker": "o", **plain}
        label = f"sensed in {' or '.join(names)}"
        rows.append(Line2D([], [], **dot, markersize=_DOT_SAMPLE, label=label))
    return rows
