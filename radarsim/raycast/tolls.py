"""What a scene's parts mean to rays: what they cost, and how rays take them."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.raycast.query import LISTED, OPAQUE, PASSED_BY
from radarsim.scene.scene import Part

MEDIA: Final = ("density", "laser_density")  # by ``RADAR`` and ``LASER``


class Tolls(NamedTuple):
    """The parts of a scene, for each medium.

    Attributes:
        density: (2, P) power per metre inside.
        sheet_loss: (2, P) power per crossed surface; nan for a volume.
        densest: (2,) the greatest density of all volumes; 0 if there is none.
        ahead: (2, P) uint8, how a ray takes the parts ahead of it.
        behind: (2, P) uint8, how it takes them to learn what it starts in.
        volume: (K,) int32, the penetrable volumes.
        low: (K + 1, 3) m, their least corners, and last that of all of them.
        high: (K + 1, 3) m, their greatest corners, and last that of all of them.
    """

    density: Floats
    sheet_loss: Floats
    densest: Floats
    ahead: NDArray[np.uint8]
    behind: NDArray[np.uint8]
    volume: NDArray[np.int32]
    low: Floats
    high: Floats


def middle_of(parts: Sequence[Part]) -> Floats:
    """Give the middle of the box around all parts, (3,) m."""
    corners = [part.vertices[part.faces].reshape(-1, 3) for part in parts]
    points = np.concatenate([np.zeros((0, 3)), *corners])
    if not len(points):
        return np.zeros(3)
    return np.asarray((points.min(axis=0) + points.max(axis=0)) / 2)


def tabulate(parts: Sequence[Part], middle: Floats) -> Tolls:
    """Make the tables.

    Raises:
        EngineError: If a penetrable part encloses nothing and is no sheet.
    """
    sheet = np.array([part.material.sheet_loss is not None for part in parts], bool)
    density = np.array(
        [[getattr(part.material, name) for part in parts] for name in MEDIA], np.float64
    )
    loss = np.full((2, len(parts)), np.nan)
    loss[0, sheet] = [
        part.material.sheet_loss
        for part, flat in zip(parts, sheet, strict=True)
        if flat
    ]
    loss[1, sheet] = 0.0  # a sheet that lets light through takes none
    through = np.isfinite(density)
    volumes = np.flatnonzero(through.any(axis=0) & ~sheet).tolist()
    corners = [_bounds(parts[index]) - middle for index in volumes]
    low, high = np.array(corners).reshape(-1, 2, 3).transpose(1, 0, 2)
    return Tolls(
        density,
        loss,
        np.where(through & ~sheet, density, 0.0).max(axis=1, initial=0.0),
        np.where(through, LISTED, OPAQUE).astype(np.uint8),
        np.where(through & ~sheet, LISTED, PASSED_BY).astype(np.uint8),
        np.array(volumes, np.int32),
        np.vstack([low, low.min(axis=0, initial=np.inf)]),
        np.vstack([high, high.max(axis=0, initial=-np.inf)]),
    )


def _bounds(part: Part) -> Floats:
    """Give the least and the greatest corner of a volume, (2, 3) m."""
    if not part.closed:
        raise EngineError(
            f"{part.object_name!r} of {part.material.name!r} has open edges,"
            " expected a closed volume or a material with sheet_loss"
        )
    points = part.vertices[part.faces].reshape(-1, 3)
    return np.array(
        [points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)]
    )
