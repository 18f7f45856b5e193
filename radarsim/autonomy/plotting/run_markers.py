"""Markers of a navigation run: start, goals, hit points and leave points.

A hit point has the colour of the path that begins there, along a boundary, and a leave
point that of the path to the goal. A goal that the robot does not reach is crossed out.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from radarsim.autonomy.navigation.controller import Activity
from radarsim.autonomy.navigation.run_log import RunLog
from radarsim.geometry import Point
from radarsim.plotting.palette import FOLLOWING, GOING, MARKER, PAPER, TARGET
from radarsim.plotting.style import HALO

_TOGETHER: Final = 0.35  # m; markers that are nearer share a label


@dataclass(frozen=True, slots=True)
class MarkerStyle:
    """Style of the markers of one kind.

    Attributes:
        text: Text in the legend; empty if the labels say enough.
        label: Label; numbers follow if there are several.
        marker: Marker of matplotlib.
        size: Size in points.
        offset: Offset of the label from the marker, points.
        colour: Colour within its edge.
    """

    text: str
    label: str
    marker: str
    size: float
    offset: tuple[float, float]
    colour: str

    @property
    def options(self) -> dict[str, Any]:
        """Options of matplotlib for the marker."""
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
    """Return where a run has markers, by their style; only styles that it has.

    Args:
        run_log: The run.
        is_over: Whether a goal that is not reached by now never will be.
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
    axes: Axes, run_log: RunLog, *, text: float, is_over: bool = True
) -> list[Artist]:
    """Draw the markers of a run, and their labels.

    Args:
        axes: Axes in m, map frame.
        run_log: The run.
        text: Size of labels, points.
        is_over: Whether a goal that is not reached by now never will be.
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
    """Return the rows of a legend for markers of some styles that need one."""
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
    """Number points, and group those that lie close to each other."""
    groups: list[tuple[Point, list[int]]] = []
    for number, place in enumerate(places, count_from):
        for first, numbers in groups:
            if np.hypot(first[0] - place[0], first[1] - place[1]) < _TOGETHER:
                numbers.append(number)
                break
        else:
            groups.append((place, [number]))
    return groups
