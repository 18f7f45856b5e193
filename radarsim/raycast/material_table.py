"""What a scene's parts mean to rays: what they cost, and how rays take them."""

import math
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.raycast.intersect import LISTED, OPAQUE, PASSED_BY
from radarsim.raycast.rays import RADAR, RayClass
from radarsim.scene.material import Material
from radarsim.scene.scene import Part

# Sheets that a ray may meet in a metre of leaves, for a guess at how far it will come.
LAYERS: Final = 8.0


class MaterialTable(NamedTuple):
    """The parts of a scene, for each kind of ray.

    Attributes:
        density: (K, P) power per metre inside.
        sheet_loss: (K, P) power per crossed surface; nan for a volume.
        kept: (K, P) power that an opaque surface keeps.
        mirror: (K, P) uint8, whether an opaque surface is a mirror.
        air: (K,) power per metre everywhere.
        max_reflections: (K,) how often mirrors reflect a ray.
        densest: (K,) the greatest density of all volumes, and what comes near to it
            where the sheets are; 0 if there is none.
        ahead: (K, P) uint8, how a ray takes the parts ahead of it.
        behind: (K, P) uint8, how it takes them to learn what it starts in.
        volume: (V,) int32, the penetrable volumes.
        low: (V + 1, 3) m, their least corners, and last that of all of them.
        high: (V + 1, 3) m, their greatest corners, and last that of all of them.
    """

    density: Floats
    sheet_loss: Floats
    kept: Floats
    mirror: NDArray[np.uint8]
    air: Floats
    max_reflections: NDArray[np.int64]
    densest: Floats
    ahead: NDArray[np.uint8]
    behind: NDArray[np.uint8]
    volume: NDArray[np.int32]
    low: Floats
    high: Floats


def attenuation_of(material: Material, kind: RayClass) -> float:
    """Give the power that rays of a kind lose per metre in a material."""
    if kind.medium == RADAR:
        return material.density + kind.power_per_db * material.radar_db[kind.band]
    return material.laser_density + kind.power_per_db * material.laser_db


def absorption_of(material: Material, kind: RayClass) -> float:
    """Give the power that a surface of a material keeps of rays of a kind.

    What is lost where a ray ends is lost once, on a way that power counts one half of.
    """
    radar = kind.medium == RADAR
    decibels = material.absorption_db if radar else material.laser_absorption_db
    if decibels == 0 or math.isinf(decibels):
        return decibels
    return kind.power_per_db * decibels / 2


def middle_of(parts: Sequence[Part]) -> Floats:
    """Give the middle of the box around all parts, (3,) m."""
    corners = [part.vertices[part.faces].reshape(-1, 3) for part in parts]
    points = np.concatenate([np.zeros((0, 3)), *corners])
    if not len(points):
        return np.zeros(3)
    return np.asarray((points.min(axis=0) + points.max(axis=0)) / 2)


class Volumes(NamedTuple):
    """The penetrable volumes of a scene; attributes as in ``MaterialTable``."""

    volume: NDArray[np.int32]
    low: Floats
    high: Floats


def find_volumes(parts: Sequence[Part], middle: Floats) -> Volumes:
    """Find the volumes that any ray penetrates.

    Raises:
        EngineError: If a penetrable part encloses nothing and is no sheet.
    """
    volumes = [
        i
        for i, part in enumerate(parts)
        if part.material.penetrable and part.material.sheet_loss is None
    ]
    corners = [_bounds(parts[index]) - middle for index in volumes]
    low, high = np.array(corners).reshape(-1, 2, 3).transpose(1, 0, 2)
    return Volumes(
        np.array(volumes, np.int32),
        np.vstack([low, low.min(axis=0, initial=np.inf)]),
        np.vstack([high, high.max(axis=0, initial=-np.inf)]),
    )


def tabulate(
    parts: Sequence[Part],
    volumes: Volumes,
    kinds: Sequence[RayClass],
    air: Material | None,
) -> MaterialTable:
    """Make the tables for some kinds of rays.

    Args:
        parts: All parts, the air's last.
        volumes: Of them.
        kinds: In the order of their numbers.
        air: What fills the scene; None for nothing.
    """
    made_of = [part.material for part in parts]
    sheet = np.array([material.sheet_loss is not None for material in made_of], bool)
    density = np.array([[attenuation_of(m, kind) for m in made_of] for kind in kinds])
    density = density.reshape(len(kinds), len(parts))
    through = np.isfinite(density)
    loss = np.full(density.shape, np.nan)
    for row, kind in zip(loss, kinds, strict=True):
        row[sheet] = [
            material.sheet_loss if kind.medium == RADAR else 0.0
            for material in made_of
            if material.sheet_loss is not None
        ]  # a sheet that lets light through takes none
    return MaterialTable(
        density,
        loss,
        _table(parts, kinds, absorption_of, np.float64),
        _table(parts, kinds, _is_mirror, np.uint8),
        np.array([attenuation_of(air, kind) if air else 0.0 for kind in kinds]),
        np.array([kind.max_reflections for kind in kinds], np.int64),
        np.where(through, _like_density(density, loss), 0.0).max(axis=1, initial=0.0),
        np.where(through, LISTED, OPAQUE).astype(np.uint8),
        np.where(through & ~sheet, LISTED, PASSED_BY).astype(np.uint8),
        *volumes,
    )


def _like_density(density: Floats, loss: Floats) -> Floats:
    """Give what volumes cost per metre, and about what sheets do, (K, P)."""
    return np.where(np.isnan(loss), density, LAYERS * loss)


def _is_mirror(material: Material, kind: RayClass) -> float:
    radar = kind.medium == RADAR
    return float(material.radar_mirror if radar else material.laser_mirror)


def _table(
    parts: Sequence[Part],
    kinds: Sequence[RayClass],
    value: Callable[[Material, RayClass], float],
    dtype: Any,
) -> NDArray[Any]:
    """Tabulate what each part's material is to each kind of ray, (K, P)."""
    rows = [[value(part.material, kind) for part in parts] for kind in kinds]
    return np.array(rows, dtype).reshape(len(kinds), len(parts))


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
