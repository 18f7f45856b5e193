import io
import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from PIL import Image

from radarsim.geometry import Pose2
from radarsim.navigation.bug import Activity, Point
from radarsim.navigation.control import STOP
from radarsim.navigation.observation import Observation
from radarsim.navigation.run_log import RunLog
from radarsim.navigation.runner import NavigationStep
from radarsim.plotting.runs import (
    AROUND,
    FOLLOWING,
    FORMS,
    GOING,
    RETURNING,
    draw_run,
    figure_of,
)

PLAN = np.array([[[1.5, -1.0], [1.5, 1.0]], [[1.5, 1.0], [2.0, 1.0]]])
BUG1 = [
    *(
        (0.0, 0.0, Activity.GOING),
        (1.0, 0.0, Activity.ALIGNING),
        (1.0, -1.5, Activity.FOLLOWING),
    ),
    *((2.5, 1.5, Activity.FOLLOWING), (1.0, 0.0, Activity.RETURNING)),
    *((2.5, -0.2, Activity.GOING), (4.0, 0.0, Activity.REACHED)),
]
NO_PATH = [*BUG1[:4], (1.1, 0.0, Activity.NO_PATH)]
NEARLY_THE_SAME = [
    *(
        (0.0, 0.0, Activity.GOING),
        (1.0, 0.0, Activity.FOLLOWING),
        (1.0, 0.1, Activity.GOING),
    ),
    *(
        (1.1, 0.1, Activity.FOLLOWING),
        (3.0, 1.0, Activity.GOING),
        (4.0, 0.0, Activity.REACHED),
    ),
]


def record_of(*rows: tuple[float, float, Activity], goal: Point = (4.0, 0.0)) -> RunLog:
    run_log = RunLog()
    for time, (x, y, activity) in enumerate(rows):
        ranges = np.array([1.0, 2.0, 60.0, math.inf])
        observation = Observation(float(time), Pose2(x, y), np.arange(4.0), ranges)
        next_goal = None if activity is Activity.REACHED else goal
        run_log.add(NavigationStep(observation, activity, STOP, (), next_goal))
    return run_log


def labels(figure: Figure) -> set[str]:
    return {text.get_text() for text in figure.axes[0].texts}


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def drawn(figure: Figure) -> dict[str, float]:
    """Give the length of what is drawn in each colour as a way or as the map."""
    lengths: dict[str, float] = {}
    for lines in figure.axes[0].collections:
        if isinstance(lines, LineCollection):
            ways = [np.asarray(way) for way in lines.get_segments()]
            steps = [np.hypot(*(b - a)) for way in ways for a, b in pairwise(way)]
            colours: Any = lines.get_color()
            lengths[to_hex(colours[0])] = float(sum(steps))
    return lengths


def test_path_is_coloured_by_activity() -> None:
    shown = drawn(figure_of(record_of(*BUG1), "", PLAN))
    assert shown == {
        "#000000": pytest.approx(2.5),
        GOING.colour: pytest.approx(1.0 + math.hypot(1.5, 0.2)),
        FOLLOWING.colour: pytest.approx(1.5 * (1 + math.sqrt(5) + math.sqrt(2))),
        RETURNING.colour: pytest.approx(math.hypot(1.5, 0.2)),
    }


def test_start_goal_hit_and_leave_points_are_labelled() -> None:
    assert labels(figure_of(record_of(*BUG1), "")) == {"S", "G", "H1", "L1"}


def test_close_points_share_a_label() -> None:
    texts = labels(figure_of(record_of(*NEARLY_THE_SAME), ""))
    assert texts == {"S", "G", "H1, H2", "L1", "L2"}


def test_several_goals_are_numbered() -> None:
    run_log = record_of((0.0, 0.0, Activity.GOING), goal=(1.0, 0.0))
    for row in record_of(*BUG1).rows:
        observation = Observation(
            row.time, Pose2(row.x, row.y), np.zeros(0), np.zeros(0)
        )
        run_log.add(NavigationStep(observation, row.activity, STOP, (), row.goal))
    assert {"G1", "G2"} <= labels(figure_of(run_log, ""))


def test_legend_lists_exactly_what_is_drawn() -> None:
    reached = legend(figure_of(record_of(*BUG1), "", PLAN))
    assert "returning to the leave point" in reached
    assert "map" in reached
    assert "end, goal not reached" not in reached
    failed = legend(figure_of(record_of(*NO_PATH), ""))
    assert "end, goal not reached" in failed
    assert not {"map", "leave point", "returning to the leave point"} & {*failed}


def test_axes_have_equal_scale_and_the_legend_is_outside() -> None:
    figure = figure_of(record_of(*BUG1), "title", PLAN)
    figure.draw_without_rendering()
    (axes,) = figure.axes
    frame = axes.get_window_extent()
    wide, tall = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
    assert frame.width / wide == pytest.approx(frame.height / tall)
    assert figure.legends[0].get_window_extent().x0 > frame.x1
    assert axes.get_title() == "title"


def test_far_points_do_not_enlarge_the_extent() -> None:
    (axes,) = figure_of(record_of(*BUG1), "").axes
    assert np.ptp(axes.get_xlim()) < 4.0 + 2 * AROUND + 2


def test_cells_with_more_beam_ends_are_darker() -> None:
    (axes,) = figure_of(record_of(*[(0.0, 0.0, Activity.GOING)] * 5, *BUG1), "").axes
    (dots,) = (each for each in axes.collections if isinstance(each, PathCollection))
    shades, places = np.asarray(dots.get_array()), np.asarray(dots.get_offsets())
    ahead = np.hypot(*(places - (1.0, 0.0)).T).argmin()
    assert shades[ahead] == shades.min() < shades.max()


@pytest.mark.parametrize(
    ("form", "begins"),
    [
        pytest.param("png", b"\x89PNG", id="png"),
        pytest.param("svg", b"<?xml", id="svg"),
        pytest.param("pdf", b"%PDF", id="pdf"),
    ],
)
def test_the_same_run_gives_the_same_file(form: str, begins: bytes) -> None:
    assert form in FORMS
    once, again = (
        draw_run(record_of(*NO_PATH), "no path", plan=PLAN, form=form) for _ in "ab"
    )
    assert once == again
    assert once.startswith(begins)


def test_run_without_motion_can_be_drawn() -> None:
    data = draw_run(
        record_of((0.0, 0.0, Activity.GOING), goal=(0.0, 0.0)), "broken off"
    )
    with Image.open(io.BytesIO(data)) as image:
        assert min(image.size) > 300
