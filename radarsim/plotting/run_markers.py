"""Markers of a navigation run: start, goals, hit points, leave points and the end."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from radarsim.navigation.bug import Point
from radarsim.navigation.run_log import RunLog
from radarsim.plotting.annotations import HALO
from radarsim.plotting.palette import MARKER

_TOGETHER: Final = 0.35  # m; markers that are nearer share a label


@dataclass(frozen=True, slots=True)
class MarkerStyle:
    """Style of the markers of one kind.

    Attributes:
        text: Text in the legend.
        letter: Letter before the numbers of the labels.
        marker: Marker of matplotlib.
        size: Size in points.
        offset: Offset of the label from the marker, points.
    """

    text: str
    letter: str
    marker: str
    size: float
    offset: tuple[float, float]

    @property
    def options(self) -> dict[str, Any]:
        """Options of matplotlib for the marker."""
        return {
            "color": MARKER,
            "marker": self.marker,
            "markersize": self.size,
            "markeredgecolor": "white",
            "markeredgewidth": 0.8,
            "linestyle": "none",
        }


START: Final = MarkerStyle("start", "S", "o", 8.0, (-9, -14))
GOAL: Final = MarkerStyle("goal", "G", "*", 15.0, (8, -15))
HIT: Final = MarkerStyle("hit point", "H", "v", 8.0, (-9, -15))
LEAVE: Final = MarkerStyle("leave point", "L", "^", 8.0, (9, 8))
STYLES: Final = (START, HIT, LEAVE, GOAL)


def marker_places(run_log: RunLog) -> dict[MarkerStyle, list[Point]]:
    """Return where a run has markers, by their style; only styles that it has."""
    places = {
        START: [line.start for line in run_log.goal_lines[:1]],
        HIT: run_log.hit_points,
        LEAVE: run_log.leave_points,
        GOAL: [line.goal for line in run_log.goal_lines],
    }
    return {style: points for style, points in places.items() if points}


def draw_markers(axes: Axes, run_log: RunLog, *, text: float) -> list[Artist]:
    """Draw the markers of a run, and their labels.

    Args:
        axes: Axes in m, map frame.
        run_log: The run.
        text: Size of labels, points.
    """
    drawn: list[Artist] = []
    for style, points in marker_places(run_log).items():
        drawn += axes.plot(*np.array(points).T, **style.options, zorder=7.0)
        numbered = style in (HIT, LEAVE) or len(points) > 1
        for place, numbers in _groups(points):
            names = (f"{style.letter}{n if numbered else ''}" for n in numbers)
            drawn.append(_label(axes, ", ".join(names), place, style, text))
    return drawn


def marker_rows(styles: Iterable[MarkerStyle]) -> list[Artist]:
    """Return the rows of a legend for markers of some styles."""
    return [Line2D([], [], **style.options, label=style.text) for style in styles]


def _label(
    axes: Axes, text: str, place: Point, style: MarkerStyle, size: float
) -> Artist:
    return axes.annotate(
        text,
        place,
        xytext=style.offset,
        textcoords="offset points",
        ha="right" if style.offset[0] < 0 else "left",
        color=MARKER,
        fontsize=size,
        fontweight="bold",
        path_effects=[HALO],
        zorder=8.0,
        annotation_clip=True,
    )


def _groups(places: Sequence[Point]) -> list[tuple[Point, list[int]]]:
    """Number points from 1, and group those that lie close to each other."""
    groups: list[tuple[Point, list[int]]] = []
    for number, place in enumerate(places, 1):
        for first, numbers in groups:
            if np.hypot(first[0] - place[0], first[1] - place[1]) < _TOGETHER:
                numbers.append(number)
                break
        else:
            groups.append((place, [number]))
    return groups
