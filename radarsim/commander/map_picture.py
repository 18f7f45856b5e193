"""Maps as messages: a picture of what is sensed, and where it belongs."""

import base64
import io
from typing import Any, Final

import numpy as np
from matplotlib.colors import to_rgb
from PIL import Image

from radarsim.commander.requests import Colours
from radarsim.mapping.export import commander_pixels, sensed_window
from radarsim.mapping.occupancy_grid import CellClass, OccupancyGrid
from radarsim.plotting.maps import CELL_COLOURS

_SHADES: Final = np.array(
    [[round(255 * part) for part in to_rgb(CELL_COLOURS[each])] for each in CellClass],
    np.uint8,
)


def describe_map(robot: str, grid: OccupancyGrid, colours: Colours) -> dict[str, Any]:
    """Return the message ``map``.

    The first row of the picture is the northernmost; ``origin`` is the south-western
    corner, m, map frame.

    Args:
        robot: Name of the robot that it is a map of.
        grid: The map, which has taken in a scan.
        colours: Those of UsarCommander, or those of the materials.
    """
    rows, columns = sensed_window(grid)
    x, y = grid.frame.origin
    size = grid.frame.resolution
    if colours == "usarcommander":
        pixels = commander_pixels(grid)[rows, columns]
    else:
        pixels = _SHADES[grid.classes()[rows, columns]]
    data = io.BytesIO()
    Image.fromarray(np.flip(pixels, axis=0)).save(data, "png")
    height, width = pixels.shape[:2]
    return {
        "op": "map",
        "robot": robot,
        "resolution": size,
        "origin": [x + columns.start * size, y + rows.start * size],
        "width": width,
        "height": height,
        "colours": colours,
        "png": base64.b64encode(data.getvalue()).decode(),
    }
