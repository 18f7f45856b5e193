"""What figure 15 says of two robots' maps of the test map, as laws."""

import math
import re

import numpy as np
import pytest
from matplotlib.image import AxesImage

from radarsim.lab.figures.figure import load_scene
from radarsim.lab.figures.foliage_wall import bush_parts, far_side
from radarsim.lab.figures.runs import (
    MappingResult,
    bush_coverage,
    count_object_cells,
    draw_map_pair,
    hokuyo,
    radar,
)

ROOM = load_scene("foliage_room")
AHEAD = ((-2.0, 0.0),)  # a shorter way, up to the bushes
Pair = tuple[MappingResult, MappingResult]


@pytest.fixture(scope="module")
def pair() -> Pair:
    return radar(0, AHEAD).explore(), hokuyo(0, AHEAD).explore()


def test_both_robots_drive_the_same_path_before_the_bushes(pair: Pair) -> None:
    assert [run.length for run in pair] == pytest.approx([5.8, 5.8], abs=0.1)
    rows = [run.trajectory.rows() for run in pair]
    assert rows[0][-1, :2] == pytest.approx(rows[1][-1, :2], abs=0.05)
    assert max(row[:, 0].max() for row in rows) < -1.9


def test_radar_maps_the_hidden_region_and_the_hokuyo_does_not(pair: Pair) -> None:
    left, right = pair
    assert left.score.hidden_coverage is not None
    assert left.score.hidden_coverage > 0.5
    assert right.score.hidden_coverage == 0
    assert not any(count_object_cells(right).values())
    x, _ = right.grid.frame.cell_centers()
    beyond = right.grid.sensed_cells()[:, x > far_side(ROOM)]
    assert not beyond.any()


def test_objects_show_on_the_map_where_beams_end(pair: Pair) -> None:
    left, _ = pair
    x, y = left.grid.frame.cell_centers()
    ended, counts = left.grid.beam_end_cells(), count_object_cells(left)
    assert counts["cabinet"] > 10  # 1.6 m, which are 32 cells, face the robot
    columns, rows = np.abs(x - 8) < 0.3 + 0.125, np.abs(y - 0.8) < 0.8 + 0.125
    assert counts["cabinet"] == ended[np.ix_(rows, columns)].sum()


def test_bushes_are_round_and_the_hokuyo_has_only_their_edges(pair: Pair) -> None:
    left, right = (bush_coverage(run) for run in pair)
    size = pair[0].grid.frame.resolution
    for one, two, bush in zip(left, right, bush_parts(ROOM), strict=True):
        radius = np.ptp(bush.vertices[:, 0]) / 2
        across = math.sqrt(radius**2 - (0.6 - pair[0].drive.height) ** 2)
        assert one.name == bush.object_name
        assert one.cells * size**2 == pytest.approx(math.pi * across**2, rel=0.03)
        assert one.cells == two.cells
        assert two.blue > 0.9 * two.cells
        assert not two.middle
        assert one.blue < two.blue
    assert sum(bush.middle for bush in left) > 3


def test_both_maps_have_the_same_scale_and_their_own_titles(pair: Pair) -> None:
    drawn = draw_map_pair(*pair)
    drawing = drawn.drawing
    left, right = drawing.axes
    assert left.viewLim.bounds == right.viewLim.bounds
    for axes in (left, right):
        box, view = axes.get_window_extent(), axes.viewLim
        assert box.width / view.width == pytest.approx(box.height / view.height)
        assert any(isinstance(child, AxesImage) for child in axes.get_children())
    hidden = pair[0].score.hidden_coverage or 0
    assert [axes.get_title("left") for axes in drawing.axes] == [
        f"{100 * hidden:.0f} % of the yard mapped with the radar",
        "0 % of the yard mapped with the laser",
    ]
    always = {"bushes", "the yard behind the bushes", "start"}
    assert {text.get_text() for text in right.texts} == always
    named = {text.get_text() for text in left.texts} - {"2 m"}  # the scale
    assert named - always == {
        name.replace("_", " ")
        for name, cells in count_object_cells(pair[0]).items()
        if cells
    }
    assert drawn.commands == tuple(run.drive.command for run in pair)
    assert f"{100 * hidden:.1f} % of the yard behind the bushes" in drawn.caption
    assert "the laser's 0.0 % and none" in drawn.caption
    assert "the laser's none" in drawn.details
    assert not re.search(r"nan|inf|None|\?", drawn.caption + drawn.details)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1])
def test_hardly_anything_stays_hidden_along_the_whole_wall(seed: int) -> None:
    run = radar(seed).explore()
    assert run.score.hidden_coverage is not None
    assert run.score.hidden_coverage > 0.95
    assert all(cells > 3 for cells in count_object_cells(run).values())
    bushes = bush_coverage(run)
    assert all(bush.middle for bush in bushes)
    cores = [bush for bush in bushes if bush.blue > 0.05 * bush.cells]
    assert len(cores) >= 3
    assert all(bush.beyond > 0.3 for bush in cores)
    assert sum(bush.blue for bush in bushes) < 0.1 * sum(b.cells for b in bushes)
