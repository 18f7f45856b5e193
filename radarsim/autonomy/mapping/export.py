"""Export of maps as UsarCommander images and as files for nav2's map_server."""

import io
import json
import math
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from radarsim.autonomy.mapping.occupancy_grid import (
    CellClass,
    Mask,
    OccupancyGrid,
)

NavMode: TypeAlias = Literal["trinary", "scale"]

BLUE, WHITE, GREY, BLACK = (0, 0, 255), (255, 255, 255), (160, 160, 160), (0, 0, 0)
# Classes of cells, and the colours that UsarCommander expects for them.
COMMANDER_CELLS: Final = {
    "unknown": BLUE,
    "sensed": WHITE,
    "free, near": GREY,
    "beams end": BLACK,
}
_COMMANDER_COLOURS: Final = np.array([*COMMANDER_CELLS.values()], np.uint8)
MARGIN: Final = 0.5  # m of unknown cells around the sensed cells
OPEN_SPACE: Final = 5.0  # m of open floor around other known cells
OCCUPIED_LEVEL, UNKNOWN_LEVEL, FREE_LEVEL = 0, 205, 254
OCCUPIED_FROM: Final = 0.65
# Unknown cells have an occupancy of 50/255 = 0.19608.
# With the common threshold 0.25 they would count as free.
FREE_BELOW: Final = 0.196

_LAST_BMP: Final = 0xFFFF  # JSON escapes later characters as surrogate pairs
# A later map may only replace files that contain this mark.
MARK: Final = "radarsim map"
HEAD: Final = 64  # bytes at the beginning of a file that contain the mark


def commander_pixels(grid: OccupancyGrid) -> NDArray[np.uint8]:
    """Return an image, (R, C, 3), of all cells in the colours of UsarCommander.

    Unknown cells are blue, sensed cells white, cells free within the short range grey
    (in foliage, too), and cells where beams end black. The first row is the
    southernmost.
    """
    # The order matters, since each class of cells overwrites earlier ones.
    numbers = grid.sensed_cells().astype(np.uint8)
    numbers[grid.short_range_cells()] = 2
    numbers[grid.beam_end_cells()] = 3
    return _COMMANDER_COLOURS[numbers]


def commander_png(grid: OccupancyGrid) -> bytes:
    """Return a PNG of the sensed part of a map in the colours of UsarCommander."""
    rows, columns = sensed_window(grid)
    return _encoded(commander_pixels(grid)[rows, columns], "png")


def nav_map(
    grid: OccupancyGrid, name: str, *, mode: NavMode = "trinary"
) -> dict[str, bytes]:
    """Return a map as the contents of files for nav2's map_server.

    Foliage is occupied, since robots cannot drive there. ``trinary`` is a PGM with
    occupied, free and unknown cells. ``scale`` holds probabilities, with unknown cells
    transparent; a PGM has no transparency, so it is a PNG, as map_saver writes it.

    Args:
        grid: The map.
        name: Name of the files, without a suffix.
        mode: Mode of map_server.

    Returns:
        The contents of the files by name: the image, and the YAML that names the image.
    """
    rows, columns = sensed_window(grid)
    if mode == "trinary":
        # All other classes are free. Smoke is free
        # as well, since robots can drive through it.
        levels = np.full(len(CellClass), FREE_LEVEL, np.uint8)
        levels[CellClass.UNKNOWN] = UNKNOWN_LEVEL
        levels[[CellClass.OBSTACLE, CellClass.FOLIAGE]] = OCCUPIED_LEVEL
        image, pixels, image_format = f"{name}.pgm", levels[grid.classes()], "ppm"
    else:
        probability = grid.occupancy_probability()
        known = np.isfinite(probability)
        pixels = np.zeros((*probability.shape, 2), np.uint8)  # grey and opacity
        # Dark pixels are occupied: the YAML file declares this with ``negate: 0``.
        pixels[known, 0] = np.rint(255 * (1 - probability[known]))
        pixels[known, 1] = 255
        image, image_format = f"{name}.png", "png"
    data = _encoded(pixels[rows, columns], image_format)
    x, y = grid.frame.origin
    size = grid.frame.resolution
    corner = x + columns.start * size, y + rows.start * size
    lines = [
        f"# {MARK}",
        f"image: {_quoted(image)}",
        f"mode: {mode}",
        f"resolution: {size:.6g}",
        f"origin: [{corner[0]:.6f}, {corner[1]:.6f}, 0.0]",
        "negate: 0",
        f"occupied_thresh: {OCCUPIED_FROM}",
        f"free_thresh: {FREE_BELOW}",
    ]
    return {image: data, f"{name}.yaml": ("\n".join(lines) + "\n").encode()}


def _quoted(name: str) -> str:
    """Return a name as a YAML string in ASCII; YAML does not allow surrogate pairs."""
    letters = (
        f"\\U{ord(letter):08X}" if ord(letter) > _LAST_BMP else json.dumps(letter)[1:-1]
        for letter in name
    )
    return f'"{"".join(letters)}"'


def _encoded(pixels: NDArray[np.uint8], image_format: str) -> bytes:
    """Encode an image of a map whose first row is the southernmost."""
    data, info = io.BytesIO(), PngInfo()
    info.add_text("Software", MARK)
    Image.fromarray(np.flip(pixels, axis=0)).save(data, image_format, pnginfo=info)
    # Unlike PNG files, PGM files have no text
    # chunks, so the mark is written as a comment.
    if image_format == "png":
        return data.getvalue()
    magic, rest = data.getvalue().split(b"\n", 1)
    return b"\n".join([magic, f"# {MARK}".encode(), rest])


def sensed_window(grid: OccupancyGrid) -> tuple[slice, slice]:
    """Return the rows and columns of the sensed cells plus a margin of 0.5 m.

    Without sensed cells, one cell is returned. Open floor is cropped at 5 m around
    cells that are not free or were seen at short range, since beams without a return
    sense it up to their maximum range.

    Raises:
        ValueError: If the map has no cells.
    """
    sensed = grid.sensed_cells()
    if not sensed.size:
        raise ValueError("an empty map, expected a map of at least one scan")
    near = grid.short_range_cells() | (grid.classes() > CellClass.FREE)
    size = grid.frame.resolution
    return _sensed_span(sensed, near, 0, size), _sensed_span(sensed, near, 1, size)


def _sensed_span(sensed: Mask, near: Mask, axis: int, resolution: float) -> slice:
    lines = np.flatnonzero(sensed.any(axis=1 - axis))
    if not len(lines):
        return slice(0, 1)
    margin, space = (math.ceil(length / resolution) for length in (MARGIN, OPEN_SPACE))
    around = np.flatnonzero(near.any(axis=1 - axis))
    if not len(around):
        around = lines
    first = max(int(lines[0]) - margin, int(around[0]) - space, 0)
    last = min(int(lines[-1]) + margin, int(around[-1]) + space)
    return slice(first, min(last + 1, sensed.shape[axis]))
