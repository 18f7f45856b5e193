import io
import itertools
import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.text import Text
from matplotlib.transforms import Bbox
from PIL import Image

from radarsim.autonomy.mapping.occupancy_grid import CellClass
from radarsim.autonomy.navigation.control import STOP
from radarsim.autonomy.navigation.controller import Activity
from radarsim.autonomy.navigation.observation import Observation
from radarsim.autonomy.navigation.run_log import CELL, RunLog
from radarsim.autonomy.navigation.runner import NavigationStep
from radarsim.autonomy.plotting import runs
from radarsim.autonomy.plotting.outlines import Outline
from radarsim.autonomy.plotting.run_markers import STRONGEST
from radarsim.geometry import Floats, Point, Pose2
from radarsim.plotting.palette import (
    FAMILY_COLOURS,
    LASER,
    RADAR,
    TRUTH,
    UNKNOWN_SENSOR,
    Family,
)
from radarsim.plotting.style import FORMS, render

WALL = np.array([[1.5, -1.0], [2.0, -1.0], [2.0, 1.0], [1.5, 1.0], [1.5, -1.0]])
WALLS = Family.STONE.value
ROOM = 10 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1.0]])
PLAN = (Outline(CellClass.OBSTACLE, (WALL,)),)
TRUE = np.array([[0.0, 0.0], [1.0, 0.2], [4.0, 0.2]])
GOES, FOLLOWS, REACHES = Activity.GOING, Activity.FOLLOWING, Activity.REACHED
BUG1 = [
    *((0.0, 0.0, GOES), (1.0, 0.0, Activity.ALIGNING), (1.0, -1.5, FOLLOWS)),
    *((2.5, 1.5, FOLLOWS), (1.0, 0.0, Activity.RETURNING)),
    *((2.5, -0.2, GOES), (4.0, 0.0, REACHES)),
]
NO_PATH = [*BUG1[:4], (1.1, 0.0, Activity.NO_PATH)]
NEARLY_THE_SAME = [
    *((0.0, 0.0, GOES), (1.0, 0.0, FOLLOWS), (1.0, 0.1, GOES)),
    *((1.1, 0.1, FOLLOWS), (3.0, 1.0, GOES), (4.0, 0.0, REACHES)),
]
RANGES = (1.0, 2.0, 60.0, math.inf)


def record_of(
    *rows: tuple[float, float, Activity],
    goal: Point = (4.0, 0.0),
    ranges: tuple[float, ...] = RANGES,
    run_log: RunLog | None = None,
) -> RunLog:
    run_log = run_log or RunLog()
    for time, (x, y, activity) in enumerate(rows):
        bearings = np.arange(float(len(ranges)))
        observation = Observation(float(time), Pose2(x, y), bearings, np.array(ranges))
        next_goal = None if activity is REACHES else goal
        run_log.add(NavigationStep(observation, activity, STOP, (), next_goal))
    return run_log


def view_of(run_log: RunLog, title: str = "title", **options: Any) -> runs.RunView:
    options = {"robot_class": "P3AT_Radar360", **options}
    return runs.RunView(run_log, title, **options)


def figure_of(run_log: RunLog, **options: Any) -> Figure:
    return runs.run_figure([view_of(run_log, **options)])


def labels(figure: Figure) -> set[str]:
    texts = {text.get_text() for text in figure.axes[0].texts}
    return {text for text in texts if not text.endswith(" m")}  # the scale


def image_of(figure: Figure) -> AxesImage:
    """Return the cells in the first panel."""
    children = figure.axes[0].get_children()
    (image,) = (each for each in children if isinstance(each, AxesImage))
    return image


def legend(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def drawn(figure: Figure) -> dict[str, float]:
    """Give the length of the lines in each colour as a way or as the map."""
    lengths: dict[str, float] = {}
    for lines in figure.axes[0].collections:
        if isinstance(lines, LineCollection):
            ways = [np.asarray(way) for way in lines.get_segments()]
            steps = [np.hypot(*(b - a)) for way in ways for a, b in pairwise(way)]
            colours: Any = lines.get_color()
            lengths[to_hex(colours[0])] = float(sum(steps))
    return lengths


def test_path_is_coloured_by_activity() -> None:
    shown = drawn(figure_of(record_of(*BUG1), outlines=PLAN))
    assert shown == {
        runs.GOING.colour: pytest.approx(1.0 + math.hypot(1.5, 0.2)),
        runs.FOLLOWING.colour: pytest.approx(1.5 * (1 + math.sqrt(5) + math.sqrt(2))),
        runs.RETURNING.colour: pytest.approx(math.hypot(1.5, 0.2)),
    }


def test_start_goal_hit_and_leave_points_are_labelled() -> None:
    assert labels(figure_of(record_of(*BUG1))) == {"start", "goal", "H1", "L1"}


def test_close_points_share_a_label() -> None:
    texts = labels(figure_of(record_of(*NEARLY_THE_SAME)))
    assert texts == {"start", "goal", "H1, H2", "L1", "L2"}


def test_goal_that_is_not_reached_is_crossed_out() -> None:
    for rows, crossed in ((BUG1, False), (NO_PATH, True), (BUG1[:3], True)):
        figure = figure_of(record_of(*rows))
        assert ("goal, not reached" in legend(figure)) == crossed
        markers = {line.get_marker() for line in figure.axes[0].lines}
        assert ("X" in markers) == crossed != ("*" in markers)


def test_goal_of_a_run_that_goes_on_is_not_crossed_out_in_a_film() -> None:
    for rows, crossed in ((BUG1[:3], False), (NO_PATH, True)):
        figure = Figure()
        view = view_of(record_of(*rows), true_path=TRUE)
        runs.RunPanel(figure.add_subplot(), view).update(view, is_over=False)
        markers = {line.get_marker() for line in figure.axes[0].lines}
        assert ("X" in markers) == crossed


def test_hit_and_leave_points_have_the_colours_of_the_paths_that_begin_there() -> None:
    (axes,) = figure_of(record_of(*BUG1)).axes
    colours = {line.get_marker(): line.get_color() for line in axes.lines}
    assert (colours["v"], colours["^"]) == (runs.FOLLOWING.colour, runs.GOING.colour)


def test_what_is_sensed_does_not_cover_the_walls() -> None:
    rows = [(x, 0.0, GOES) for x in (0.55, 0.65, 0.75, 0.85)]
    areas = []
    extent = Bbox.from_extents(-2.0, -3.0, 6.0, 3.0)
    for each in (record_of(*rows), record_of(*rows, ranges=())):
        view = view_of(each, outlines=PLAN, true_path=TRUE[:1])
        frame = runs.RunFrames(extent, view).draw(view)
        grey = np.round(255 * np.array(to_rgb(FAMILY_COLOURS[Family.STONE])))
        areas.append(int((frame == grey).all(axis=2).sum()))
    assert areas[0] == areas[1] > 100


def test_several_goals_are_numbered() -> None:
    run_log = record_of((0.0, 0.0, GOES), goal=(1.0, 0.0))
    record_of(*BUG1, run_log=run_log)
    assert {"goal 1", "goal 2"} <= labels(figure_of(run_log))


def test_legend_lists_exactly_what_is_drawn() -> None:
    reached = legend(figure_of(record_of(*BUG1), outlines=PLAN, true_path=TRUE))
    returning = "returning to the leave point"
    assert {f"estimate, {returning}", WALLS, "true path, to the robot"} <= {*reached}
    failed = legend(figure_of(record_of(*NO_PATH)))
    absent = {WALLS, "leave point", returning}
    assert not any("true" in text or "estimate" in text for text in failed)
    assert not absent & {*failed}
    assert "hit point" in failed
    assert "sensed" in failed
    blind = record_of(BUG1[0], ranges=())
    assert "sensed" not in legend(figure_of(blind))


def test_axes_have_equal_scale_and_the_legend_is_outside() -> None:
    figure = figure_of(record_of(*BUG1), outlines=PLAN, subtitle="in 3 s")
    figure.draw_without_rendering()
    (axes,) = figure.axes
    frame = axes.get_window_extent()
    wide, tall = np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim())
    assert frame.width / wide == pytest.approx(frame.height / tall, rel=0.01)
    assert figure.legends[0].get_window_extent().y1 < frame.y0
    assert axes.get_title("left") == "title"
    assert "in 3 s" in labels(figure)


def test_narrow_pictures_show_all_texts_apart() -> None:
    poses = [(0.0, float(y), GOES) for y in range(12)]
    figure = figure_of(
        record_of(*poses, goal=(0.0, 12.0)),
        outlines=PLAN,
        true_path=TRUE,
        title="Bug2 reaches its goal in a place with a long name",
        subtitle="10.9 m in 37 s, in truth 0.11 m from the goal",
    )
    figure.draw_without_rendering()
    (axes,) = figure.axes
    title = axes.get_title("left")
    wanted = ("10.9 m in 37 s", "0.5 m", "1 m", "2 m")
    boxes = [
        text.get_window_extent()
        for text in axes.findobj(Text)
        if text.get_text() and text.get_text().startswith((title, *wanted))
    ]
    assert len(boxes) == 3  # title, subtitle, scale
    for one, other in itertools.combinations(boxes, 2):
        assert not one.overlaps(other)
    for box in (*boxes, figure.legends[0].get_window_extent()):
        assert figure.bbox.x0 <= box.x0 < box.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= box.y0 < box.y1 <= figure.bbox.y1


def test_runs_beside_each_other_have_one_scale() -> None:
    near = record_of((0.0, 0.0, GOES), goal=(1.0, 0.0))
    views = [view_of(record_of(*BUG1)), view_of(near)]
    one, other = runs.run_figure(views).axes
    assert one.viewLim.bounds == other.viewLim.bounds
    assert one.get_window_extent().size == pytest.approx(other.get_window_extent().size)


def test_true_path_is_drawn_beside_the_estimated_one() -> None:
    (axes,) = figure_of(record_of(*BUG1), true_path=TRUE).axes
    true = [line for line in axes.lines if line.get_color() == TRUTH]
    paths = [np.asarray(line.get_xydata()) for line in true or axes.lines]
    assert any(path.shape == TRUE.shape and (path == TRUE).all() for path in paths)


@pytest.mark.parametrize(("medium", "colour"), [("radar", RADAR), ("laser", LASER)])
def test_sensed_points_have_the_colour_of_the_sensor(medium: str, colour: str) -> None:
    figure = figure_of(record_of(*BUG1), medium=medium)
    cells = np.asarray(image_of(figure).get_array())
    shades = cells[cells[:, :, 3] > 0][:, :3] / 255
    assert {to_hex(shade) for shade in shades} == {colour}
    assert f"sensed by the {medium}" in legend(figure)


def test_far_points_do_not_enlarge_the_extent() -> None:
    (axes,) = figure_of(record_of(*BUG1)).axes
    assert np.ptp(axes.get_xlim()) < 4.0 + 2 * runs.AROUND + 2


def test_cells_with_more_beam_ends_are_more_opaque() -> None:
    image = image_of(figure_of(record_of(*[(0.0, 0.0, GOES)] * 5, *BUG1)))
    west, _, south, _ = image.get_extent()
    shades = np.asarray(image.get_array())[:, :, 3]
    ahead = shades[int((0.0 - south) / CELL), int((1.0 - west) / CELL)]
    assert ahead == shades.max() > shades[shades > 0].min()


def log_of_ends(ends: Floats) -> RunLog:
    """Log one scan whose beams end at places, (N, 2) m."""
    angles, ranges = np.arctan2(*ends.T[::-1]), np.hypot(*ends.T)
    run_log = RunLog()
    observation = Observation(0.0, Pose2(0.0, 0.0), angles, ranges)
    run_log.add(NavigationStep(observation, GOES, STOP, (), (-1.0, 0.0)))
    return run_log


@pytest.mark.parametrize("width", [6.0, 6.37, 7.11])
def test_no_seam_is_left_between_sensed_cells(width: float) -> None:
    middles = (np.arange(40) + 0.5) * CELL
    ends = np.stack(np.meshgrid(middles, middles), axis=-1).reshape(-1, 2)
    extent = Bbox.from_extents(-2.0, -1.0, width - 2.0, 3.0)
    view = view_of(log_of_ends(ends + np.array([1.0, 0.5])))
    frame = runs.RunFrames(extent, view).draw(view)
    colour = np.array(to_rgb(UNKNOWN_SENSOR)) * 255 * STRONGEST + 255 * (1 - STRONGEST)
    painted = np.all(np.abs(frame - colour) < 3, axis=2).astype(np.int64)
    rows, columns = (np.nonzero(painted.sum(axis=axis) > 50)[0] for axis in (1, 0))
    area = painted[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    assert area.size > 10_000
    assert area.all()


def test_foliage_stays_green_where_it_is_sensed() -> None:
    middles = (np.arange(20) + 0.5) * CELL
    ends = np.stack(np.meshgrid(middles + 1.5, middles - 0.5), axis=-1).reshape(-1, 2)
    bush = (Outline(CellClass.FOLIAGE, (WALL,), Family.FOLIAGE),)
    figure = runs.run_figure([view_of(log_of_ends(ends), outlines=bush)])
    cells = np.asarray(image_of(figure).get_array())
    west, east, *_ = image_of(figure).get_extent()
    assert (cells[:, :, 3] > 0).any()
    assert west == pytest.approx(2.0)  # from where on there is no foliage
    (dots,) = (c for c in figure.axes[0].collections if isinstance(c, PathCollection))
    places = np.asarray(dots.get_offsets())
    assert len(places) > 10
    assert places[:, 0].max() < 2.1 < east
    assert "sensed in foliage" in legend(figure)


def test_film_of_a_robot_that_goes_round_a_thing_keeps_its_frame() -> None:
    box = Outline(CellClass.OBSTACLE, (WALL * 2,))
    extent = runs.first_run_extent((box,), (0.0, 0.0), [(6.0, 0.0)])
    frames = None
    around = [(2.0, -3.3), (5.2, -3.3), (5.2, 3.3), (2.0, 3.3)]
    places = [(0.0, 0.0), *around, (6.0, 0.0)]
    shown = []
    for number in range(1, len(places) + 1):
        rows = [(x, y, Activity.FOLLOWING) for x, y in places[:number]]
        view = view_of(record_of(*rows, goal=(6.0, 0.0)), outlines=(box,))
        frames = frames or runs.RunFrames(extent, view)
        frames.draw(view)
        shown.append(frames.axes.viewLim.bounds)
    assert {*shown} == {extent.bounds}
    room = Outline(CellClass.OBSTACLE, (ROOM,))
    assert runs.first_run_extent((room,), (0.0, 0.0), [(6.0, 0.0)]).width < 20 + 2


def test_film_may_change_its_title() -> None:
    run_log, extent = record_of(*BUG1), Bbox.from_extents(-1.0, -2.0, 5.0, 2.0)
    frames = runs.RunFrames(extent, view_of(run_log, "drives"))
    before, after, again = (
        frames.draw(view_of(run_log, title))
        for title in ("drives", "reaches", "drives")
    )
    assert (before != after).any()
    assert (before == again).all()


def test_arrows_follow_the_path_at_equal_distances() -> None:
    square = np.array([[0, 0], [4, 0], [4, 4], [0, 4], [0, 0.0]])
    places = runs.arrow_places(square, 4.0)
    assert places[:, :2] == pytest.approx(
        np.array([[2, 0], [4, 2], [2, 4], [0, 2]], dtype=float)
    )
    turns = np.cos(places[:, 2]), np.sin(places[:, 2])
    assert np.column_stack(turns) == pytest.approx(
        np.array([[1, 0], [0, 1], [-1, 0], [0, -1]], dtype=float)
    )
    assert not len(runs.arrow_places(square[:1], 4.0))
    assert not len(runs.arrow_places(square[[0, 0]], 4.0))


def test_things_at_the_edge_are_shown_whole_unless_they_are_large() -> None:
    run_log = record_of(*BUG1)
    bare = view_of(run_log).extent
    bush = WALL + np.array([0.0, bare.y0 - WALL[0, 1] - 1.0])
    cut = view_of(run_log, outlines=(Outline(CellClass.OBSTACLE, (bush,)),)).extent
    assert cut.y0 == pytest.approx(bush[:, 1].min() - 0.3)
    room = view_of(
        run_log, outlines=(Outline(CellClass.OBSTACLE, (WALL * 40,)),)
    ).extent
    assert room.bounds == bare.bounds


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
        render(runs.run_figure([view_of(record_of(*NO_PATH), outlines=PLAN)]), form)
        for _ in "ab"
    )
    assert once == again
    assert once.startswith(begins)


def test_run_without_motion_can_be_drawn() -> None:
    run_log = record_of((0.0, 0.0, GOES), goal=(0.0, 0.0))
    data = render(runs.run_figure([view_of(run_log)], numbers=True))
    with Image.open(io.BytesIO(data)) as image:
        assert min(image.size) > 300
