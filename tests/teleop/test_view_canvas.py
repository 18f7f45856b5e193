import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.teleop.view import Canvas

STYLES = ("low", "high")


def texts(canvas: Canvas) -> list[str]:
    return ["".join(text for _, text in line) for line in canvas.lines()]


@pytest.mark.parametrize(
    ("across", "down", "letter"),
    [
        pytest.param(0, 0, "⠁", id="dot 1"),
        pytest.param(0, 1, "⠂", id="dot 2"),
        pytest.param(0, 2, "⠄", id="dot 3"),
        pytest.param(1, 0, "⠈", id="dot 4"),
        pytest.param(1, 1, "⠐", id="dot 5"),
        pytest.param(1, 2, "⠠", id="dot 6"),
        pytest.param(0, 3, "⡀", id="dot 7"),
        pytest.param(1, 3, "⢀", id="dot 8"),
    ],
)
def test_dots_are_the_unicode_braille_dots(across: int, down: int, letter: str) -> None:
    canvas = Canvas(1, 1, STYLES)
    canvas.plot(np.array([across + 0.5]), np.array([down + 0.5]), "low")
    assert texts(canvas) == [letter]


def test_an_empty_canvas_is_blank_rather_than_braille() -> None:
    assert texts(Canvas(3, 2, STYLES)) == ["   ", "   "]


@pytest.mark.parametrize("order", [STYLES, STYLES[::-1]], ids=["up", "down"])
def test_cell_takes_the_style_of_highest_priority(order: tuple[str, str]) -> None:
    canvas = Canvas(1, 1, STYLES)
    for style, across in zip(order, (0.0, 1.0), strict=True):
        canvas.plot(np.array([across]), np.array([0.0]), style)
    assert canvas.lines() == [[("high", "⠉")]]


def test_neighbours_of_one_style_are_one_fragment() -> None:
    canvas = Canvas(4, 1, STYLES)
    canvas.plot(np.array([2.0, 4.0]), np.array([0.0, 0.0]), "low")
    assert canvas.lines() == [[("", " "), ("low", "⠁⠁"), ("", " ")]]


def test_text_covers_dots_and_is_cut_at_the_edge() -> None:
    canvas = Canvas(3, 1, STYLES)
    canvas.plot(np.array([0.0, 4.0]), np.array([0.0, 0.0]), "high")
    canvas.write(0, 1, "abc", "low")
    assert canvas.lines() == [[("high", "⠁"), ("low", "ab")]]


coordinates = st.floats(allow_nan=True, allow_infinity=True)


@given(st.integers(1, 9), st.integers(1, 9), st.lists(coordinates, max_size=20))
def test_dots_outside_do_not_change_the_size(
    columns: int, rows: int, places: list[float]
) -> None:
    canvas = Canvas(columns, rows, STYLES)
    canvas.plot(np.array(places), np.array(places[::-1]), "low")
    assert [len(line) for line in texts(canvas)] == [columns] * rows
