"""A scene as kernels take it: some twenty arrays, packed into one.

Many arrays in one argument of a kernel.

Numba takes about 0.2 us to unpack each array among the arguments of a call, and a scan
of a hundred rays takes 20 us. So arrays that stay the same are passed in one: ``pack``
writes their addresses and shapes into it, from which a function made by ``unpacker``
makes them again, within the kernel.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np import arrayobj
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached
from radarsim.raycast.intersect import SceneHandle

# compiled into kernels
WORDS: Final = 4  # for each leaf: its address, and its lengths in three dimensions


class PackedArrays(NamedTuple):
    """Arrays in one array, which is valid as long as this object exists.

    Attributes:
        words: For each leaf its address, and its lengths in three dimensions.
        leaves: All arrays, and numbers as arrays.
    """

    words: NDArray[np.uint64]
    leaves: list[NDArray[Any]]


def pack(given: Sequence[Any], kinds: Sequence[Any]) -> PackedArrays:
    """Pack arrays and numbers.

    Args:
        given: Arrays of at most three dimensions, and numbers.
        kinds: For each its type and the number of its dimensions, 0 for a number.
    """
    leaves = [
        np.ascontiguousarray(leaf, str(kind))
        for leaf, (kind, _) in zip(given, kinds, strict=True)
    ]
    words = np.zeros((len(leaves), WORDS), np.uint64)
    for row, leaf in zip(words, leaves, strict=True):
        row[0] = leaf.ctypes.data
        row[1 : 1 + leaf.ndim] = leaf.shape
    return PackedArrays(words.ravel(), leaves)


def unpacker(kinds: Sequence[Any]) -> Any:
    """Return a function for kernels: it makes a tuple of the leaves from their words.

    Args:
        kinds: As for ``pack``.
    """
    leaf_types = [types.Array(kind, n, "C") if n else kind for kind, n in kinds]

    def leaves_of(_typing: Any, _words: Any) -> Any:  # pragma: no cover - numba's
        """Make the leaves that the words describe."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            words = context.make_array(signature.args[0])(context, builder, args[0])
            place = partial(cgutils.gep_inbounds, builder, words.data)
            leaves = []
            for i, kind in enumerate(leaf_types):
                numbers = [builder.load(place(WORDS * i + k)) for k in range(WORDS)]
                leaves.append(_make_leaf(context, builder, kind, numbers))
            return context.make_tuple(builder, signature.return_type, leaves)

        of_leaves: Any = types.Tuple
        return of_leaves(leaf_types)(types.Array(types.uint64, 1, "C")), generate

    return intrinsic(leaves_of)


def _make_leaf(
    context: Any, builder: Any, kind: Any, numbers: Any
) -> Any:  # pragma: no cover - numba's
    """Read a number, or describe an array that is not counted, at an address."""
    item = kind.dtype if isinstance(kind, types.Array) else kind
    data = context.get_data_type(item).as_pointer()
    address = builder.inttoptr(numbers[0], data)
    if item is kind:
        return builder.load(address)
    size = context.get_abi_sizeof(context.get_data_type(item))
    shape, width = numbers[1 : 1 + kind.ndim], context.get_constant(types.intp, size)
    strides = [width]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(length, strides[0]))
    array = context.make_array(kind)(context, builder)
    _populate(array, address, shape, strides, width, None)
    return array._getvalue()


_populate: Any = arrayobj.populate_array


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
    forward_roles: NDArray[np.uint8]
    backward_roles: NDArray[np.uint8]
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

    handle: Any
    centre: Floats
    materials: MaterialTable
    triangles: Floats
    boxes: Floats
    unsliced: Floats


class PackedScene(NamedTuple):
    """A scene in one array.

    Attributes:
        words: The array, valid as long as this object exists.
        arrays: What it describes.
        handle: The ``SceneHandle``.
    """

    words: NDArray[np.uint64]
    arrays: PackedArrays
    handle: SceneHandle


# The leaves of a packed scene: their types, and the numbers of their dimensions.
HANDLE: Final = (
    *((types.uint64, 0), (types.uint64, 0), (types.uint64, 0)),
    *((types.uint64, 2), (types.float64, 1), (types.int64, 1)),
    *((types.float64, 0), (types.float64, 0)),
)
MATERIALS: Final = (
    *((types.float64, 2), (types.float64, 2), (types.float64, 2), (types.uint8, 2)),
    *((types.float64, 2), (types.float64, 1), (types.int64, 1)),
    *((types.float64, 1), (types.float64, 1)),
    *((types.uint8, 2), (types.uint8, 2)),
    *((types.int32, 1), (types.float64, 2), (types.float64, 2)),
)
LEAVES: Final = (*HANDLE, *MATERIALS, (types.float64, 1), (types.float64, 2))


def pack_scene(
    handle: SceneHandle, centre: Floats, materials: MaterialTable, triangles: Floats
) -> PackedScene:
    """Pack a scene; arguments as the attributes of ``TracedScene``."""
    arrays = pack((*handle, *materials, centre, triangles), LEAVES)
    return PackedScene(arrays.words, arrays, handle)


_leaves_of: Any = unpacker(LEAVES)


@njit_cached
def unpack_scene(words: Any, boxes: Any) -> Any:
    """Return the ``TracedScene`` of a ``PackedScene``'s words."""
    leaves = _leaves_of(words)
    handle, materials = SceneHandle(*leaves[:8]), MaterialTable(*leaves[8:22])
    return TracedScene(handle, leaves[22], materials, leaves[23], boxes, np.zeros(2))
