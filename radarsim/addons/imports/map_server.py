"""Imports maps of nav2's map_server: a picture, and a YAML file with its frame.

Source: the documentation of nav2_map_server.
"""

import math
from collections.abc import Iterator
from pathlib import Path, PurePath
from typing import Annotated, Final, Literal, TypeAlias

import numpy as np
from annotated_types import Gt
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from radarsim.addons.imports.cli import ImportOptions
from radarsim.addons.imports.imported_map import ImportedMap
from radarsim.addons.imports.source_file import find_in, wrong
from radarsim.errors import ForeignFileError, describe_os_error
from radarsim.geometry import Floats, Pose3
from radarsim.validation import short_repr
from radarsim.yaml_reader import YamlFile, read_yaml

Mask: TypeAlias = NDArray[np.bool_]

MAX_PIXELS: Final = 64_000_000
FLOOR_DEPTH: Final = 0.2  # m; thickness of the floor


class MapServerKeys(BaseModel):
    """The keys of the YAML file of a map.

    Attributes:
        image: Path of the picture, relative to the file.
        resolution: Side of a pixel, m.
        origin: x, y, m, and yaw, rad, of the lower left corner.
        negate: Whether bright cells are occupied.
        occupied_thresh: Cells with a higher probability are occupied.
        free_thresh: Cells with a lower probability are free.
        mode: Meaning of the brightness.
    """

    model_config = ConfigDict(extra="allow", frozen=True)

    image: str
    resolution: Annotated[FiniteFloat, Gt(0)]
    origin: Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]
    negate: Literal[0, 1, False, True] = 0
    occupied_thresh: Annotated[FiniteFloat, Field(ge=0, le=1)] = 0.65
    free_thresh: Annotated[FiniteFloat, Field(ge=0, le=1)] = 0.196
    mode: Literal["trinary", "scale", "raw"] = "trinary"


def import_map_server(path: Path, options: ImportOptions, _: Path) -> ImportedMap:
    """Import a map as boxes that cover exactly the occupied cells.

    Args:
        path: The YAML file.
        options: Options of the import.

    Raises:
        ForeignFileError: If the file cannot be read, or is no map of map_server.
    """
    file, keys = _read(path)
    line = int(file.place(["image"]).rsplit(":", 2)[1])
    folders = (path.parent, *options.model_path)
    # The picture's path may be from another machine, so its file name alone is tried
    # too.
    name = PurePath(keys.image).name
    picture = find_in(folders, keys.image) or find_in(options.model_path, name)
    if picture is None:
        looked = ", ".join(repr(str(each)) for each in folders)
        hint = "expected --model-path with its folder"
        text = f"no picture {short_repr(keys.image)} in {looked}, {hint}"
        raise wrong(path, line, text)
    brightness, is_opaque = read_picture(picture)
    probability: Floats
    if keys.mode == "raw":  # percent; larger values, such as 255, mean unknown
        is_opaque = is_opaque & (brightness <= 100)
        probability = brightness / 100
    else:
        probability = (brightness if keys.negate else 255.0 - brightness) / 255
    # Transparent pixels are unknown, whatever their brightness.
    occupied = is_opaque & (probability > keys.occupied_thresh)
    free = is_opaque & (probability < keys.free_thresh)
    imported = ImportedMap(path, options)
    x, y, yaw = keys.origin
    corner, side = Pose3(x, y, 0.0, yaw=yaw), keys.resolution
    rows, columns = occupied.shape

    def pose(row: float, column: float, z: float) -> Pose3:
        """Return the pose of a point given in pixels from the map's top left corner."""
        return corner.compose(Pose3(column * side, (rows - row) * side, z))

    if options.start is None:
        found = roomiest(free)
        if found is None:
            raise wrong(path, line, "no free cell for the start, expected --start")
        start = pose(found[0] + 0.5, found[1] + 0.5, 0.0)
        imported.start = (start.x, start.y, 0.0, math.degrees(start.yaw))
    size = [round(columns * side, 5), round(rows * side, 5), FLOOR_DEPTH]
    middle = pose(rows / 2, columns / 2, -FLOOR_DEPTH / 2)
    imported.add("floor", {"box": size}, middle)
    height = options.wall_height
    for number, (top, left, bottom, right) in enumerate(rectangles(occupied), 1):
        lengths = (right - left) * side, (bottom - top) * side, height
        middle = pose((top + bottom) / 2, (left + right) / 2, height / 2)
        box = {"box": [round(each, 5) for each in lengths]}
        imported.add(f"wall_{number}", box, middle, imported.material_of("wall"))
    for key in keys.model_extra or {}:
        at = int(file.place([key], of_key=True).rsplit(":", 2)[1])
        imported.note(path, at, f"the key {key!r} is ignored")
    unknown = int(np.count_nonzero(~occupied & ~free))
    if unknown:
        imported.note(path, line, f"{unknown} unknown cells become free cells")
    return imported


def _read(path: Path) -> tuple[YamlFile, MapServerKeys]:
    try:
        file = read_yaml(path)
    except OSError as error:
        raise ForeignFileError(f"{path}: {describe_os_error(error)}") from error
    if file.problems:
        raise ForeignFileError(file.problems[0])
    try:
        return file, MapServerKeys.model_validate(file.data)
    except ValidationError as error:
        raise ForeignFileError(file.validation_problems(error)[0]) from error


def read_picture(path: Path) -> tuple[NDArray[np.uint8], Mask]:
    """Read the grey picture of a map.

    Returns:
        Brightness, 0 to 255, and whether a pixel is opaque, (H, W) each.

    Raises:
        ForeignFileError: If the picture cannot be read, or is too large.
    """
    try:
        with Image.open(path) as picture:
            width, height = picture.size
            if width * height > MAX_PIXELS:
                expected = f"expected at most {MAX_PIXELS} in all"
                raise wrong(path, 1, f"{width} x {height} pixels, {expected}")
            if picture.mode.startswith(("I", "F")):
                text = f"pixels of mode {picture.mode}, expected 8 bits"
                raise wrong(path, 1, text)
            # Pictures of all modes, such as palette or RGB, are converted to grey with
            # alpha.
            pixels = np.asarray(picture.convert("LA"))
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError) as error:
        text = "cannot be read, expected a picture such as PGM or PNG"
        raise wrong(path, 1, text) from error
    except Image.DecompressionBombError as error:
        raise wrong(path, 1, f"expected at most {MAX_PIXELS} pixels") from error
    return pixels[..., 0], pixels[..., 1] > 127


def rectangles(cells: Mask) -> Iterator[tuple[int, int, int, int]]:
    """Yield rectangles that together cover each of the given cells exactly once.

    A rectangle is (top, left, bottom, right); bottom and right are exclusive.

    Each rectangle starts with a whole run of cells in a row, and extends down as long
    as all cells below the run are set.
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
    """Return row and column of the free cell farthest from cells that are not free.

    The result is None if no cell is free.
    """
    from scipy import ndimage  # noqa: PLC0415 - slow import

    if not free.any():
        return None
    # With this padding, the area outside the picture counts as not free.
    room = ndimage.distance_transform_edt(np.pad(free, 1))[1:-1, 1:-1]
    row, column = np.unravel_index(np.argmax(room), room.shape)
    return int(row), int(column)
