"""Map files as other programs read them."""

import io
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.typing import NDArray
from PIL import Image

from radarsim.autonomy.mapping.export import (
    BLACK,
    BLUE,
    GREY,
    WHITE,
    commander_png,
    nav_map,
)
from radarsim.autonomy.mapping.occupancy_grid import (
    CellClass,
    OccupancyGrid,
)
from radarsim.autonomy.mapping.scan import PlanarScan, read_scan
from radarsim.geometry import Floats, Pose2
from radarsim.protocol.reports import RangeScan, TargetEchoes

Look = Callable[..., PlanarScan]
HERE = Pose2(1.0, -0.5, 0.4)
NAV_UNKNOWN, NAV_FREE, NAV_OCCUPIED = -1, 0, 100


def hedge(*, passes: bool) -> PlanarScan:
    """Scan a slab before a wall, 2 to 3 m and 6 m ahead."""
    slope = 1 / np.cos(np.radians(np.linspace(-30, 30, 61)))
    n = len(slope)
    ones = np.ones(2 * n)
    slab = TargetEchoes(
        "slab",
        "leaf",
        0.7,
        0.3,
        False,
        passes,
        np.repeat(np.arange(n), 2),
        np.column_stack([2 * slope, 3 * slope]).ravel(),
        ("enter", "leave") * n,
        ones,
        ones,
    )
    wall = TargetEchoes(
        "wall",
        "stone",
        math.inf,
        0.0,
        False,
        False,
        np.arange(n),
        6 * slope,
        ("hit",) * n,
        ones[:n],
        ones[:n],
    )
    report = RangeScan(0.0, "lms200", math.radians(1), math.radians(60), 6 * slope)
    return read_scan(report, [slab, wall], max_range=20.0)


@pytest.fixture(scope="module")
def mapped(look: Look, room: Floats) -> OccupancyGrid:
    """A room, with a hedge and smoke outside, which no scan of the room reaches."""
    grid = OccupancyGrid()
    grid.add(HERE, look(room, HERE))
    grid.add(Pose2(8.02, 0.02, 0.0), hedge(passes=False))
    grid.add(Pose2(8.0, 8.0, 0.0), hedge(passes=True))
    return grid


def pixel_of(
    grid: OccupancyGrid, image: Image.Image, origin: list[float], x: float, y: float
) -> Any:
    """Look up a place as readers do: by the lower left corner, rows from the top."""
    column = math.floor((x - origin[0]) / grid.frame.resolution)
    row = math.floor((y - origin[1]) / grid.frame.resolution)
    return image.getpixel((column, image.height - 1 - row))


def loaded(grid: OccupancyGrid, mode: Any) -> tuple[NDArray[np.int16], dict[str, Any]]:
    """Read a map by the rules of nav2's map_server, row 0 in the south."""
    files = nav_map(grid, "yard", mode=mode)
    head = yaml.safe_load(files["yard.yaml"])
    with Image.open(io.BytesIO(files[head["image"]])) as image:
        colours = np.asarray(image.convert("RGBA"), np.float64) / 255
    shade = colours[..., :3].mean(axis=-1)
    occupied = shade if head["negate"] else 1 - shade
    free, full = head["free_thresh"], head["occupied_thresh"]
    if head["mode"] == "trinary":
        cells = np.full(shade.shape, NAV_UNKNOWN, np.int16)
    else:
        cells = np.rint((occupied - free) / (full - free) * 100).astype(np.int16)
    cells[occupied > full] = NAV_OCCUPIED
    cells[occupied < free] = NAV_FREE
    if head["mode"] == "scale":
        cells[colours[..., 3] < 1] = NAV_UNKNOWN
    return cells[::-1], head


def classes_in(grid: OccupancyGrid, head: dict[str, Any], shape: Any) -> Any:
    """Return the part of a map's classes that a file covers."""
    x, y, _ = head["origin"]
    row, column = grid.frame.cell(x + 0.01, y + 0.01) or (-1, -1)
    return grid.classes()[row : row + shape[0], column : column + shape[1]]


def test_trinary_is_loaded_with_the_same_classes(mapped: OccupancyGrid) -> None:
    cells, head = loaded(mapped, "trinary")
    classes = classes_in(mapped, head, cells.shape)
    assert head["image"] == "yard.pgm"
    assert (
        cells[(classes == CellClass.OBSTACLE) | (classes == CellClass.FOLIAGE)]
        == NAV_OCCUPIED
    ).all()
    assert (
        cells[(classes == CellClass.FREE) | (classes == CellClass.SMOKE)] == NAV_FREE
    ).all()
    assert (cells[classes == CellClass.UNKNOWN] == NAV_UNKNOWN).all()
    assert all((classes == kind).any() for kind in range(5))


def test_pgm_follows_the_format_specification(mapped: OccupancyGrid) -> None:
    files = nav_map(mapped, "yard")
    kind, comment, rest = files["yard.pgm"].split(b"\n", 2)
    assert comment == b"# radarsim map"
    width, height, most, pixels = rest.split(maxsplit=3)
    assert (kind, most) == (b"P5", b"255")
    assert len(pixels) == int(width) * int(height)
    levels = np.frombuffer(pixels, np.uint8).reshape(int(height), int(width))[::-1]
    read = np.full(levels.shape, NAV_UNKNOWN, np.int16)
    read[levels == 0] = NAV_OCCUPIED
    read[levels == 254] = NAV_FREE
    cells, _ = loaded(mapped, "trinary")
    assert (read == cells).all()


def test_scale_is_loaded_with_probabilities(mapped: OccupancyGrid) -> None:
    cells, head = loaded(mapped, "scale")
    classes = classes_in(mapped, head, cells.shape)
    assert head["mode"] == "scale"
    assert (cells[classes == CellClass.UNKNOWN] == NAV_UNKNOWN).all()
    known = cells[classes != CellClass.UNKNOWN]
    assert ((known >= 0) & (known <= 100)).all()
    assert (cells[classes == CellClass.OBSTACLE] > 90).all()
    assert (
        cells[classes == CellClass.FREE].max()
        < cells[classes == CellClass.FOLIAGE].min()
    )


def test_files_cover_the_sensed_area_with_a_margin(
    mapped: OccupancyGrid,
) -> None:
    cells, head = loaded(mapped, "trinary")
    classes = mapped.classes()
    assert (cells != NAV_UNKNOWN).sum() == (classes != CellClass.UNKNOWN).sum()
    assert cells.size < classes.size
    rows = np.flatnonzero((cells != NAV_UNKNOWN).any(axis=1))
    assert rows[0] == 10
    assert len(cells) - 1 - rows[-1] <= 10
    assert head["resolution"] == 0.05


@pytest.mark.parametrize(
    ("x", "y", "colour"),
    [
        pytest.param(1.0, 0.0, GREY, id="free, near the robot"),
        pytest.param(-2.21, -1.889, WHITE, id="free, far from it"),
        pytest.param(2.0, 1.0, BLUE, id="in a box"),
        pytest.param(10.5, 0.02, GREY, id="in foliage, near the robot"),
        pytest.param(12.0, 0.02, WHITE, id="behind foliage"),
        pytest.param(14.02, 0.02, BLACK, id="where beams end"),
    ],
)
def test_png_has_the_colours_of_usarcommander(
    mapped: OccupancyGrid, x: float, y: float, colour: tuple[int, int, int]
) -> None:
    _, head = loaded(mapped, "trinary")
    with Image.open(io.BytesIO(commander_png(mapped))) as image:
        assert pixel_of(mapped, image, head["origin"], x, y) == colour


def test_open_floor_is_left_out_5_m_beyond_everything(look: Look) -> None:
    grid = OccupancyGrid()
    pole = np.array([[[6.02, -0.1], [6.02, 0.1]]])
    grid.add(Pose2(0.02, 0.02, 0.0), look(pole, Pose2(0.02, 0.02, 0.0)))
    assert grid.frame.columns * grid.frame.resolution > 60
    head = yaml.safe_load(nav_map(grid, "yard")["yard.yaml"])
    # Floor counts as seen within 3 m.
    assert head["origin"][:2] == pytest.approx([-8, -8], abs=0.11)
    with Image.open(io.BytesIO(commander_png(grid))) as image:
        assert np.array(image.size) * 0.05 == pytest.approx([19, 16], abs=0.21)


def test_map_without_sensed_cells_is_one_unknown_cell() -> None:
    grid = OccupancyGrid()
    with pytest.raises(ValueError, match="a map without cells"):
        commander_png(grid)
    blind = read_scan(RangeScan(0.0, "lms200", 0.1, 1.0, np.zeros(3)), max_range=9.0)
    grid.add(HERE, blind)
    cells, _ = loaded(grid, "trinary")
    assert cells.tolist() == [[NAV_UNKNOWN]]


@pytest.mark.parametrize(
    "name", ["yard", 'my "yard": #1', "garten\u2028\x85", "\U0001f332"]
)
def test_yaml_names_its_image(mapped: OccupancyGrid, name: str) -> None:
    files = nav_map(mapped, name)
    head = yaml.safe_load(files[f"{name}.yaml"].decode("ascii"))
    assert head["image"] == f"{name}.pgm"
    assert head["image"] in files
