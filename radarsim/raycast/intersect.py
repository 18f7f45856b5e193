"""One question to Embree: a ray's memory, what is asked, what is called back.

See ``embree`` for why it is asked in this way.
"""

from typing import Any, Final, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic
from numba.np.numpy_support import carray
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import c_callback, c_predicate, njit_cached, njit_inline
from radarsim.raycast.crossings import AXES_SIZE, LINE_SIZE, aim, cross

BEHIND: Final = -5e-324  # m, the greatest number below 0

# How a ray takes a part.
PASSED_BY: Final = 0
LISTED: Final = 1
OPAQUE: Final = 2

# One block of memory serves a call: Embree's ray with its hit (128 bytes), arguments
# (128) and context (64), and then ours. Places in it, counted in words of 4 bytes ...
REACH_WORD: Final = 8
ARGUMENTS_WORD: Final = 32
CONTEXT_WORD: Final = 64
OURS_WORD: Final = 80
# ... and in ours, in words of 8: first integers, addresses mostly; then reals.
TRIANGLES: Final = 0
OWNERS: Final = 1
ROLES: Final = 2
LIST: Final = 3
ROOM: Final = 4
COUNT: Final = 5
STOPPED_BY: Final = 6
AXES: Final = 7
LINE: Final = AXES + AXES_SIZE
NEAR: Final = LINE + LINE_SIZE
FAR: Final = NEAR + 1
WINDOW: Final = NEAR + 2
STOPPED_AT: Final = NEAR + 3
SKIPPED: Final = NEAR + 4
MARGIN: Final = NEAR + 5
STOPPED_BY_FACE: Final = NEAR + 6  # an integer again
OURS_SIZE: Final = NEAR + 7
BLOCK_SIZE: Final = OURS_WORD // 2 + OURS_SIZE


def _take_pointer(_typing: Any, _address: Any) -> Any:  # pragma: no cover - numba's
    """Take an integer for the address that it is."""

    def generate(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], cgutils.voidptr_t)

    return types.voidptr(types.uintp), generate


def _generate_call(
    _typing: Any, _function: Any, _scene: Any, _ray: Any, _arguments: Any
) -> Any:  # pragma: no cover - numba's
    """Call ``rtcIntersect1`` at an address: no Python, no lock."""

    def generate(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t] * 3)
        callee = builder.inttoptr(args[0], kind.as_pointer())
        pointers = [builder.inttoptr(arg, cgutils.voidptr_t) for arg in args[1:]]
        builder.call(callee, pointers)
        return context.get_dummy_value()

    return types.void(*[types.uintp] * 4), generate


pointer: Any = intrinsic(_take_pointer)
_call_intersect: Any = intrinsic(_generate_call)


@c_callback
def meet(call: Any) -> None:
    """Embree says: the ray meets the box of triangle i."""
    fields = carray(call, 5, np.uint64)  # valid, user data, i, context, ray
    triangle = np.uint64(carray(call, 5, np.uint32)[4])
    place = fields[3] + np.uint64((OURS_WORD - CONTEXT_WORD) * 4)
    ours = carray(pointer(place), OURS_SIZE, np.uint64)
    reals = carray(pointer(place), OURS_SIZE, np.float64)
    place = ours[TRIANGLES] + triangle * np.uint64(72)
    corners = carray(pointer(place), 9, np.float64)
    turn, t = cross(reals[LINE:], ours[AXES:], corners)
    if turn == 0 or t < reals[NEAR] or t > reals[FAR]:
        return
    place = ours[OWNERS] + triangle * np.uint64(4)
    part = carray(pointer(place), 1, np.uint32)[0]
    role = carray(pointer(ours[ROLES] + np.uint64(part)), 1, np.uint8)[0]
    far = reals[FAR]
    if role == OPAQUE:
        # Where two opaque surfaces coincide, the part with the lower number is hit, and
        # of two triangles of a part that with the lower number.
        nearer = t < reals[STOPPED_AT] or part < ours[STOPPED_BY]
        if nearer or (part == ours[STOPPED_BY] and triangle < ours[STOPPED_BY_FACE]):
            ours[STOPPED_BY] = part
            ours[STOPPED_BY_FACE] = triangle
        reals[STOPPED_AT] = t
        far = t
    elif role == LISTED:
        far = min(far, t + reals[WINDOW])
        count = ours[COUNT]
        if count < ours[ROOM]:
            place = ours[LIST] + count * np.uint64(16)
            carray(pointer(place), 1, np.float64)[0] = t
            names = carray(pointer(place), 4, np.int32)
            names[2] = part
            names[3] = turn
        ours[COUNT] = count + np.uint64(1)
    if far < reals[FAR]:
        reals[FAR] = far
        ray = carray(pointer(fields[4]), 9, np.float32)
        ray[REACH_WORD] = far - reals[SKIPPED] + reals[MARGIN]


class Span(NamedTuple):
    """How much of a line is looked at.

    Attributes:
        near: Where that begins, m.
        far: Where it ends, m.
        window: How far behind the first listed surface it ends at the latest, m. What
            a ray cannot reach need not be listed.
    """

    near: float
    far: float
    window: float


class Block(NamedTuple):
    """The memory that ``intersect`` works in, seen in four ways; one for each thread.

    Attributes:
        words: 4 byte integers, all of it.
        floats: 4 byte reals, all of it.
        ours: 8 byte integers, behind what Embree knows.
        reals: 8 byte reals, the same place.
        address: Where it is.
    """

    words: NDArray[np.uint32]
    floats: NDArray[np.float32]
    ours: NDArray[np.uint64]
    reals: Floats
    address: np.uint64


@njit_cached
def new_block(handle: Any, crossings: Any) -> Any:
    """Lay out the memory for a scene's ``handle`` and a list of CROSSING."""
    raw = np.zeros(BLOCK_SIZE + 8, np.uint64)
    skipped = (64 - raw.ctypes.data % 64) % 64 // 8  # Embree wants 16
    block = raw[skipped : skipped + BLOCK_SIZE]
    words = block.view(np.uint32)
    ours = block[OURS_WORD // 2 :]
    words[ARGUMENTS_WORD + 1] = 0xFFFFFFFF  # every feature
    address = np.uint64(block.ctypes.data)
    block[ARGUMENTS_WORD // 2 + 1] = address + np.uint64(CONTEXT_WORD * 4)
    words[CONTEXT_WORD : CONTEXT_WORD + 4] = 0xFFFFFFFF  # no instance
    reals = ours.view(np.float64)
    ours[TRIANGLES] = handle.numbers[2]
    ours[OWNERS] = handle.numbers[3]
    ours[LIST] = crossings.ctypes.data
    ours[ROOM] = crossings.size
    reals[MARGIN] = handle.margin
    return Block(words, block.view(np.float32), ours, reals, address)


@njit_inline
def _cast(
    handle: Any, block: Any, origin: Any, way: Any, direction: Any, span: Any
) -> None:
    """Let Embree look along a line, forward or back, from the scene's sphere on."""
    words, floats = block.words, block.floats
    near, max_range = span
    ahead = 0.0
    for axis in range(3):
        ahead -= origin[axis] * direction[axis] * way
    skipped = max(ahead - handle.radius, 0.0)
    if skipped > max_range:
        return
    for axis in range(3):
        floats[axis] = origin[axis] + skipped * way * direction[axis]
        floats[axis + 4] = way * direction[axis]
    floats[3] = max(near - skipped - handle.margin, 0.0)
    floats[7] = 0.0  # no time
    floats[REACH_WORD] = max_range - skipped + handle.margin
    words[9] = 0xFFFFFFFF  # all geometries
    words[10] = 0
    words[11] = 0
    words[17] = 0xFFFFFFFF  # nothing hit
    words[18] = 0xFFFFFFFF
    block.reals[SKIPPED] = skipped
    numbers = handle.numbers
    arguments = block.address + np.uint64(ARGUMENTS_WORD * 4)
    _call_intersect(numbers[0], numbers[1], block.address, arguments)


@njit_inline
def _look(block: Any, roles: Any, near: Any, far: Any, window: Any) -> None:
    """Begin a list of what is from ``near`` to ``far`` on the line."""
    ours, reals = block.ours, block.reals
    ours[ROLES] = roles.ctypes.data
    ours[COUNT] = 0
    ours[STOPPED_BY] = roles.size
    reals[NEAR], reals[FAR], reals[WINDOW] = near, far, window
    reals[STOPPED_AT] = np.inf


@njit_inline
def look_back(handle: Any, block: Any, roles: Any, origin: Any, direction: Any) -> Any:
    """List what is behind a ray, and hold its line for ``look_ahead``.

    Args:
        handle: Of the scene.
        block: From ``new_block``.
        roles: (P,) uint8, how each part is taken, none of them OPAQUE; kept alive by
            the caller.
        origin: (3,) m.
        direction: (3,) unit vector of the ray.

    Returns:
        How many surfaces there are on the list, in no order, with distances below 0;
        if more than fit, only the first are there.
    """
    _look(block, roles, -np.inf, BEHIND, np.inf)
    aim(origin, direction, block.reals[LINE:], block.ours[AXES:])
    _cast(handle, block, origin, -1.0, direction, (0.0, np.inf))
    return np.int64(block.ours[COUNT])


@njit_inline
def look_ahead(
    handle: Any, block: Any, roles: Any, origin: Any, direction: Any, span: Any
) -> Any:
    """List what a ray meets in a span, up to its first opaque surface.

    What is at its very start is ahead: no surface is on this list and on that of
    ``look_back``, or on none.

    Args:
        handle: Of the scene.
        block: From ``new_block``.
        roles: (P,) uint8, how each part is taken; kept alive by the caller.
        origin: (3,) m.
        direction: (3,) unit vector.
        span: A ``Span``.

    Returns:
        How many surfaces there are on the list, in no order, some of them farther away
        than all is known to; if more than fit, only the first are there. Then how far
        all is known, and the part of the opaque surface there, -1 if there is none.
    """
    near, far, window = span
    _look(block, roles, near, far, window)
    aim(origin, direction, block.reals[LINE:], block.ours[AXES:])
    _cast(handle, block, origin, 1.0, direction, (near, far))
    reals = block.reals
    stopped = reals[STOPPED_AT] <= reals[FAR]
    part = np.int64(block.ours[STOPPED_BY]) if stopped else np.int64(-1)
    return np.int64(block.ours[COUNT]), reals[FAR], part


# Section from raycast.nearby.
# Is anything opaque near a point? One query to Embree, for which no ray is cast.
#
# The answer is careful: the boxes around triangles count, not the triangles, so that
# "nothing" is certain and "something" may be a little way off.

# One block of memory: Embree's query (32 bytes), its context, and the three numbers
# that the callback is told: addresses of owners and roles, and whether it found one.
QUERY_CONTEXT_WORD: Final = 8
QUERY_OURS_WORD: Final = 128
BLOCK_WORDS: Final = QUERY_OURS_WORD + 6
RADIUS_WORD: Final = 4


def _generate_nearby_call(
    _typing: Any, _function: Any, _scene: Any, _block: Any, _asked: Any
) -> Any:  # pragma: no cover - numba's
    """Call ``rtcPointQuery`` at an address, and let it call another."""

    def generate(context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(ir.IntType(8), [cgutils.voidptr_t] * 5)
        callee = builder.inttoptr(args[0], kind.as_pointer())
        word = ir.Constant(args[2].type, 4)
        places = [
            builder.add(args[2], builder.mul(word, ir.Constant(args[2].type, offset)))
            for offset in (0, QUERY_CONTEXT_WORD, QUERY_OURS_WORD)
        ]
        order = [args[1], places[0], places[1], args[3], places[2]]
        builder.call(callee, [builder.inttoptr(a, cgutils.voidptr_t) for a in order])
        return context.get_dummy_value()

    return types.void(*[types.uintp] * 4), generate


_call_point_query: Any = intrinsic(_generate_nearby_call)


@c_predicate
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


@njit_cached
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
    query, ours = block.view(np.float32), block[QUERY_OURS_WORD // 2 :]
    for axis in range(3):
        query[axis] = point[axis]
    query[RADIUS_WORD] = radius
    ours[0], ours[1] = numbers[3], np.uint64(roles.ctypes.data)
    _call_point_query(asked[0], numbers[1], np.uint64(block.ctypes.data), asked[1])
    return ours[2] == np.uint64(1)
