"""Maps of nav2's map_server: a picture, and a YAML file that tells where it is.

Source: the documentation of nav2_map_server.
"""

from pathlib import Path, PurePath
from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from radarsim.addons.imports.cli import ImportOptions
from radarsim.addons.imports.imported_map import ImportedMap
from radarsim.addons.imports.plan_picture import (
    Plan,
    add_floor,
    add_walls,
    place_start,
    read_picture,
)
from radarsim.addons.imports.source_file import find_in
from radarsim.addons.imports.xml_reader import wrong
from radarsim.errors import ForeignFileError, describe_os_error
from radarsim.geometry import Floats, Pose3
from radarsim.validation import short_repr
from radarsim.yaml_reader import YamlFile, read_yaml

KNOWN = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")


class MapServerKeys(BaseModel):
    """The keys of the YAML file.

    Attributes:
        image: The picture, relative to the file.
        resolution: Side of a pixel, m.
        origin: x, y, m, and yaw, rad, of the lower left corner.
        negate: Whether bright is occupied.
        occupied_thresh: Cells of a higher probability are occupied.
        free_thresh: Cells of a lower one are free.
        mode: How brightness is read.
    """

    model_config = ConfigDict(extra="allow", frozen=True)

    image: str
    resolution: Annotated[FiniteFloat, Gt(0)]
    origin: Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]
    negate: Literal[0, 1, False, True] = 0
    occupied_thresh: Annotated[FiniteFloat, Field(ge=0, le=1)] = 0.65
    free_thresh: Annotated[FiniteFloat, Field(ge=0, le=1)] = 0.196
    mode: Literal["trinary", "scale", "raw"] = "trinary"


def import_map_server(path: Path, options: ImportOptions) -> ImportedMap:
    """Import a map; occupied cells become boxes that cover them exactly.

    Args:
        path: The YAML file.
        options: What it does not tell.

    Raises:
        ForeignFileError: If it cannot be read, or is not such a map.
    """
    file, keys = _read(path)
    line = int(file.place(["image"]).rsplit(":", 2)[1])
    folders = (path.parent, *options.model_path)
    picture = find_in(folders, keys.image)
    if picture is None:  # paths of the machine that wrote the map
        picture = find_in(options.model_path, PurePath(keys.image).name)
    if picture is None:
        looked = ", ".join(repr(str(each)) for each in folders)
        cure = "expected it there, or its folder as --model-path"
        text = f"no picture {short_repr(keys.image)} below {looked}, {cure}"
        raise wrong(path, line, text)
    brightness, is_opaque = read_picture(picture)
    probability: Floats
    if keys.mode == "raw":  # percent; more, as 255, is unknown
        is_opaque = is_opaque & (brightness <= 100)
        probability = brightness / 100
    else:
        probability = (brightness if keys.negate else 255.0 - brightness) / 255
    # Transparent pixels are unknown, whatever they look like.
    occupied = is_opaque & (probability > keys.occupied_thresh)
    free = is_opaque & (probability < keys.free_thresh)
    imported = ImportedMap(path, options)
    x, y, yaw = keys.origin
    side = keys.resolution
    plan = Plan(side, side, Pose3(x, y, 0.0, yaw=yaw), len(occupied))
    if not place_start(imported, free, plan):
        raise ForeignFileError(f"{path}:{line}: no free cell, expected --start")
    add_floor(imported, occupied.shape, plan)
    add_walls(imported, occupied, plan, "wall", options.wall_height)
    for key in keys.model_extra or {}:
        at = int(file.place([key], of_key=True).rsplit(":", 2)[1])
        imported.note(path, at, f"the key {key!r} is not read")
    unknown = int(np.count_nonzero(~occupied & ~free))
    if unknown:
        imported.note(path, line, f"{unknown} cells that are unknown become free")
    return imported


def _read(path: Path) -> tuple[YamlFile, MapServerKeys]:
    try:
        file = read_yaml(path)
    except OSError as error:
        raise ForeignFileError(f"{path}: {describe_os_error(error)}") from error
    if file.problems:
        raise ForeignFileError(file.problems[0])
    if not isinstance(file.data, dict):
        raise ForeignFileError(f"{path}:1: expected keys such as {', '.join(KNOWN)}")
    try:
        return file, MapServerKeys.model_validate(file.data)
    except ValidationError as error:
        raise ForeignFileError(file.validation_problems(error)[0]) from error
