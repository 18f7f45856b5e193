"""Maps read by the rules of nav2's map_server."""

import io
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image

UNKNOWN, FREE, OCCUPIED = -1, 0, 100


def load_nav_map(files: dict[str, bytes]) -> tuple[NDArray[np.int16], dict[str, Any]]:
    """Return the cells of a map, row 0 in the south, and the head of its files."""
    (name,) = (name for name in files if name.endswith(".yaml"))
    head = yaml.safe_load(files[name])
    with Image.open(io.BytesIO(files[head["image"]])) as image:
        colours = np.asarray(image.convert("RGBA"), np.float64) / 255
    shade = colours[..., :3].mean(axis=-1)
    occupied = shade if head["negate"] else 1 - shade
    free, full = head["free_thresh"], head["occupied_thresh"]
    if head["mode"] == "trinary":
        cells = np.full(shade.shape, UNKNOWN, np.int16)
    else:
        cells = np.rint((occupied - free) / (full - free) * 100).astype(np.int16)
    cells[occupied > full] = OCCUPIED
    cells[occupied < free] = FREE
    if head["mode"] == "scale":
        cells[colours[..., 3] < 1] = UNKNOWN
    return cells[::-1], head
