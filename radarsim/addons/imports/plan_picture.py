"""Occupied cells of a picture, as boxes."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from radarsim.addons.imports.imported_map import ImportedMap
from radarsim.errors import ForeignFileError
from radarsim.geometry import Pose3

Mask = NDArray[np.bool_]

MAX_PIXELS: Final = 64_000_000
FLOOR_DEPTH: Final = 0.2  # m


class Plan(NamedTuple):
    """Where cells are: the first row is the northernmost.

    Attributes:
        width: Length of a cell along its row, m.
        height: Length of a cell across it, m.
        corner: Pose of the south-western corner, map frame.
        rows: Number of rows.
    """

    width: float
    height: float
    corner: Pose3
    rows: int

    def pose(self, row: float, column: float, z: float) -> Pose3:
        """Return the pose of a place, in rows and columns from the top left corner."""
        across = (self.rows - row) * self.height
        return self.corner.compose(Pose3(column * self.width, across, z))


def read_picture(path: Path) -> tuple[NDArray[np.uint8], Mask]:
    """Read a grey picture.

    Returns:
        (H, W) brightness, 0 to 255, and which pixels are not transparent.

    Raises:
        ForeignFileError: If it cannot be read, or is too large.
    """
    try:
        with Image.open(path) as picture:
            width, height = picture.size
            if width * height > MAX_PIXELS:
                text = (
                    f"{width} x {height} pixels, expected at most {MAX_PIXELS} in all"
                )
                raise ForeignFileError(f"{path}:1: {text}")
            if picture.mode.startswith(("I", "F")):
                text = f"pixels of mode {picture.mode}, expected 8 bits"
                raise ForeignFileError(f"{path}:1: {text}")
            # Grey and alpha of any mode: palettes, colours and single bits.
            pixels = np.asarray(picture.convert("LA"))
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError) as error:
        text = "cannot be read, expected a picture such as PGM or PNG"
        raise ForeignFileError(f"{path}:1: {text}") from error
    except Image.DecompressionBombError as error:
        text = f"expected at most {MAX_PIXELS} pixels"
        raise ForeignFileError(f"{path}:1: {text}") from error
    return pixels[..., 0], pixels[..., 1] > 127


def add_walls(
    imported: ImportedMap, occupied: Mask, plan: Plan, name: str, height: float
) -> None:
    """Add a box for each rectangle of occupied cells.

    Args:
        imported: The map.
        occupied: (H, W) cells.
        plan: Where they are.
        name: What the names of boxes begin with.
        height: Height of the boxes, m.
    """
    for number, (top, left, bottom, right) in enumerate(rectangles(occupied), 1):
        size = (right - left) * plan.width, (bottom - top) * plan.height, height
        pose = plan.pose((top + bottom) / 2, (left + right) / 2, height / 2)
        shape = {"box": [round(side, 5) for side in size]}
        imported.add(f"{name}_{number}", shape, pose, imported.material_of(name))


def add_floor(imported: ImportedMap, shape: tuple[int, int], plan: Plan) -> None:
    """Add a floor below all cells."""
    rows, columns = shape
    size = columns * plan.width, rows * plan.height, FLOOR_DEPTH
    pose = plan.pose(rows / 2, columns / 2, -FLOOR_DEPTH / 2)
    imported.add("floor", {"box": [round(side, 5) for side in size]}, pose)


def rectangles(cells: Mask) -> Iterator[tuple[int, int, int, int]]:
    """Yield rectangles that cover cells, each of these once.

    Each is top, left, bottom and right; rows and columns end before the last two.

    Each one begins with a whole run of cells in a row, and goes on down the rows as
    long as all cells below it are there.
    """
    left = cells.copy()
    for top in range(len(left)):
        edges = np.flatnonzero(np.diff(np.pad(left[top].astype(np.int8), 1)))
        for first, last in edges.reshape(-1, 2).tolist():
            bottom = top + 1
            while bottom < len(left) and left[bottom, first:last].all():
                bottom += 1
            left[top:bottom, first:last] = False
            yield top, first, bottom, last


def roomiest(free: Mask) -> tuple[int, int] | None:
    """Return row and column of the free cell farthest from all others; None if none."""
    from scipy import ndimage  # noqa: PLC0415 - takes long

    if not free.any():
        return None
    # padded, since what is beyond the picture is not free either
    room = ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1]
    row, column = np.unravel_index(np.argmax(room), room.shape)
    return int(row), int(column)


def place_start(imported: ImportedMap, free: Mask, plan: Plan) -> bool:
    """Place the start where there is most room, if no other is asked for.

    Returns:
        Whether there is one.
    """
    if imported.options.start is not None:
        return True
    found = roomiest(free)
    if found is not None:
        row, column = found
        pose = plan.pose(row + 0.5, column + 0.5, 0.0)
        imported.start = (pose.x, pose.y, 0.0, math.degrees(pose.yaw))
    return found is not None
