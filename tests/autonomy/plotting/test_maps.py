"""Pictures of maps: cells, path, robot, outlines, and a legend of these."""

import io
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from flat_world import look_through
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.transforms import Bbox
from PIL import Image

from radarsim.autonomy.mapping import export
from radarsim.autonomy.mapping.occupancy_grid import CellClass, OccupancyGrid
from radarsim.autonomy.mapping.scan import read_scan
from radarsim.autonomy.plotting import maps
from radarsim.autonomy.plotting.outlines import Outline
from radarsim.geometry import Pose2
from radarsim.plotting.palette import GOING
from radarsim.plotting.style import render
from radarsim.protocol.reports import RangeScan
from radarsim.scene.map_file import load_map

PATH = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.2, 0.4]])
ROOM = np.array([[-4, -4], [4, -4], [4, 4], [-4, 4], [-4, -4.0]])
PLAN = (Outline(CellClass.OBSTACLE, (ROOM,)),)


def grid_of(reach: float, *, ends: bool = True) -> OccupancyGrid:
    """Map one scan in which all beams are as long."""
    grid = OccupancyGrid()
    ranges = np.full(181, reach)
    report = RangeScan(0.0, "x", math.radians(2), math.radians(360), ranges)
    scan = read_scan(
        report,
        None,
        max_range=20.0 if ends else reach,
        min_range=0.0,
        mount=Pose2(0, 0),
    )
    grid.add(Pose2(0, 0), scan)
    return grid


def image_of(figure: Figure) -> AxesImage:
    """Return the cells in the first panel."""
    children = figure.axes[0].get_children()
    (image,) = (each for each in children if isinstance(each, AxesImage))
    return image


def shade_of(kind: CellClass) -> list[int]:
    return [round(255 * part) for part in to_rgb(maps.CELLS[kind][0])]


def view_of(grid: OccupancyGrid, **options: Any) -> maps.MapView:
    options = {"robot_class": "P3AT", "title": "A map", **options}
    return maps.MapView(grid, PATH, **options)


def legend(figure: Figure) -> set[str]:
    return {text.get_text() for text in figure.legends[0].get_texts()}


def test_legend_lists_what_is_there() -> None:
    known = legend(maps.map_figure([view_of(grid_of(5.0), outlines=PLAN)]))
    assert known == {"not sensed", "free", "solid", "path", "true outlines"}
    empty = legend(maps.map_figure([view_of(grid_of(2.0, ends=False))]))
    assert empty == {"not sensed", "free", "path"}


def test_foliage_of_the_map_is_green() -> None:
    grid = OccupancyGrid()
    grid.add(Pose2(0, 0), look_through(2.0, 3.0, 5.0))
    figure = maps.map_figure([view_of(grid)])
    assert "foliage" in legend(figure)
    cells = np.asarray(image_of(figure).get_array())[:, :, :3]
    green = (cells == shade_of(CellClass.FOLIAGE)).all(axis=2)
    assert green.sum() == (grid.classes() == CellClass.FOLIAGE).sum() > 0


def test_cells_are_drawn_where_they_are() -> None:
    grid = grid_of(5.0)
    image = image_of(maps.map_figure([view_of(grid)]))
    west, east, south, north = image.get_extent()
    cells = np.asarray(image.get_array())
    rows, columns = cells.shape[:2]
    size = grid.frame.resolution
    assert (east - west, north - south) == pytest.approx((columns * size, rows * size))
    unknown = (cells[:, :, :3] == shade_of(CellClass.UNKNOWN)).all(axis=2)
    for row in range(0, rows, 7):
        for column in range(0, columns, 7):
            x, y = west + (column + 0.5) * size, south + (row + 0.5) * size
            assert unknown[row, column] != grid.sensed(x, y)


def test_picture_is_the_same_again_and_known_as_the_programs() -> None:
    view = view_of(grid_of(5.0), outlines=PLAN, subtitle="of a room")
    once, again = (
        render(maps.map_figure([view], numbers=True), software=export.MARK)
        for _ in "ab"
    )
    assert once == again
    assert export.MARK.encode() in once[: export.HEAD]
    with Image.open(io.BytesIO(once)) as image:
        assert 600 < image.width < 1200


def test_scene_is_shown_whole_unless_it_is_much_larger() -> None:
    grid = grid_of(2.0)
    assert view_of(grid, outlines=PLAN).extent.width == pytest.approx(8.4)
    large = (Outline(CellClass.OBSTACLE, (ROOM * 10,)),)
    assert view_of(grid, outlines=large).extent.width < 6


def test_robot_stands_at_the_end_of_its_path() -> None:
    (axes,) = maps.map_figure([view_of(grid_of(5.0))]).axes
    corners = [np.asarray(patch.get_path().vertices)[:4] for patch in axes.patches]
    hull = max(corners, key=lambda points: float(np.ptp(points[:, 0])))
    assert hull.mean(axis=0) == pytest.approx(PATH[-1, :2])


@pytest.mark.parametrize(("north", "below"), [(1.0, True), (-1.0, False)])
def test_label_of_the_start_is_beside_the_path(north: float, below: bool) -> None:
    away = np.linspace(0.0, 3.0 * north, 60)
    path = np.column_stack([np.zeros(60), away, np.zeros(60)])
    view = maps.MapView(grid_of(5.0), path, "P3AT", "A map")
    (axes,) = maps.map_figure([view]).axes
    (label,) = (text for text in axes.texts if text.get_text() == "start")
    assert (label.get_verticalalignment() == "top") == below


def test_objects_of_the_scene_are_named() -> None:
    parts = tuple(load_map("foliage_room").parts)
    figure = maps.map_figure([view_of(grid_of(9.0), parts=parts, height=0.3)])
    texts = {text.get_text() for text in figure.axes[0].texts}
    assert {"bushes", "cabinet"} <= texts


def test_cells_have_a_whole_number_of_pixels() -> None:
    for side in (3.0, 11.0, 35.0):
        scale = maps.pixels_per_metre(Bbox.from_extents(0, 0, side, side), 0.05)
        assert scale * 0.05 == round(scale * 0.05)
        assert scale * side < 1000
    assert maps.pixels_per_metre(Bbox.from_extents(0, 0, 300, 300), 0.05) * 300 < 1000


def test_film_shows_more_when_the_map_outgrows_it() -> None:
    grid = grid_of(5.0)
    path = np.array([[-4.0, 0.0, 0.0], [4.0, 0.0, 0.0]])
    first = maps.MapView(grid, path, "P3AT", "A map grows", subtitle="2 s")
    frames = maps.MapFrames(first)
    views = (first, replace(first, grid=grid_of(15.0)))
    small, large = (frames.draw(each) for each in views)
    assert small.shape == large.shape
    assert all(side % 2 == 0 for side in small.shape[:2])
    blue = [round(255 * part) for part in to_rgb(GOING)]
    long = [np.ptp(np.nonzero((f == blue).all(axis=2))[1]) for f in (small, large)]
    assert 0 < long[1] < 0.8 * long[0]


def test_legend_of_a_film_lists_what_the_scene_has() -> None:
    grid, bush = grid_of(2.0), Outline(CellClass.FOLIAGE, (ROOM / 4,))
    known = maps.MapFrames(view_of(grid, outlines=(*PLAN, bush)))
    unknown = maps.MapFrames(view_of(grid))
    always = {"not sensed", "free", "solid", "path"}
    assert legend(known.figure) == {*always, "foliage", "true outlines"}
    assert legend(unknown.figure) == {*always, "foliage", "smoke or dust"}


def test_film_begins_with_a_scene_that_is_not_too_large() -> None:
    grid = grid_of(2.0)
    assert maps.first_map_extent(PLAN, grid).width == pytest.approx(9)
    large = (Outline(CellClass.OBSTACLE, (ROOM * 20,)),)
    around_map = maps.first_map_extent((), grid)
    assert maps.first_map_extent(large, grid).bounds == around_map.bounds
    assert 4 < around_map.width < 7
