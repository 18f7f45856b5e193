"""Is anything opaque near a point? One query to Embree, for which no ray is cast.

The answer is careful: the boxes around triangles count, not the triangles, so that
"nothing" is certain and "something" may be a little way off.
"""

import ctypes
from typing import Any, Final

import numpy as np
from numba.np.numpy_support import carray
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.raycast.compiled import predicate
from radarsim.raycast.library import open_library
from radarsim.raycast.query import OPAQUE, pointer

# One block of memory: Embree's query (32 bytes), its context, and the three numbers
# that the callback is told: addresses of owners and roles, and whether it found one.
CONTEXT_WORD: Final = 8
OURS_WORD: Final = 128
BLOCK_WORDS: Final = OURS_WORD + 6
RADIUS_WORD: Final = 4


@predicate
def _meet(call: Any) -> Any:
    """Embree says: the box of triangle i is within the radius."""
    fields = carray(call, 2, np.uint64)  # query, user data
    triangle = np.uint64(carray(call, 5, np.uint32)[4])
    ours = carray(pointer(fields[1]), 3, np.uint64)
    place = ours[0] + triangle * np.uint64(4)
    part = carray(pointer(place), 1, np.uint32)[0]
    if carray(pointer(ours[1] + np.uint64(part)), 1, np.uint8)[0] != OPAQUE:
        return False
    ours[2] = 1
    query = carray(pointer(fields[0]), 5, np.float32)
    query[RADIUS_WORD] = 0.0  # one is enough
    return True


def is_anything_opaque(
    numbers: NDArray[np.uint64], roles: NDArray[np.uint8], point: Floats, radius: float
) -> bool:
    """Say whether something opaque may be within a radius around a point.

    Args:
        numbers: Of the ``Handle`` of a scene.
        roles: (P,) uint8, how each part is taken.
        point: (3,) m.
        radius: m.
    """
    raw = np.zeros(BLOCK_WORDS + 16, np.uint32)
    skipped = -raw.ctypes.data % 64 // 4  # Embree wants 16
    block = raw[skipped : skipped + BLOCK_WORDS]
    query, ours = block.view(np.float32), block[OURS_WORD:].view(np.uint64)
    query[:3] = point
    query[RADIUS_WORD] = radius
    ours[:2] = numbers[3], roles.ctypes.data
    address = block.ctypes.data
    open_library().rtcPointQuery(
        int(numbers[1]),
        address,
        address + CONTEXT_WORD * 4,
        ctypes.c_void_p(_meet.address),
        address + OURS_WORD * 4,
    )
    return bool(ours[2])
