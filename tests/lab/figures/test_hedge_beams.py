"""Figures 7 and 8: what gets behind the bushes is what one sees first."""

import re
from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.figure import Figure

from radarsim.lab.figures.figure import DrawnFigure, ScanSpec, hit_points
from radarsim.lab.figures.foliage_wall import count_ends, far_side, hokuyo, radar
from radarsim.lab.figures.hedge import (
    NEAR,
    SPENT,
    STOPPED,
    THROUGH,
    draw_hokuyo,
    draw_radar,
)


@pytest.fixture(scope="module")
def laser() -> DrawnFigure:
    return draw_hokuyo(0)


@pytest.fixture(scope="module")
def seen_through() -> DrawnFigure:
    return draw_radar(0)


def axes_of(drawn: DrawnFigure) -> Axes:
    (axes,) = drawn.drawing.axes
    return axes


def beams(drawn: DrawnFigure) -> dict[str, LineCollection]:
    """Return the drawn lines of beams by their text in the legend."""
    texts = {style.text for style in (NEAR, STOPPED, SPENT, THROUGH)}
    return {
        str(lines.get_label()): lines
        for lines in axes_of(drawn).collections
        if isinstance(lines, LineCollection) and lines.get_label() in texts
    }


def marks(drawn: DrawnFigure) -> dict[str, PathCollection]:
    return {
        str(dots.get_label()): dots
        for dots in axes_of(drawn).collections
        if isinstance(dots, PathCollection)
    }


def widths(lines: LineCollection) -> list[float]:
    return [float(width) for width in np.atleast_1d(lines.get_linewidth())]


def test_beams_that_see_through_are_the_boldest_lines(
    seen_through: DrawnFigure,
) -> None:
    lines = beams(seen_through)
    bold = lines.pop(THROUGH.text)
    assert bold.get_alpha() == 1
    for other in lines.values():
        assert min(widths(bold)) > 2 * max(widths(other))
        assert (other.get_alpha() or 1) < 1
        assert bold.get_zorder() > other.get_zorder()


def test_hits_behind_the_bushes_are_the_largest_marks(
    seen_through: DrawnFigure,
) -> None:
    dots = marks(seen_through)
    large = dots.pop(THROUGH.text)
    side = far_side(radar(0, 0).scene)
    assert (np.asarray(large.get_offsets())[:, 0] > side).all()
    for other in dots.values():
        assert min(large.get_sizes()) > 2 * max(other.get_sizes())


@pytest.mark.parametrize(
    ("shot", "draw"), [(hokuyo(0), draw_hokuyo), (radar(0, 0), draw_radar)]
)
def test_each_beam_is_drawn_once_and_ends_at_its_reading(
    shot: ScanSpec, draw: Callable[[int], DrawnFigure]
) -> None:
    (scan,) = shot.take()
    drawn = [lines.get_segments() for lines in beams(draw(0)).values()]
    ends = np.concatenate(drawn)[:, 1]
    readings = hit_points(scan)[:, :2]
    assert ends[np.lexsort(ends.T)] == pytest.approx(
        readings[np.lexsort(readings.T)], abs=1e-9
    )


def test_legend_lists_only_what_is_drawn(
    laser: DrawnFigure, seen_through: DrawnFigure
) -> None:
    def legend(drawing: Figure) -> set[str]:
        return {text.get_text() for text in drawing.legends[0].get_texts()}

    assert legend(laser.drawing) == set(beams(laser)) == {NEAR.text, STOPPED.text}
    assert legend(seen_through.drawing) == set(beams(seen_through))
    assert THROUGH.text in beams(seen_through)


def test_both_figures_have_the_same_limits_and_a_scale_bar(
    laser: DrawnFigure, seen_through: DrawnFigure
) -> None:
    one, two = axes_of(laser), axes_of(seen_through)
    assert one.viewLim.bounds == two.viewLim.bounds
    for axes in (one, two):
        (bar,) = (line for line in axes.lines if line.get_label() == "scale")
        assert np.ptp(np.asarray(bar.get_xdata())) == pytest.approx(2)
        assert "2 m" in {text.get_text() for text in axes.texts}


def test_titles_and_details_state_the_counts(
    laser: DrawnFigure, seen_through: DrawnFigure
) -> None:
    shot = radar(0, 0)
    counts = count_ends(shot.scene, shot.take()[0])
    title = seen_through.drawing.texts[0].get_text()
    assert f"{counts.behind} of {counts.beams} beams" in title
    assert "0 of 228 beams" in laser.drawing.texts[0].get_text()
    assert f"{counts.behind} of its 181 beams go" in seen_through.details
    assert "0 behind them" in laser.details
    assert "0 of 24624 beams end behind" in laser.details
    for drawn in (laser, seen_through):
        assert not re.search(r"nan|inf|None", drawn.caption + drawn.details)


def test_small_print_tells_the_range_given_to_the_hokuyo(laser: DrawnFigure) -> None:
    _, small_print = laser.drawing.texts
    assert "80 m" in small_print.get_text()


def test_small_print_names_what_the_radar_reads_behind_the_bushes(
    seen_through: DrawnFigure,
) -> None:
    _, small_print = seen_through.drawing.texts
    assert {"cabinet", "wall"} <= set(re.findall(r"\w+", small_print.get_text()))
