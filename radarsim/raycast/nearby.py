"""Is anything opaque near a point? One query to Embree, for which no ray is cast.

The answer is careful: the boxes around triangles count, not the triangles, so that
"nothing" is certain and "something" may be a little way off.
"""

from typing import Any, Final

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.numpy_support import carray

from radarsim.compiled import compiled, predicate
from radarsim.raycast.query import OPAQUE, pointer

# One block of memory: Embree's query (32 bytes), its context, and the three numbers
# that the callback is told: addresses of owners and roles, and whether it found one.
CONTEXT_WORD: Final = 8
OURS_WORD: Final = 128
BLOCK_WORDS: Final = OURS_WORD + 6
RADIUS_WORD: Final = 4


def _generate_call(
    _typing: Any, _function: Any, _scene: Any, _block: Any, _asked: Any
) -> Any:  # pragma: no cover - numba's
    """Call ``rtcPointQuery`` at an address, and let it call another."""

    def generate(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(ir.IntType(8), [cgutils.voidptr_t] * 5)
        callee = builder.inttoptr(args[0], kind.as_pointer())
        word = ir.Constant(args[2].type, 4)
        places = [
            builder.add(args[2], builder.mul(word, ir.Constant(args[2].type, offset)))
            for offset in (0, CONTEXT_WORD, OURS_WORD)
        ]
        order = [args[1], places[0], places[1], args[3], places[2]]
        builder.call(callee, [builder.inttoptr(a, cgutils.voidptr_t) for a in order])
        return context.get_dummy_value()

    return types.void(*[types.uintp] * 4), generate


_call_point_query: Any = intrinsic(_generate_call)


@predicate
def meet_nearby(call: Any) -> Any:
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


@compiled
def is_anything_opaque(
    numbers: Any, asked: Any, roles: Any, point: Any, radius: Any
) -> Any:
    """Say whether something opaque may be within a radius around a point.

    Args:
        numbers: Of the ``Handle`` of a scene.
        asked: (2,) uint64, the addresses of ``rtcPointQuery`` and ``meet_nearby``.
        roles: (P,) uint8, how each part is taken.
        point: (3,) m, counted from the scene's middle.
        radius: m.
    """
    raw = np.zeros(BLOCK_WORDS // 2 + 8, np.uint64)
    skipped = (64 - raw.ctypes.data % 64) % 64 // 8  # Embree wants 16
    block = raw[skipped : skipped + BLOCK_WORDS // 2]
    query, ours = block.view(np.float32), block[OURS_WORD // 2 :]
    for axis in range(3):
        query[axis] = point[axis]
    query[RADIUS_WORD] = radius
    ours[0], ours[1] = numbers[3], np.uint64(roles.ctypes.data)
    _call_point_query(asked[0], numbers[1], np.uint64(block.ctypes.data), asked[1])
    return ours[2] == np.uint64(1)
