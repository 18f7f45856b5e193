"""Pictures of maps: cells, path, robot, outlines, and a legend of what is there."""

import io
import math
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from PIL import Image

from radarsim.geometry import Pose2
from radarsim.mapping.export import (
    BLACK,
    BLUE,
    GREY,
    WHITE,
    commander_pixels,
    is_radarsim_map,
)
from radarsim.mapping.occupancy_grid import OccupancyGrid
from radarsim.mapping.scan import read_scan
from radarsim.plotting.cell_image import CellImage
from radarsim.plotting.map_film import MapFrames, first_extent
from radarsim.plotting.maps import (
    CELL_TEXTS,
    MapView,
    draw_map_view,
    map_figure,
    pixels_per_metre,
)
from radarsim.plotting.outlines import Outline
from radarsim.plotting.panels import Extent
from radarsim.protocol.reports import RangeScan

PATH = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.2, 0.4]])
ROOM = np.array([[-4, -4], [4, -4], [4, 4], [-4, 4], [-4, -4.0]])
PLAN = (Outline("solid", (ROOM,)),)


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


def view_of(grid: OccupancyGrid, **options: Any) -> MapView:
    options = {"robot_class": "P3AT", "title": "A map", **options}
    return MapView(grid, PATH, **options)


def legend(figure: Figure) -> set[str]:
    return {text.get_text() for text in figure.legends[0].get_texts()}


def test_legend_lists_what_is_there() -> None:
    texts = {CELL_TEXTS[shade] for shade in (BLUE, WHITE, GREY, BLACK)}
    far = legend(map_figure([view_of(grid_of(5.0), outlines=PLAN)]))
    assert far == {*texts, "path", "start", "solid things, in truth"}
    near = legend(map_figure([view_of(grid_of(2.0, ends=False))]))
    assert near == {CELL_TEXTS[BLUE], CELL_TEXTS[GREY], "path", "start"}


def test_cells_are_drawn_where_they_are() -> None:
    grid = grid_of(5.0)
    (axes,) = map_figure([view_of(grid)]).axes
    (image,) = (each for each in axes.get_children() if isinstance(each, AxesImage))
    west, east, south, north = image.get_extent()
    cells = np.asarray(image.get_array())
    rows, columns = cells.shape[:2]
    size = grid.frame.resolution
    assert (east - west, north - south) == pytest.approx((columns * size, rows * size))
    blue = (cells[:, :, :3] == BLUE).all(axis=2)
    for row in range(0, rows, 7):
        for column in range(0, columns, 7):
            x, y = west + (column + 0.5) * size, south + (row + 0.5) * size
            assert blue[row, column] != grid.sensed(x, y)


def test_picture_is_the_same_again_and_known_as_the_programs() -> None:
    view = view_of(grid_of(5.0), outlines=PLAN, subtitle="of a room")
    once, again = draw_map_view(view), draw_map_view(view)
    assert once == again
    assert is_radarsim_map(once)
    with Image.open(io.BytesIO(once)) as image:
        assert 600 < image.width < 1200


def test_scene_is_shown_whole_unless_it_is_much_larger() -> None:
    grid = grid_of(2.0)
    assert view_of(grid, outlines=PLAN).extent.width == pytest.approx(8.4)
    large = (Outline("solid", (ROOM * 10,)),)
    assert view_of(grid, outlines=large).extent.width < 6


def test_robot_stands_at_the_end_of_its_path() -> None:
    (axes,) = map_figure([view_of(grid_of(5.0))]).axes
    corners = [np.asarray(patch.get_path().vertices)[:4] for patch in axes.patches]
    hull = max(corners, key=lambda points: float(np.ptp(points[:, 0])))
    assert hull.mean(axis=0) == pytest.approx(PATH[-1, :2])


def test_cells_have_a_whole_number_of_pixels() -> None:
    for side in (3.0, 11.0, 35.0):
        scale = pixels_per_metre(Extent(0, 0, side, side), 0.05)
        assert scale * 0.05 == round(scale * 0.05)
        assert scale * side < 1000
    assert pixels_per_metre(Extent(0, 0, 300, 300), 0.05) * 300 < 1000


def test_film_shows_more_when_the_map_outgrows_it() -> None:
    grid = grid_of(5.0)
    frames = MapFrames(first_extent((), grid), 0.05, "A map grows", "P3AT")
    small = frames.draw(grid, PATH[:1], "1 s")
    large = frames.draw(grid_of(15.0), PATH, "2 s")
    assert small.shape == large.shape
    assert all(side % 2 == 0 for side in small.shape[:2])
    grey = [int((frame == GREY).all(axis=2).sum()) for frame in (small, large)]
    assert grey[1] < 0.8 * grey[0]  # the disc of 3 m around the robot is smaller


def test_film_begins_with_a_scene_that_is_not_too_large() -> None:
    grid = grid_of(2.0)
    assert first_extent(PLAN, grid).width == pytest.approx(9)
    large = (Outline("solid", (ROOM * 20,)),)
    assert first_extent(large, grid) == first_extent((), grid)
    assert 4 < first_extent(large, grid).width < 7


def test_commander_colours_are_by_cell() -> None:
    grid = grid_of(5.0)
    cells = commander_pixels(grid)
    row, column = grid.frame.cell(4.0, 0.0) or (0, 0)
    assert tuple(cells[row, column]) == WHITE
    row, column = grid.frame.cell(2.0, 0.0) or (0, 0)
    assert tuple(cells[row, column]) == GREY
    row, column = grid.frame.cell(5.0, 0.0) or (0, 0)
    assert tuple(cells[row, column]) == BLACK


def test_pixels_have_the_colour_of_the_cell_under_them() -> None:
    """Quickly drawn cells are those that matplotlib would draw."""
    colours = np.random.Generator(np.random.PCG64(0)).integers(0, 256, (5, 7, 3))
    cells, pictures = colours.astype(np.uint8), []
    for quickly in (True, False):
        figure = Figure(figsize=(2, 2), dpi=50)
        axes = figure.add_axes((0.1, 0.1, 0.8, 0.8))
        axes.set_axis_off()
        if quickly:
            image = CellImage(axes, zorder=1)
            axes.add_artist(image)
            image.show(cells, Extent(-1.0, 0.0, 6.0, 5.0))
        else:
            extent = (-1.0, 6.0, 0.0, 5.0)
            axes.imshow(cells, origin="lower", interpolation="nearest", extent=extent)
        axes.set(xlim=(-2.0, 6.0), ylim=(-1.0, 7.0), aspect="auto")
        data = io.BytesIO()
        FigureCanvasAgg(figure).print_figure(data, format="png")
        with Image.open(data) as picture:
            pictures.append(np.array(picture.convert("RGB")))
    assert (pictures[0] == pictures[1]).all()
