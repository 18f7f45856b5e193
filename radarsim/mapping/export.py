"""Maps as files that others read: UsarCommander's picture, and what nav2 loads."""

import io
import json
import math
from typing import Final, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from radarsim.mapping.occupancy_grid import (
    CellClass,
    Mask,
    OccupancyGrid,
)

NavMode: TypeAlias = Literal["trinary", "scale"]

BLUE, WHITE, GREY, BLACK = (0, 0, 255), (255, 255, 255), (160, 160, 160), (0, 0, 0)
MARGIN: Final = 0.5  # m of what is not sensed around what is
OCCUPIED_LEVEL, UNKNOWN_LEVEL, FREE_LEVEL = 0, 205, 254
OCCUPIED_FROM: Final = 0.65
# What is unknown is 50/255 = 0.19608; the 0.25 that many files have would make it free.
FREE_BELOW: Final = 0.196


_PLANE: Final = 0xFFFF  # the last letter that JSON escapes by itself
MARK: Final = "radarsim map"
HEAD: Final = 64  # bytes, within which a file says so


def is_ours(head: bytes) -> bool:
    """Tell by its beginning whether a file of a map is by this program."""
    return MARK.encode() in head[:HEAD]


def commander_png(grid: OccupancyGrid) -> bytes:
    """Draw a map in the colours of UsarCommander, as a PNG.

    Blue is what no beam has been in, white what one has, grey what is free within the
    short range, in foliage too, black where beams end.
    """
    picture = np.zeros((*grid.frame.shape, 3), np.uint8)
    picture[:] = BLUE
    picture[grid.sensed_cells()] = WHITE
    picture[grid.short_range_cells()] = GREY
    picture[grid.beam_end_cells()] = BLACK
    rows, columns = _frame(grid)
    return _encoded(picture[rows, columns], "png")


def nav_map(
    grid: OccupancyGrid, name: str, *, mode: NavMode = "trinary"
) -> dict[str, bytes]:
    """Write a map as nav2's map_server loads it.

    Foliage is occupied, as robots cannot drive there. Trinary is a PGM of occupied,
    free and unknown. Scale tells probabilities; there only transparency is unknown,
    which a PGM does not have, so it is a PNG, as map_saver makes it.

    Args:
        grid: The map.
        name: Of the files, without an ending.
        mode: Of map_server.

    Returns:
        Names of files with what is in them: the image, and the YAML that names it.
    """
    rows, columns = _frame(grid)
    if mode == "trinary":
        image, data = f"{name}.pgm", _encoded(_trinary(grid)[rows, columns], "ppm")
    else:
        image, data = f"{name}.png", _encoded(_scale(grid)[rows, columns], "png")
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
    """Write a name in ASCII as YAML reads it; JSON's pairs of surrogates are none."""
    letters = (
        f"\\U{ord(one):08X}" if ord(one) > _PLANE else json.dumps(one)[1:-1]
        for one in name
    )
    return f'"{"".join(letters)}"'


def _encoded(pixels: NDArray[np.uint8], form: str) -> bytes:
    """Write an image of cells, whose first row is the southernmost."""
    data, said = io.BytesIO(), PngInfo()
    said.add_text("Software", MARK)
    Image.fromarray(np.flip(pixels, axis=0)).save(data, form, pnginfo=said)
    if form == "png":
        return data.getvalue()
    kind, rest = data.getvalue().split(b"\n", 1)
    return b"\n".join([kind, f"# {MARK}".encode(), rest])


def _trinary(grid: OccupancyGrid) -> NDArray[np.uint8]:
    levels = np.full(5, FREE_LEVEL, np.uint8)
    levels[CellClass.UNKNOWN] = UNKNOWN_LEVEL
    levels[[CellClass.OBSTACLE, CellClass.FOLIAGE]] = OCCUPIED_LEVEL
    return levels[grid.classes()]


def _scale(grid: OccupancyGrid) -> NDArray[np.uint8]:
    """Give grey and alpha."""
    occupancy_probability = grid.occupancy_probability()
    known = np.isfinite(occupancy_probability)
    levels = np.zeros((*occupancy_probability.shape, 2), np.uint8)
    levels[known, 0] = np.rint(255 * (1 - occupancy_probability[known]))
    levels[known, 1] = 255
    return levels


def _frame(grid: OccupancyGrid) -> tuple[slice, slice]:
    """Give the rows and columns of what is sensed, with a margin; one cell if nothing.

    Raises:
        ValueError: If the map has no cells.
    """
    sensed = grid.sensed_cells()
    if not sensed.size:
        raise ValueError("a map without cells, expected one that has taken in a scan")
    margin = math.ceil(MARGIN / grid.frame.resolution)
    return _span(sensed, 0, margin), _span(sensed, 1, margin)


def _span(sensed: Mask, axis: int, margin: int) -> slice:
    found = np.flatnonzero(sensed.any(axis=1 - axis))
    if not len(found):
        return slice(0, 1)
    first, last = int(found[0]), int(found[-1])
    return slice(max(first - margin, 0), min(last + margin + 1, sensed.shape[axis]))
