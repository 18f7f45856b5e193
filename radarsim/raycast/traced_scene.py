"""A scene as kernels take it: some twenty arrays, passed as the addresses of all.

numba takes 0.1 to 0.2 us to unpack each array among the arguments of a call, and a scan
of ten beams takes 12 us in all (row d of ``radarsim bench``; row j has many short
scans). So what stays the same from call to call is passed in one array: ``pack`` writes
addresses and shapes into it, from which the kernel makes the arrays again.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numba.np.numpy_support import carray
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached
from radarsim.raycast.intersect import Roles, SceneHandle, pointer

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
