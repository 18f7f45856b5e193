"""Pictures of navigation runs: path, obstacles, hit points, leave points and goals."""

import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke

from radarsim.geometry import Floats
from radarsim.navigation.bug import Activity, Point
from radarsim.navigation.run_log import RunLog

FORMS: Final = ("png", "svg", "pdf")
AROUND: Final = 3.0  # m around the path that are shown
NO_LINES: Final = np.zeros((0, 2, 2))
LIGHTEST: Final = 0.95  # grey of cells where one beam ended
DARKEST: Final = 0.35  # grey of the cell where most beams ended
_MARGIN = 0.6  # m
_LONGEST = 9.5  # inches of the longer side
_TOGETHER = 0.35  # m; markers that are nearer share a label
_HALO = withStroke(linewidth=3, foreground="white")


@dataclass(frozen=True, slots=True)
class PathStyle:
    """Line style of the path during an activity."""

    text: str
    colour: str
    width: float
    zorder: float


GOING: Final = PathStyle("going to the goal", "#0072b2", 2.0, 4.0)
FOLLOWING: Final = PathStyle("following a boundary", "#e69f00", 2.6, 3.0)
RETURNING: Final = PathStyle("returning to the leave point", "#7b3294", 1.2, 3.5)
PATH_STYLES: Final = {
    Activity.ALIGNING: FOLLOWING,
    Activity.FOLLOWING: FOLLOWING,
    Activity.RETURNING: RETURNING,
}


def draw_run(
    run_log: RunLog, title: str, *, plan: Floats = NO_LINES, form: str = "png"
) -> bytes:
    """Draw a run.

    Args:
        run_log: The run; at least one row.
        title: Title of the picture.
        plan: Outlines of the map, (S, 2, 2) m.
        form: File format, one of ``FORMS``.

    Returns:
        The file; the same run gives the same bytes.
    """
    dates = {"png": "Software", "svg": "Date", "pdf": "CreationDate"}
    data = io.BytesIO()
    with rc_context({"svg.hashsalt": "radarsim"}):
        canvas = FigureCanvasAgg(figure_of(run_log, title, plan))
        metadata = {dates[form]: None}
        canvas.print_figure(data, format=form, metadata=metadata)
    return data.getvalue()


def figure_of(run_log: RunLog, title: str, plan: Floats = NO_LINES) -> Figure:
    """Draw a run; arguments as in ``draw_run``."""
    low, high = _extent(run_log)
    wide, tall = (high - low) * _LONGEST / max(high - low)
    layout = ConstrainedLayoutEngine(compress=True, w_pad=0.12, h_pad=0.1)
    size = (max(wide, 4.0) + 2.9, max(tall, 3.0) + 0.9)
    figure = Figure(figsize=size, dpi=110, layout=layout)
    axes = figure.add_subplot()
    rows = [
        *_draw_surroundings(axes, run_log, plan),
        *_draw_path(axes, run_log),
        *_draw_markers(axes, run_log),
    ]
    axes.set_aspect("equal")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.set_title(title, fontsize="medium", parse_math=False)
    figure.legend(
        handles=rows, loc="outside right upper", fontsize="small", frameon=False
    )
    return figure


def _extent(run_log: RunLog) -> tuple[Floats, Floats]:
    """Return the corners of the picture: the path, and beam ends near it."""
    ends = [end for line in run_log.goal_lines for end in (line.start, line.goal)]
    path = np.concatenate([run_log.path, np.array(ends).reshape(-1, 2)])
    low, high = path.min(axis=0), path.max(axis=0)
    beam_ends = run_log.beam_ends[:, :2]
    near = (beam_ends >= low - AROUND).all(axis=1) & (beam_ends <= high + AROUND).all(
        axis=1
    )
    shown = np.concatenate([path, beam_ends[near]])
    return shown.min(axis=0) - _MARGIN, shown.max(axis=0) + _MARGIN


def _draw_surroundings(axes: Axes, run_log: RunLog, plan: Floats) -> list[Line2D]:
    rows = []
    if len(plan):
        lines = LineCollection(list(plan), colors="black", linewidths=1.5, zorder=1.5)
        axes.add_collection(lines)
        rows.append(Line2D([], [], color="black", linewidth=1.5, label="map"))
    x, y, counts = run_log.beam_ends.T
    often = np.log1p(counts) / np.log1p(counts.max(initial=1.0))
    shades = LIGHTEST + (DARKEST - LIGHTEST) * often
    style: dict[str, Any] = {"cmap": "gray", "vmin": 0.0, "vmax": 1.0}
    axes.scatter(x, y, 3.0, shades, marker=".", **style, zorder=1.0)
    dots: dict[str, Any] = {"color": "0.45", "marker": ".", "linestyle": "none"}
    rows.append(Line2D([], [], **dots, markersize=5, label="sensed (darker: often)"))
    for line in run_log.goal_lines:
        ends = np.array([line.start, line.goal])
        axes.plot(*ends.T, "--", color="0.3", linewidth=1.0, zorder=2.0)
    dashes: dict[str, Any] = {"color": "0.3", "linestyle": "--", "linewidth": 1.0}
    rows.append(Line2D([], [], **dashes, label="line to the goal"))
    return rows


def _draw_path(axes: Axes, run_log: RunLog) -> list[Line2D]:
    """Draw the path coloured by activity; return the rows of the legend."""
    path = run_log.path
    activities = [row.activity for row in run_log.rows]
    styles = [PATH_STYLES.get(activity, GOING) for activity in activities]
    steps = np.stack([path[:-1], path[1:]], axis=1)
    rows = []
    for path_style in (GOING, FOLLOWING, RETURNING):
        chosen = np.array([one is path_style for one in styles[:-1]], dtype=np.bool_)
        if not chosen.any():
            continue
        style: dict[str, Any] = {
            "colors": path_style.colour,
            "linewidths": path_style.width,
        }
        lines = LineCollection(
            _chains(steps[chosen]), **style, zorder=path_style.zorder
        )
        axes.add_collection(lines)
        sample: dict[str, Any] = {
            "color": path_style.colour,
            "linewidth": path_style.width,
        }
        rows.append(Line2D([], [], **sample, label=path_style.text))
    return rows


def _chains(steps: Floats) -> list[Floats]:
    """Join consecutive steps, (S, 2, 2), so that lines have no gaps."""
    breaks = np.nonzero((steps[1:, 0] != steps[:-1, 1]).any(axis=1))[0] + 1
    return [
        np.concatenate([chain[:1, 0], chain[:, 1]]) for chain in np.split(steps, breaks)
    ]


@dataclass(frozen=True, slots=True)
class MarkerStyle:
    """Style of the markers of one kind.

    Attributes:
        text: Text in the legend.
        letter: Letter before the numbers of the labels.
        marker: Marker of matplotlib.
        colour: Colour of marker and label.
        size: Size in points.
        offset: Offset of the label from the marker, points.
    """

    text: str
    letter: str
    marker: str
    colour: str
    size: float
    offset: tuple[float, float]


START: Final = MarkerStyle("start", "S", "o", "#009e73", 8.0, (-9, -14))
GOAL: Final = MarkerStyle("goal", "G", "*", "#d55e00", 14.0, (8, -15))
HIT: Final = MarkerStyle("hit point", "H", "v", "#cc0000", 7.0, (-9, -15))
LEAVE: Final = MarkerStyle("leave point", "L", "^", "#006d2c", 7.0, (9, 8))
END: Final = MarkerStyle("end, goal not reached", "", "X", "black", 9.0, (0, 0))


def _draw_markers(axes: Axes, run_log: RunLog) -> list[Line2D]:
    last = run_log.rows[-1]
    ends = [] if last.goal is None else [(last.x, last.y)]
    return [
        *_draw_marker(axes, START, [line.start for line in run_log.goal_lines[:1]]),
        *_draw_marker(axes, HIT, run_log.hit_points),
        *_draw_marker(axes, LEAVE, run_log.leave_points),
        *_draw_marker(axes, GOAL, [line.goal for line in run_log.goal_lines]),
        *_draw_marker(axes, END, ends),
    ]


def _draw_marker(
    axes: Axes, marker_style: MarkerStyle, places: Sequence[Point]
) -> list[Line2D]:
    if not places:
        return []
    style: dict[str, Any] = {
        "color": marker_style.colour,
        "marker": marker_style.marker,
        "markersize": marker_style.size,
        "markeredgecolor": "white",
        "markeredgewidth": 0.8,
        "linestyle": "none",
    }
    axes.plot(*np.array(places).T, **style, zorder=5.0)
    numbered = marker_style in (HIT, LEAVE) or len(places) > 1
    for place, numbers in _groups(places):
        text = ", ".join(
            f"{marker_style.letter}{n if numbered else ''}" for n in numbers
        )
        if marker_style.letter:
            _label(axes, text, place, marker_style)
    return [Line2D([], [], **style, label=marker_style.text)]


def _label(axes: Axes, text: str, place: Point, marker_style: MarkerStyle) -> None:
    axes.annotate(
        text,
        place,
        xytext=marker_style.offset,
        textcoords="offset points",
        ha="right" if marker_style.offset[0] < 0 else "left",
        color=marker_style.colour,
        fontweight="bold",
        path_effects=[_HALO],
        zorder=6.0,
        annotation_clip=True,
    )


def _groups(places: Iterable[Point]) -> list[tuple[Point, list[int]]]:
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
