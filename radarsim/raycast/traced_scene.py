"""Computes the engine's table of a scene's materials: losses for each class of rays."""

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import Packed, engine
from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.raycast.rays import RADAR, SONAR, RayClass
from radarsim.scene.material import ALBEDO, Material
from radarsim.scene.scene import REFLECTOR, Part, bounds_of

IGNORE, COLLECT, OPAQUE = range(3)  # values of ``Role`` in the engine
# Estimated number of sheets that a ray crosses per metre of leaves. It only affects the
# initial search distance of a ray.
SHEETS_PER_METRE: Final = 8.0


def attenuation_of(material: Material, ray_class: RayClass) -> float:
    """Return the power that a ray loses per metre in a material."""
    if ray_class.medium == SONAR:
        return math.inf if _reflects_sound(material) else 0.0
    per_db = ray_class.power_per_db
    if ray_class.medium == RADAR:
        if ray_class.in_decibels and material.attenuation_db is not None:
            return per_db * material.attenuation_db[ray_class.band]
        return material.density + per_db * material.radar_db[ray_class.band]
    return material.laser_density + per_db * material.laser_db


def absorption_of(material: Material, ray_class: RayClass) -> float:
    """Return the power that an opaque surface of a material absorbs.

    Absorption is specified in dB of the two-way echo. Penetration power counts one-way
    losses, so a loss that occurs once, at the hit, counts half.
    """
    if ray_class.medium == SONAR:
        return 0.0
    radar = ray_class.medium == RADAR
    if radar and not (ray_class.is_absorbed or material.radar_mirror):
        return 0.0
    decibels = material.absorption_db if radar else material.laser_absorption_db
    if decibels == 0 or math.isinf(decibels):
        return decibels  # Infinite absorption stays infinite if power_per_db is 0.
    return ray_class.power_per_db * decibels / 2


def passing_of(material: Material, ray_class: RayClass) -> float:
    """Return the power that a ray loses at each surface of a pane, such as glass."""
    decibels = material.transmission_db
    if decibels is None or ray_class.medium != RADAR:
        return math.inf
    return ray_class.power_per_db * decibels[ray_class.band] / 2


def _glint_cosine(angle: float) -> float:
    return math.cos(angle) if angle > 0 else 2.0


def scattering_of(material: Material, ray_class: RayClass) -> float:
    """Return the scattered share of a material's loss, relative to foliage.

    For light, all clouds and plants are assumed to scatter the same share.
    """
    return material.albedo / ALBEDO if ray_class.medium == RADAR else 1.0


def _reflects_sound(material: Material) -> bool:
    return material.solid or math.isinf(material.laser_density)


def centre_of(parts: Sequence[Part]) -> Floats:
    """Return the centre of the bounding box of all parts, (3,) m."""
    low, high = bounds_of(parts)
    return np.asarray((low + high) / 2)


def find_volumes(parts: Sequence[Part], centre: Floats) -> dict[str, NDArray[Any]]:
    """Find the penetrable volumes, with bounds relative to ``centre``.

    Returns:
        The fields ``volume``, ``low`` and ``high`` of a ``MaterialTable``.

    Raises:
        EngineError: If a penetrable part is neither closed nor a sheet.
    """
    volumes = [
        i
        for i, part in enumerate(parts)
        if part.material.penetrable and part.material.sheet_loss is None
    ]
    corners = [_bounds(parts[index]) - centre for index in volumes]
    low, high = np.array(corners).reshape(-1, 2, 3).transpose(1, 0, 2)
    return {
        "volume": np.array(volumes, np.int32),
        "low": np.vstack([low, low.min(axis=0, initial=np.inf)]),
        "high": np.vstack([high, high.max(axis=0, initial=-np.inf)]),
    }


def material_table(
    parts: Sequence[Part],
    volumes: dict[str, NDArray[Any]],
    ray_classes: Sequence[RayClass],
    air: Material | None,
) -> Packed:
    """Return the engine's ``MaterialTable`` for some classes of rays.

    Args:
        parts: All parts, with the air as the last part.
        volumes: The penetrable volumes of the parts, from ``find_volumes``.
        ray_classes: The ray classes, in the order of their indices.
        air: The material that fills the scene; None for clear air.
    """
    materials = [part.material for part in parts]
    sheet = np.array([material.sheet_loss is not None for material in materials], bool)
    density = _tabulate(parts, ray_classes, attenuation_of, np.float64)
    penetrable = np.isfinite(density)
    sheet_loss = _tabulate(parts, ray_classes, _sheet_loss_of, np.float64)
    passed = _tabulate(parts, ray_classes, _is_passed, bool)
    equivalent = np.where(np.isnan(sheet_loss), density, SHEETS_PER_METRE * sheet_loss)
    return engine.structures["MaterialTable"].pack(
        density=density,
        sheet_loss=sheet_loss,
        absorption=_tabulate(parts, ray_classes, absorption_of, np.float64),
        mirror=_tabulate(parts, ray_classes, _is_mirror, np.uint8),
        passing=_tabulate(parts, ray_classes, passing_of, np.float64),
        air=np.array([attenuation_of(air, c) if air else 0.0 for c in ray_classes]),
        max_reflections=np.array([c.max_reflections for c in ray_classes], np.int64),
        glint=np.array([_glint_cosine(c.glint) for c in ray_classes], np.float64),
        max_density=np.where(penetrable, equivalent, 0.0).max(axis=1, initial=0.0),
        forward_roles=np.where(
            passed, IGNORE, np.where(penetrable, COLLECT, OPAQUE)
        ).astype(np.uint8),
        backward_roles=np.where(penetrable & ~sheet, COLLECT, IGNORE).astype(np.uint8),
        **volumes,
    )


def _sheet_loss_of(material: Material, ray_class: RayClass) -> float:
    """Return a ray's loss per sheet; nan for a volume, 0 for light and sound."""
    if material.sheet_loss is None:
        return math.nan
    if ray_class.medium != RADAR:
        return 0.0
    if ray_class.in_decibels and material.sheet_attenuation_db is not None:
        return ray_class.power_per_db * material.sheet_attenuation_db[ray_class.band]
    return material.sheet_loss


def _is_passed(material: Material, ray_class: RayClass) -> bool:
    """Return whether rays ignore a material."""
    return ray_class.in_decibels and material == REFLECTOR


def _is_mirror(material: Material, ray_class: RayClass) -> float:
    radar = ray_class.medium == RADAR
    return float(material.radar_mirror if radar else material.laser_mirror)


def _tabulate(
    parts: Sequence[Part],
    ray_classes: Sequence[RayClass],
    value: Callable[[Material, RayClass], float | bool],
    dtype: Any,
) -> NDArray[Any]:
    """Return a table of a material property for C ray classes and P parts, (C, P)."""
    rows = [[value(part.material, each) for part in parts] for each in ray_classes]
    return np.array(rows, dtype).reshape(len(ray_classes), len(parts))


def _bounds(part: Part) -> Floats:
    """Return the lower and the upper corner of a volume's bounding box, (2, 3) m."""
    if not part.closed:
        raise EngineError(
            f"{part.object_name!r} of {part.material.name!r} has open edges,"
            " expected a closed volume or a material with sheet_loss"
        )
    return part.bounds
