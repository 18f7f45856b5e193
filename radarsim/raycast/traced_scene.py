"""A scene as kernels take it: what its materials mean for each class of rays.

There are some twenty arrays, passed as the addresses of all. numba takes 0.1 to 0.2 us
to unpack each array among the arguments of a call, and a scan of ten beams takes 12 us
in all (row d of the benchmarks; row j has many short scans). So what stays the same
from call to call is passed in one array: ``pack`` writes addresses and shapes into it,
from which the kernel makes the arrays again.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numba.np.numpy_support import carray
from numpy.typing import NDArray

from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.jit import njit_cached
from radarsim.raycast.intersect import (
    COLLECT,
    IGNORE,
    OPAQUE,
    Roles,
    SceneHandle,
    pointer,
)
from radarsim.raycast.rays import RADAR, SONAR, RayClass
from radarsim.scene.material import ALBEDO, Material
from radarsim.scene.reflectors import REFLECTOR
from radarsim.scene.scene import Part, bounds_of

# For each array: its address, and its lengths in up to three dimensions.
Words = NDArray[np.uint64]


class PackedArrays(NamedTuple):
    """Arrays in one array.

    Attributes:
        words: What describes them; valid as long as they exist.
        arrays: The arrays.
    """

    words: Words
    arrays: list[NDArray[Any]]


def pack(arrays: Sequence[NDArray[Any]], dtypes: str) -> PackedArrays:
    """Pack arrays of at most three dimensions.

    Args:
        arrays: The arrays.
        dtypes: The type of each that the kernel assumes, as numpy writes it, separated
            by spaces.
    """
    # Kept with the words, as Python would free an array that only an address names.
    kept = [
        np.ascontiguousarray(array, dtype)
        for array, dtype in zip(arrays, dtypes.split(), strict=True)
    ]
    words = np.zeros((len(kept), 4), np.uint64)
    for row, array in zip(words, kept, strict=True):
        row[0] = array.ctypes.data
        row[1 : 1 + array.ndim] = array.shape
    return PackedArrays(words, kept)


class MaterialTable(NamedTuple):
    """The parts of a scene as each class of rays experiences them.

    C is the number of ray classes, P of parts, V of volumes.

    Attributes:
        density: (C, P) power lost per metre inside.
        sheet_loss: (C, P) power lost per crossed surface; nan for a volume.
        absorption: (C, P) power that an opaque surface absorbs.
        mirror: (C, P) uint8, whether an opaque surface is a mirror.
        passing: (C, P) power that each surface of a pane takes from a ray that passes;
            inf for what is none.
        air: (C,) power lost per metre everywhere.
        max_reflections: (C,) how many mirrors reflect a ray.
        glint: (C,) cosine of the angle to a mirror's normal up to which the mirror ends
            a ray; above 1 for none.
        max_density: (C,) the greatest density of the volumes, or its equivalent for
            sheets; 0 if there are neither.
        forward_roles: (C, P) uint8, what a ray does with the parts ahead of it:
            ``IGNORE``, ``COLLECT`` or stop at an ``OPAQUE`` one.
        backward_roles: (C, P) uint8, the same behind its start, where only volumes
            matter.
        volume: (V,) int32, the parts that are penetrable volumes.
        low: (V + 1, 3) m, the lower corners of their bounding boxes; the last row is
            that of all volumes together.
        high: (V + 1, 3) m, the upper corners, likewise.
    """

    density: Floats
    sheet_loss: Floats
    absorption: Floats
    mirror: NDArray[np.uint8]
    passing: Floats
    air: Floats
    max_reflections: NDArray[np.int64]
    glint: Floats
    max_density: Floats
    forward_roles: Roles
    backward_roles: Roles
    volume: NDArray[np.int32]
    low: Floats
    high: Floats


class TracedScene(NamedTuple):
    """A scene as ``trace_rays`` uses it.

    Attributes:
        handle: The ``SceneHandle`` of the Embree scene and its slices.
        centre: (3,) m, map frame, the origin of all other coordinates.
        materials: The table of its materials for the classes of the rays.
        triangles: (T, 9) m, the corners of all triangles.
        boxes: (B, 10) the boxes of the robots, from ``Boxes.table``.
        unsliced: (2,) zeros at first, updated by ``select_scene``.
    """

    handle: SceneHandle
    centre: Floats
    materials: MaterialTable
    triangles: Floats
    boxes: Floats
    unsliced: Floats


# The types of the arrays in a packed scene: those of its handle, and the others.
HANDLE_DTYPES: Final = "u8 u8 f8 i8 f8"
SCENE_DTYPES: Final = f"{HANDLE_DTYPES} f8 f8 f8 u1 f8 f8 i8 f8 f8 u1 u1 i4 f8 f8 f8 f8"


def pack_scene(
    handle: SceneHandle, centre: Floats, materials: MaterialTable, triangles: Floats
) -> PackedArrays:
    """Pack a scene; arguments as the attributes of ``TracedScene``."""
    addresses = np.array([handle.intersect, handle.point_query, handle.on_nearby])
    scenes = handle.scenes, handle.heights, handle.sliced
    lengths = np.array([handle.radius, handle.margin])
    return pack(
        [addresses, *scenes, lengths, *materials, centre, triangles], SCENE_DTYPES
    )


@njit_cached
def unpack_scene(words: Words, boxes: Floats) -> TracedScene:
    """Return the scene of the words of a packed one, in the order of ``pack_scene``."""
    addresses = carray(pointer(words[0, 0]), 3, np.uint64)
    lengths = carray(pointer(words[4, 0]), 2, np.float64)
    handle = SceneHandle(
        addresses[0],
        addresses[1],
        addresses[2],
        carray(pointer(words[1, 0]), (words[1, 1], words[1, 2]), np.uint64),
        carray(pointer(words[2, 0]), words[2, 1], np.float64),
        carray(pointer(words[3, 0]), words[3, 1], np.int64),
        lengths[0],
        lengths[1],
    )
    materials = MaterialTable(
        carray(pointer(words[5, 0]), (words[5, 1], words[5, 2]), np.float64),
        carray(pointer(words[6, 0]), (words[6, 1], words[6, 2]), np.float64),
        carray(pointer(words[7, 0]), (words[7, 1], words[7, 2]), np.float64),
        carray(pointer(words[8, 0]), (words[8, 1], words[8, 2]), np.uint8),
        carray(pointer(words[9, 0]), (words[9, 1], words[9, 2]), np.float64),
        carray(pointer(words[10, 0]), words[10, 1], np.float64),
        carray(pointer(words[11, 0]), words[11, 1], np.int64),
        carray(pointer(words[12, 0]), words[12, 1], np.float64),
        carray(pointer(words[13, 0]), words[13, 1], np.float64),
        carray(pointer(words[14, 0]), (words[14, 1], words[14, 2]), np.uint8),
        carray(pointer(words[15, 0]), (words[15, 1], words[15, 2]), np.uint8),
        carray(pointer(words[16, 0]), words[16, 1], np.int32),
        carray(pointer(words[17, 0]), (words[17, 1], words[17, 2]), np.float64),
        carray(pointer(words[18, 0]), (words[18, 1], words[18, 2]), np.float64),
    )
    centre = carray(pointer(words[19, 0]), words[19, 1], np.float64)
    triangles = carray(pointer(words[20, 0]), (words[20, 1], words[20, 2]), np.float64)
    return TracedScene(handle, centre, materials, triangles, boxes, np.zeros(2))


# Sheets that a ray crosses in a metre of leaves: an estimate, which only decides how
# far ahead a ray searches at first.
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

    Absorption is specified in dB of the whole echo, out and back. Penetration power
    counts one way only, so a loss that occurs once, at the hit, counts half.
    """
    if ray_class.medium == SONAR:
        return 0.0
    radar = ray_class.medium == RADAR
    if radar and not (ray_class.is_absorbed or material.radar_mirror):
        return 0.0
    decibels = material.absorption_db if radar else material.laser_absorption_db
    if decibels == 0 or math.isinf(decibels):
        return decibels  # also if the power per dB is 0
    return ray_class.power_per_db * decibels / 2


def passing_of(material: Material, ray_class: RayClass) -> float:
    """Return the power that each surface of a pane takes from a ray that passes it."""
    decibels = material.transmission_db
    if decibels is None or ray_class.medium != RADAR:
        return math.inf
    return ray_class.power_per_db * decibels[ray_class.band] / 2


def _glint_cosine(angle: float) -> float:
    return math.cos(angle) if angle > 0 else 2.0


def scattering_of(material: Material, ray_class: RayClass) -> float:
    """Return what a volume or a sheet scatters of a loss, relative to foliage.

    Of light, all clouds and plants are taken to scatter the same share.
    """
    return material.albedo / ALBEDO if ray_class.medium == RADAR else 1.0


def _reflects_sound(material: Material) -> bool:
    return material.solid or math.isinf(material.laser_density)


def centre_of(parts: Sequence[Part]) -> Floats:
    """Return the centre of the bounding box of all parts, (3,) m."""
    low, high = bounds_of(parts)
    return np.asarray((low + high) / 2)


class Volumes(NamedTuple):
    """The penetrable volumes of a scene; attributes as in ``MaterialTable``."""

    volume: NDArray[np.int32]
    low: Floats
    high: Floats


def find_volumes(parts: Sequence[Part], centre: Floats) -> Volumes:
    """Find the volumes that some ray penetrates, with bounds relative to ``centre``.

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
    return Volumes(
        np.array(volumes, np.int32),
        np.vstack([low, low.min(axis=0, initial=np.inf)]),
        np.vstack([high, high.max(axis=0, initial=-np.inf)]),
    )


def material_table(
    parts: Sequence[Part],
    volumes: Volumes,
    ray_classes: Sequence[RayClass],
    air: Material | None,
) -> MaterialTable:
    """Compute the table for some classes of rays.

    Args:
        parts: All parts, the air's last.
        volumes: Those among the parts.
        ray_classes: In the order of their indices.
        air: The material that fills the scene; None for nothing.
    """
    materials = [part.material for part in parts]
    sheet = np.array([material.sheet_loss is not None for material in materials], bool)
    density = _tabulate(parts, ray_classes, attenuation_of, np.float64)
    penetrable = np.isfinite(density)
    sheet_loss = _tabulate(parts, ray_classes, _sheet_loss_of, np.float64)
    passed = _tabulate(parts, ray_classes, _is_passed, bool)
    equivalent = np.where(np.isnan(sheet_loss), density, SHEETS_PER_METRE * sheet_loss)
    return MaterialTable(
        density,
        sheet_loss,
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
        **volumes._asdict(),
    )


def _sheet_loss_of(material: Material, ray_class: RayClass) -> float:
    """Return the loss per crossed sheet; only radar waves lose power there."""
    if material.sheet_loss is None:
        return math.nan
    if ray_class.medium != RADAR:
        return 0.0
    if ray_class.in_decibels and material.sheet_attenuation_db is not None:
        return ray_class.power_per_db * material.sheet_attenuation_db[ray_class.band]
    return material.sheet_loss


def _is_passed(material: Material, ray_class: RayClass) -> bool:
    """Return whether a ray passes a material as if it were not there."""
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
    """Return a value for each class of rays and each part, (C, P)."""
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
