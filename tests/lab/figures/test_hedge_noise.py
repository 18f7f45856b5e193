"""Figures 9 and 10: panels that can be compared, and noise that grows."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection

from radarsim.lab.figures.figure import DrawnFigure
from radarsim.lab.figures.foliage_wall import COUNT, STEP, count_moved, radar
from radarsim.lab.figures.hedge import (
    OFFSETS,
    draw_repeated_scans,
    draw_single_scans,
)
from radarsim.plotting.style import scan_points


@pytest.fixture(scope="module")
def single() -> DrawnFigure:
    return draw_single_scans(0)


@pytest.fixture(scope="module")
def repeated() -> DrawnFigure:
    return draw_repeated_scans(0)


def shifts(drawn: DrawnFigure, panel: int) -> list[np.ndarray]:
    """Return the lines between readings in a panel, (2, 2) m each."""
    axes = drawn.drawing.axes[panel]
    return [
        np.asarray(line)
        for lines in axes.collections
        if isinstance(lines, LineCollection)
        for line in lines.get_segments()
    ]


def test_panels_share_limits_and_size(
    single: DrawnFigure, repeated: DrawnFigure
) -> None:
    panels = [axes for drawn in (single, repeated) for axes in drawn.drawing.axes]
    assert len(panels) == 2 * len(OFFSETS)
    assert len({axes.viewLim.bounds for axes in panels}) == 1
    sizes = [axes.get_window_extent().size for axes in panels]
    assert np.ptp(sizes, axis=0) == pytest.approx([0, 0])


def test_more_readings_are_off_from_panel_to_panel(
    single: DrawnFigure, repeated: DrawnFigure
) -> None:
    for drawn in (single, repeated):
        none, some, many = (len(shifts(drawn, panel)) for panel in range(3))
        assert none == 0 < some < many
    assert "N = 0: 0 of 181" in single.drawing.axes[0].get_title()


def test_each_line_leads_from_the_reading_without_noise_to_the_real_one(
    single: DrawnFigure,
) -> None:
    (still,), (noisy,) = radar(0, 0).take(), radar(0, 100).take()
    before, after = scan_points(still), scan_points(noisy)
    lines = shifts(single, 2)
    assert len(lines) == count_moved(noisy, 0)
    for start, end in lines:
        beam = int(np.abs(before - start).sum(axis=1).argmin())
        assert before[beam] == pytest.approx(start)
        assert after[beam] == pytest.approx(end)
        assert np.hypot(*(end - start)) > STEP


def test_commands_take_the_scans_of_all_panels(
    single: DrawnFigure, repeated: DrawnFigure
) -> None:
    assert single.commands == tuple(radar(0, offset).command for offset in OFFSETS)
    assert all(each.endswith(f"--count {COUNT}") for each in repeated.commands)
    assert len(repeated.commands) == len(OFFSETS)


def test_legend_says_how_near_readings_stay_that_count_as_the_same() -> None:
    drawing = draw_repeated_scans(0).drawing
    texts = [text.get_text() for text in drawing.legends[0].get_texts()]
    assert any(f"within {100 * STEP:g} cm" in text for text in texts)
