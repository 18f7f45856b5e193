import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.client import RobotInfo, teleop_view

COLUMNS, ROWS = 40, 20
STYLES = ("low", "high")


def cells(lines: list[teleop_view.Fragments]) -> list[list[tuple[str, str]]]:
    return [
        [(style, letter) for style, text in line for letter in text] for line in lines
    ]


def drawn(
    robot_info: RobotInfo, *points: tuple[float, float], radius: float = 10.0
) -> dict[tuple[int, int], str]:
    """Return the styles of drawn cells by row and column, without the last row."""
    places = np.array(points).reshape(-1, 2)
    grid = cells(teleop_view.draw_view(places, robot_info, radius, COLUMNS, ROWS))
    return {
        (row, column): style
        for row, line in enumerate(grid[:-1])
        for column, (style, _) in enumerate(line)
        if style
    }


MIDDLE = (ROWS // 2, COLUMNS // 2)


@pytest.mark.parametrize(
    ("point", "row", "column"),
    [
        ((8.0, 0.0), 2, 20),
        ((-8.0, 0.0), 18, 20),
        ((0.0, 8.0), 10, 4),
        ((0.0, -8.0), 10, 36),
    ],
)
def test_view_shows_the_robot_facing_up_with_true_proportions(
    robot_info: RobotInfo, point: tuple[float, float], row: int, column: int
) -> None:
    # 80 dots across and down: 4 to a metre, so 8 m are 8 rows or 16 columns.
    assert drawn(robot_info, point) == {
        MIDDLE: "class:robot",
        (row, column): "class:far",
    }


def test_zooming_in_spreads_points_and_hides_far_ones(robot_info: RobotInfo) -> None:
    assert len(drawn(robot_info, (4.0, 0.0), (4.0, -0.5), radius=20.0)) == 2
    assert len(drawn(robot_info, (4.0, 0.0), (4.0, 1.0), radius=5.0)) == 3
    hull = drawn(robot_info, radius=2.0)
    assert drawn(robot_info, (4.0, 0.0), (4.0, 1.0), radius=2.0) == hull


@pytest.mark.parametrize(
    ("distance", "style"),
    [
        (0.6, "class:near"),
        (0.7, "class:middle"),
        (1.3, "class:middle"),
        (1.4, "class:far"),
    ],
)
@pytest.mark.parametrize("angle", [0.0, 2.0])
def test_colours_depend_on_distance(
    robot_info: RobotInfo, distance: float, style: str, angle: float
) -> None:
    assert robot_info.clearance == pytest.approx(0.36, abs=0.01)
    assert teleop_view.style_of(distance, robot_info.clearance) == style
    point = distance * math.cos(angle), distance * math.sin(angle)
    assert style in drawn(robot_info, point, radius=2.0).values()


def test_hull_is_drawn_to_scale_when_zoomed_in(robot_info: RobotInfo) -> None:
    # At 1 m a metre is 10 rows or 20 columns: the hull is 6 rows long, 8 columns wide.
    hull = drawn(robot_info, radius=1.0)
    rows, columns = ({place[i] for place in hull} for i in (0, 1))
    assert max(rows) - min(rows) == 6
    assert max(columns) - min(columns) == 8
    assert set(hull.values()) == {"class:robot"}


def test_last_line_starts_with_the_scale_bar(robot_info: RobotInfo) -> None:
    lines = teleop_view.draw_view(np.zeros((0, 2)), robot_info, 10.0, COLUMNS, ROWS)
    assert lines[-1][0] == ("class:scale", "├────────┤ 5 m ")


@given(st.sampled_from(teleop_view.RADII), st.integers(1, 300), st.integers(1, 100))
def test_scale_bar_has_its_stated_length(
    radius: float, columns: int, rows: int
) -> None:
    dots_per_metre = min(2 * columns, 4 * rows) / 2 / radius
    bar, length, unit = teleop_view.scale_bar(dots_per_metre, columns).split()
    assert unit == "m"
    cells_long = float(length) * dots_per_metre / 2
    assert abs(len(bar) - cells_long) <= 0.5 or len(bar) == 2
    assert cells_long <= columns / 3 + 1e-9


@pytest.mark.parametrize("radius", teleop_view.RADII)
@pytest.mark.parametrize(
    ("columns", "rows"), [(1, 1), (2, 1), (1, 9), (49, 22), (51, 23), (169, 58)]
)
def test_view_fills_any_size(
    robot_info: RobotInfo, radius: float, columns: int, rows: int
) -> None:
    lines = teleop_view.draw_view(np.ones((3, 2)), robot_info, radius, columns, rows)
    assert [len(line) for line in cells(lines)] == [columns] * rows


def texts(canvas: teleop_view.Canvas) -> list[str]:
    return ["".join(text for _, text in line) for line in canvas.lines()]


def test_dots_are_the_unicode_braille_dots() -> None:
    places = [*((x, y) for x in range(2) for y in range(3)), (0, 3), (1, 3)]
    for (across, down), letter in zip(places, "⠁⠂⠄⠈⠐⠠⡀⢀", strict=True):
        canvas = teleop_view.Canvas(1, 1, STYLES)
        canvas.plot(np.array([across + 0.5]), np.array([down + 0.5]), "low")
        assert texts(canvas) == [letter]


@pytest.mark.parametrize("order", [STYLES, STYLES[::-1]], ids=["up", "down"])
def test_cell_takes_the_style_of_highest_priority(order: tuple[str, str]) -> None:
    canvas = teleop_view.Canvas(1, 1, STYLES)
    for style, across in zip(order, (0.0, 1.0), strict=True):
        canvas.plot(np.array([across]), np.array([0.0]), style)
    assert canvas.lines() == [[("high", "⠉")]]


def test_text_covers_dots_and_is_cut_at_the_edge() -> None:
    canvas = teleop_view.Canvas(3, 1, STYLES)
    canvas.plot(np.array([0.0, 4.0]), np.array([0.0, 0.0]), "high")
    canvas.write(0, 1, "abc", "low")
    assert canvas.lines() == [[("high", "⠁"), ("low", "ab")]]


coordinates = st.floats(allow_nan=True, allow_infinity=True)


@given(st.integers(1, 9), st.integers(1, 9), st.lists(coordinates, max_size=20))
def test_dots_outside_do_not_change_the_size(
    columns: int, rows: int, places: list[float]
) -> None:
    canvas = teleop_view.Canvas(columns, rows, STYLES)
    canvas.plot(np.array(places), np.array(places[::-1]), "low")
    assert [len(line) for line in texts(canvas)] == [columns] * rows
