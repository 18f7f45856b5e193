"""Map files as other programs read them."""

import io
import math
from typing import Any

import numpy as np
import pytest
import yaml
from flat_world import ROOM, look, look_through
from nav_maps import FREE, OCCUPIED, UNKNOWN, load_nav_map
from PIL import Image

from radarsim.autonomy.mapping import export
from radarsim.autonomy.mapping.occupancy_grid import CellClass, OccupancyGrid
from radarsim.autonomy.mapping.scan import read_scan
from radarsim.geometry import Pose2
from radarsim.protocol.reports import RangeScan

HERE = Pose2(1.0, -0.5, 0.4)


@pytest.fixture(scope="module")
def mapped() -> OccupancyGrid:
    """A room, with a hedge and smoke outside, which no scan of the room reaches."""
    grid = OccupancyGrid()
    grid.add(HERE, look(ROOM, HERE))
    grid.add(Pose2(8.02, 0.02, 0.0), look_through(2.0, 3.0, 6.0))
    grid.add(Pose2(8.0, 8.0, 0.0), look_through(2.0, 3.0, 6.0, passes=True))
    return grid


def pixel_of(
    grid: OccupancyGrid, image: Image.Image, origin: list[float], x: float, y: float
) -> Any:
    """Look up a place as readers do: by the lower left corner, rows from the top."""
    column = math.floor((x - origin[0]) / grid.frame.resolution)
    row = math.floor((y - origin[1]) / grid.frame.resolution)
    return image.getpixel((column, image.height - 1 - row))


def classes_in(grid: OccupancyGrid, head: dict[str, Any], shape: Any) -> Any:
    """Return the part of a map's classes that a file covers."""
    x, y, _ = head["origin"]
    row, column = grid.frame.cell(x + 0.01, y + 0.01) or (-1, -1)
    return grid.classes()[row : row + shape[0], column : column + shape[1]]


def test_trinary_is_loaded_with_the_same_classes(mapped: OccupancyGrid) -> None:
    cells, head = load_nav_map(export.nav_map(mapped, "yard"))
    classes = classes_in(mapped, head, cells.shape)
    assert head["image"] == "yard.pgm"
    assert (
        cells[(classes == CellClass.OBSTACLE) | (classes == CellClass.FOLIAGE)]
        == OCCUPIED
    ).all()
    assert (
        cells[(classes == CellClass.FREE) | (classes == CellClass.SMOKE)] == FREE
    ).all()
    assert (cells[classes == CellClass.UNKNOWN] == UNKNOWN).all()
    assert all((classes == kind).any() for kind in range(5))


def test_pgm_follows_the_format_specification(mapped: OccupancyGrid) -> None:
    files = export.nav_map(mapped, "yard")
    kind, comment, rest = files["yard.pgm"].split(b"\n", 2)
    assert comment == b"# radarsim map"
    width, height, most, pixels = rest.split(maxsplit=3)
    assert (kind, most) == (b"P5", b"255")
    assert len(pixels) == int(width) * int(height)
    levels = np.frombuffer(pixels, np.uint8).reshape(int(height), int(width))[::-1]
    read = np.full(levels.shape, UNKNOWN, np.int16)
    read[levels == 0] = OCCUPIED
    read[levels == 254] = FREE
    cells, _ = load_nav_map(export.nav_map(mapped, "yard"))
    assert (read == cells).all()


def test_scale_is_loaded_with_probabilities(mapped: OccupancyGrid) -> None:
    cells, head = load_nav_map(export.nav_map(mapped, "yard", mode="scale"))
    classes = classes_in(mapped, head, cells.shape)
    assert head["mode"] == "scale"
    assert (cells[classes == CellClass.UNKNOWN] == UNKNOWN).all()
    known = cells[classes != CellClass.UNKNOWN]
    assert ((known >= 0) & (known <= 100)).all()
    assert (cells[classes == CellClass.OBSTACLE] > 90).all()
    assert (
        cells[classes == CellClass.FREE].max()
        < cells[classes == CellClass.FOLIAGE].min()
    )


def test_files_cover_the_sensed_area_with_a_margin(mapped: OccupancyGrid) -> None:
    cells, head = load_nav_map(export.nav_map(mapped, "yard"))
    classes = mapped.classes()
    assert (cells != UNKNOWN).sum() == (classes != CellClass.UNKNOWN).sum()
    assert cells.size < classes.size
    rows = np.flatnonzero((cells != UNKNOWN).any(axis=1))
    assert rows[0] == 10
    assert len(cells) - 1 - rows[-1] <= 10
    assert head["resolution"] == 0.05


@pytest.mark.parametrize(
    ("x", "y", "colour"),
    [
        pytest.param(1.0, 0.0, export.GREY, id="free, near the robot"),
        pytest.param(-2.21, -1.889, export.WHITE, id="free, far from it"),
        pytest.param(2.0, 1.0, export.BLUE, id="in a box"),
        pytest.param(10.5, 0.02, export.GREY, id="in foliage, near the robot"),
        pytest.param(12.0, 0.02, export.WHITE, id="behind foliage"),
        pytest.param(14.02, 0.02, export.BLACK, id="where beams end"),
    ],
)
def test_png_has_the_colours_of_usarcommander(
    mapped: OccupancyGrid, x: float, y: float, colour: tuple[int, int, int]
) -> None:
    _, head = load_nav_map(export.nav_map(mapped, "yard"))
    with Image.open(io.BytesIO(export.commander_png(mapped))) as image:
        assert pixel_of(mapped, image, head["origin"], x, y) == colour


def test_open_floor_is_left_out_5_m_beyond_everything() -> None:
    grid = OccupancyGrid()
    pole = np.array([[[6.02, -0.1], [6.02, 0.1]]])
    grid.add(Pose2(0.02, 0.02, 0.0), look(pole, Pose2(0.02, 0.02, 0.0)))
    assert grid.frame.columns * grid.frame.resolution > 60
    head = yaml.safe_load(export.nav_map(grid, "yard")["yard.yaml"])
    # Floor counts as seen within 3 m.
    assert head["origin"][:2] == pytest.approx([-8, -8], abs=0.11)
    with Image.open(io.BytesIO(export.commander_png(grid))) as image:
        assert np.array(image.size) * 0.05 == pytest.approx([19, 16], abs=0.21)


def test_map_without_sensed_cells_is_one_unknown_cell() -> None:
    grid = OccupancyGrid()
    with pytest.raises(ValueError, match="an empty map"):
        export.commander_png(grid)
    blind = read_scan(RangeScan(0.0, "lms200", 0.1, 1.0, np.zeros(3)), max_range=9.0)
    grid.add(HERE, blind)
    cells, _ = load_nav_map(export.nav_map(grid, "yard"))
    assert cells.tolist() == [[UNKNOWN]]


@pytest.mark.parametrize(
    "name", ["yard", 'my "yard": #1', "garten\u2028\x85", "\U0001f332"]
)
def test_yaml_names_its_image(mapped: OccupancyGrid, name: str) -> None:
    files = export.nav_map(mapped, name)
    head = yaml.safe_load(files[f"{name}.yaml"].decode("ascii"))
    assert head["image"] == f"{name}.pgm"
    assert head["image"] in files
