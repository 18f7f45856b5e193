"""Many arrays in one argument of a kernel.

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
