"""Figures 2 to 5, single and as one panel."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.patches import PathPatch

from radarsim.lab.figures.dust import (
    LASER,
    RADAR,
    READINGS,
    count_readings,
    draw_all_readings,
    draw_readings,
    scan_spec_for,
)
from radarsim.lab.figures.figure import DrawnFigure


@pytest.fixture(scope="module")
def panel() -> DrawnFigure:
    return draw_all_readings(0)


def test_panel_has_the_four_figures_with_the_same_limits(panel: DrawnFigure) -> None:
    axes = panel.drawing.axes
    titles = [each.get_title(loc="left") for each in axes]
    assert [title.split(":")[0] for title in titles] == [
        "Radar, clear air",
        "Radar, heavy dust",
        "Laser, clear air",
        "Laser, heavy dust",
    ]
    assert [title.split(": ")[1].split()[0] for title in titles] == ["18"] * 3 + ["3"]
    assert len({each.viewLim.bounds for each in axes}) == 1
    assert len(set(panel.commands)) == 4


def test_single_figures_have_the_limits_of_the_panel(panel: DrawnFigure) -> None:
    (alone,) = draw_readings(0, sensor=LASER, air="clear").drawing.axes
    assert alone.viewLim.bounds == panel.drawing.axes[0].viewLim.bounds


@pytest.mark.parametrize(
    ("sensor", "verdict"),
    [(RADAR, "does not trouble it"), (LASER, "reads the dust instead")],
)
def test_caption_states_the_conclusion_and_details_the_counts(
    sensor: str, verdict: str
) -> None:
    drawn = draw_readings(0, sensor=sensor, air="dust")
    counts = count_readings(sensor, "dust", 0)
    assert verdict in drawn.caption
    unchanged = f" {counts.unchanged} of {counts.crossing} are the same"
    assert unchanged in drawn.details
    assert drawn.commands == (scan_spec_for(sensor, "dust", 0).command,)


def test_plotted_points_are_the_readings_of_all_scans() -> None:
    axes = draw_readings(0, sensor=LASER, air="dust").drawing.axes[0]
    drawn = {
        str(line.get_marker()): len(np.asarray(line.get_xdata()))
        for line in axes.lines
        if line.get_label() == READINGS
    }
    counts = count_readings(LASER, "dust", 0)
    assert drawn == {"o": counts.unchanged + counts.beside, "x": counts.cloud}


@pytest.mark.parametrize("sensor", [RADAR, LASER])
def test_readings_lie_over_all_objects_and_outlines(sensor: str) -> None:
    axes = draw_readings(0, sensor=sensor, air="clear").drawing.axes[0]
    readings = [line for line in axes.lines if line.get_label() == READINGS]
    objects = [patch for patch in axes.patches if isinstance(patch, PathPatch)]
    others = [*objects, *axes.findobj(LineCollection)]
    assert min(line.get_zorder() for line in readings) > max(
        artist.get_zorder() for artist in others
    )


def test_legend_lists_only_what_is_drawn() -> None:
    def legend(sensor: str, air: str) -> list[str]:
        drawing = draw_readings(0, sensor=sensor, air=air).drawing
        return [text.get_text() for text in drawing.legends[0].get_texts()]

    assert legend(RADAR, "clear") == ["radar reading of an object"]
    assert legend(RADAR, "dust") == ["radar reading of an object"]
    dusty = legend(LASER, "dust")
    assert len(dusty) == 3
    assert {"laser reading of the dust", "laser reading of an object"} < set(dusty)


def test_presets_are_named_only_in_the_small_print() -> None:
    drawn = draw_readings(0, sensor=RADAR, air="clear")
    title, *others = drawn.drawing.texts
    assert RADAR not in title.get_text() + drawn.caption
    assert any(RADAR in text.get_text() for text in others)
