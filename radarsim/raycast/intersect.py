"""Queries to Embree from compiled code: what a ray intersects, what is near a point.

``embree`` explains why Embree only proposes triangles. For each triangle whose box the
ray meets, Embree calls ``on_primitive``, which intersects the triangle itself.

Embree and the callback share one buffer: Embree's structures come first, and the
callback finds the fields after them by the address of the context that it is given.
"""

from collections.abc import Callable
from typing import Final, NamedTuple, TypeAlias

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.base import BaseContext
from numba.core.typing import Signature
from numba.extending import intrinsic
from numba.np.numpy_support import carray
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import (
    Int,
    Pointer,
    c_callback,
    c_predicate,
    njit_cached,
    njit_inline,
)
from radarsim.raycast.crossings import (
    AXES_SIZE,
    LINE_SIZE,
    Crossings,
    cross_triangle,
    project_line,
)

BEHIND: Final = -5e-324  # m, the greatest number below 0

# What a ray does with a part: its role.
IGNORE: Final = 0
COLLECT: Final = 1
OPAQUE: Final = 2
Roles: TypeAlias = NDArray[np.uint8]

# The buffer in words of 4 bytes: Embree's RTCRayHit (128 bytes), RTCIntersectArguments
# (128 bytes) and RTCRayQueryContext (64 bytes), and then the fields of the callback.
T_NEAR_WORD: Final = 3
TIME_WORD: Final = 7
T_FAR_WORD: Final = 8
MASK_WORD: Final = 9
ID_WORD: Final = 10
FLAGS_WORD: Final = 11
PRIMITIVE_WORD: Final = 17
GEOMETRY_WORD: Final = 18
ARGUMENTS_WORD: Final = 32
CONTEXT_WORD: Final = 64
FIELDS_WORD: Final = 80
INVALID: Final = 0xFFFFFFFF  # Embree's number for "none", and its mask of all bits
# The fields in words of 8 bytes: integers, most of them addresses ...
SCENE: Final = 0
TRIANGLES: Final = 1
OWNERS: Final = 2
ROLES: Final = 3
LIST: Final = 4
CAPACITY: Final = 5
COUNT: Final = 6
STOP_PART: Final = 7
ROW: Final = 8
AXES: Final = 9
# ... then reals, and at the end one more integer.
LINE: Final = AXES + AXES_SIZE
NEAR: Final = LINE + LINE_SIZE
FAR: Final = NEAR + 1
WINDOW: Final = NEAR + 2
STOP_T: Final = NEAR + 3
SKIPPED: Final = NEAR + 4
MARGIN: Final = NEAR + 5
STOP_TRIANGLE: Final = NEAR + 6
FIELDS_SIZE: Final = NEAR + 7
BUFFER_SIZE: Final = FIELDS_WORD // 2 + FIELDS_SIZE

CORNERS_BYTES: Final = 72  # of one triangle: nine numbers of 8 bytes
CROSSING_BYTES: Final = 16
ALIGNMENT: Final = 64  # bytes; Embree wants 16, and a cache line has 64


class SceneHandle(NamedTuple):
    """What queries need of an ``EmbreeScene``; valid as long as that exists.

    Attributes:
        intersect: Address of ``rtcIntersect1``.
        point_query: Address of ``rtcPointQuery``.
        on_nearby: Address of ``on_nearby_primitive``.
        scenes: (S + 1, 4) the addresses of Embree's scene, of the corners of its
            triangles, and of the indices of the parts that these belong to; and where
            the triangles begin in ``sliced``. The first row is that of the whole scene,
            the others are those of its slices.
        heights: (S + 1,) m, z of each slice; nan for the whole scene.
        sliced: The indices in the whole scene of all slices' triangles.
        radius: m, of a sphere around the origin that contains everything.
        margin: m by which the boxes are wider than their triangles.
    """

    intersect: np.uint64
    point_query: np.uint64
    on_nearby: np.uint64
    scenes: NDArray[np.uint64]
    heights: Floats
    sliced: NDArray[np.int64]
    radius: float
    margin: float


class Interval(NamedTuple):
    """The part of a line to be searched.

    Attributes:
        near: Start, m.
        far: End, m.
        window: How far behind the first collected surface the search ends at the
            latest, m.
    """

    near: float
    far: float
    window: float


class RayBuffer(NamedTuple):
    """The memory of one query, seen in four ways; each thread needs its own.

    Attributes:
        words: The whole buffer as integers of 4 bytes.
        floats: The whole buffer as reals of 4 bytes.
        fields: The callback's fields as integers of 8 bytes.
        reals: The callback's fields as reals of 8 bytes.
        address: Address of the buffer.
    """

    words: NDArray[np.uint32]
    floats: NDArray[np.float32]
    fields: NDArray[np.uint64]
    reals: Floats
    address: np.uint64


# What follows generates machine code, as numba's ``intrinsic`` asks for: functions get
# the types of their arguments, and return a signature and a function that writes LLVM.
# A call through ctypes would need Python's lock, and numba has no pointers to functions
# that are known only at run time.
_Generator = Callable[[BaseContext, ir.IRBuilder, Signature, list[ir.Value]], ir.Value]


def _cast_to_pointer(
    _typing: BaseContext, _address: types.Type
) -> tuple[Signature, _Generator]:  # pragma: no cover - numba's
    """Reinterpret an integer as an address."""

    def generate(
        _context: BaseContext,
        builder: ir.IRBuilder,
        _signature: Signature,
        args: list[ir.Value],
    ) -> ir.Value:
        return builder.inttoptr(args[0], cgutils.voidptr_t)

    return types.voidptr(types.uintp), generate


def _call_address(
    _typing: BaseContext, _function: types.Type, arguments: types.BaseTuple
) -> tuple[Signature, _Generator]:  # pragma: no cover - numba's
    """Call the C function at an address with other addresses; drop what it returns."""

    def generate(
        context: BaseContext,
        builder: ir.IRBuilder,
        _signature: Signature,
        args: list[ir.Value],
    ) -> ir.Value:
        kind = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t] * len(arguments))
        callee = builder.inttoptr(args[0], kind.as_pointer())
        addresses = cgutils.unpack_tuple(builder, args[1])
        builder.call(
            callee, [builder.inttoptr(a, cgutils.voidptr_t) for a in addresses]
        )
        return context.get_dummy_value()

    addresses = types.UniTuple(types.uintp, len(arguments))
    return types.void(types.uintp, addresses), generate


pointer: Callable[[np.uint64], Pointer] = intrinsic(_cast_to_pointer)
_call: Callable[[np.uint64, tuple[np.uint64, ...]], None] = intrinsic(_call_address)


@c_callback
def on_primitive(call: Pointer) -> None:
    """Intersect a triangle whose box the ray meets; Embree calls this.

    Args:
        call: RTCIntersectFunctionNArguments.
    """
    members = carray(call, 5, np.uint64)  # valid, user data, triangle, context, ray
    triangle = np.uint64(carray(call, 5, np.uint32)[4])
    place = members[3] + np.uint64((FIELDS_WORD - CONTEXT_WORD) * 4)
    fields = carray(pointer(place), FIELDS_SIZE, np.uint64)
    reals = carray(pointer(place), FIELDS_SIZE, np.float64)
    place = fields[TRIANGLES] + triangle * np.uint64(CORNERS_BYTES)
    corners = carray(pointer(place), 9, np.float64)
    sign, t = cross_triangle(reals[LINE:], fields[AXES:], corners)
    # Embree is told nothing of the hit, so that it goes on to all boxes up to T_FAR.
    if sign == 0 or t < reals[NEAR] or t > reals[FAR]:
        return
    place = fields[OWNERS] + triangle * np.uint64(4)
    part = carray(pointer(place), 1, np.uint32)[0]
    role = carray(pointer(fields[ROLES] + np.uint64(part)), 1, np.uint8)[0]
    far = reals[FAR]
    if role == OPAQUE:
        # The order of the calls must not matter: where two opaque surfaces coincide,
        # the part with the lower index is hit, and of its triangles the lower one.
        nearer = t < reals[STOP_T] or part < fields[STOP_PART]
        if nearer or (part == fields[STOP_PART] and triangle < fields[STOP_TRIANGLE]):
            fields[STOP_PART] = part
            fields[STOP_TRIANGLE] = triangle
        reals[STOP_T] = t
        far = t
    elif role == COLLECT:
        # The window begins at the nearest surface, which need not be found first.
        far = min(far, t + reals[WINDOW])
        count = fields[COUNT]
        if count < fields[CAPACITY]:
            place = fields[LIST] + count * np.uint64(CROSSING_BYTES)
            carray(pointer(place), 1, np.float64)[0] = t
            members_of_crossing = carray(pointer(place), 4, np.int32)
            members_of_crossing[2] = part
            members_of_crossing[3] = sign
        # Count also what does not fit: the caller allocates a longer list.
        fields[COUNT] = count + np.uint64(1)
    if far < reals[FAR]:
        reals[FAR] = far
        # Embree skips all boxes beyond this. It counts from the skipped start and in
        # float32; the margin makes up for that.
        ray = carray(pointer(members[4]), T_FAR_WORD + 1, np.float32)
        ray[T_FAR_WORD] = far - reals[SKIPPED] + reals[MARGIN]


@njit_cached
def new_ray_buffer(handle: SceneHandle, crossings: Crossings) -> RayBuffer:
    """Allocate a ``RayBuffer`` for a scene's handle and a list of CROSSING."""
    buffer = _aligned(BUFFER_SIZE)
    words = buffer.view(np.uint32)
    fields = buffer[FIELDS_WORD // 2 :]
    words[ARGUMENTS_WORD + 1] = INVALID  # every feature
    address = np.uint64(buffer.ctypes.data)
    buffer[ARGUMENTS_WORD // 2 + 1] = address + np.uint64(CONTEXT_WORD * 4)
    words[CONTEXT_WORD : CONTEXT_WORD + 4] = INVALID  # no instance
    reals = fields.view(np.float64)
    fields[LIST] = crossings.ctypes.data
    fields[CAPACITY] = crossings.size
    reals[MARGIN] = handle.margin
    ray_buffer = RayBuffer(words, buffer.view(np.float32), fields, reals, address)
    _set_scene(handle, ray_buffer, 0)
    return ray_buffer


@njit_cached
def _aligned(size: int) -> NDArray[np.uint64]:
    """Allocate an aligned array of ``size`` words of 8 bytes."""
    raw = np.zeros(size + ALIGNMENT // 8, np.uint64)
    skipped = (ALIGNMENT - raw.ctypes.data % ALIGNMENT) % ALIGNMENT // 8
    return raw[skipped : skipped + size]


@njit_inline
def _set_scene(handle: SceneHandle, buffer: RayBuffer, row: int) -> None:
    """Let the next queries search one of the scenes of a handle."""
    buffer.fields[SCENE] = handle.scenes[row, 0]
    buffer.fields[TRIANGLES] = handle.scenes[row, 1]
    buffer.fields[OWNERS] = handle.scenes[row, 2]
    buffer.fields[ROW] = row


@njit_inline
def select_scene(
    handle: SceneHandle,
    buffer: RayBuffer,
    origin: Floats,
    direction: Floats,
    unsliced: Floats,
) -> None:
    """Choose the scene of the next queries: a slice if the ray is level and one fits.

    Args:
        handle: The ``SceneHandle``.
        buffer: From ``new_ray_buffer``.
        origin: (3,) m.
        direction: (3,) unit vector.
        unsliced: (2,) the height, m, of the last level ray that found no slice, and
            how many there were; updated.
    """
    row = 0
    if direction[2] == 0.0:
        row = handle.heights.size - 1
        while row > 0 and handle.heights[row] != origin[2]:
            row -= 1
        if row == 0:
            unsliced[0] = origin[2]
            unsliced[1] += 1.0
        elif handle.scenes[row, 0] == handle.scenes[0, 0]:
            row = 0
    _set_scene(handle, buffer, row)


@njit_inline
def opaque_triangle(handle: SceneHandle, buffer: RayBuffer) -> Int:
    """Return the index, in the whole scene, of the last opaque triangle found."""
    fields = buffer.fields
    k = fields[STOP_TRIANGLE]
    if fields[ROW] == 0:
        return np.int64(k)
    triangle: np.int64 = handle.sliced[np.int64(handle.scenes[fields[ROW], 3] + k)]
    return triangle


@njit_inline
def _run_query(
    handle: SceneHandle,
    buffer: RayBuffer,
    origin: Floats,
    direction: Floats,
    orientation: float,
    near: float,
    far: float,
) -> None:
    """Let Embree traverse the scene along the direction or, with -1, against it."""
    words, floats = buffer.words, buffer.floats
    # A start far away would be rounded to float32 too coarsely: skip to the sphere that
    # contains the scene.
    ahead = 0.0
    for axis in range(3):
        ahead -= origin[axis] * direction[axis] * orientation
    skipped = max(ahead - handle.radius, 0.0)
    if skipped > far:
        return
    for axis in range(3):
        floats[axis] = origin[axis] + skipped * orientation * direction[axis]
        floats[axis + 4] = orientation * direction[axis]
    floats[T_NEAR_WORD] = max(near - skipped - handle.margin, 0.0)
    floats[TIME_WORD] = 0.0
    floats[T_FAR_WORD] = far - skipped + handle.margin
    words[MASK_WORD] = INVALID
    words[ID_WORD] = 0
    words[FLAGS_WORD] = 0
    words[PRIMITIVE_WORD] = INVALID
    words[GEOMETRY_WORD] = INVALID
    buffer.reals[SKIPPED] = skipped
    arguments = buffer.address + np.uint64(ARGUMENTS_WORD * 4)
    scene = buffer.fields[SCENE]
    _call(handle.intersect, (scene, buffer.address, arguments))


@njit_inline
def _prepare(
    buffer: RayBuffer,
    roles: Roles,
    origin: Floats,
    direction: Floats,
    interval: Interval,
) -> None:
    """Start an empty list of the surfaces in an interval of a line."""
    fields, reals = buffer.fields, buffer.reals
    fields[ROLES] = roles.ctypes.data
    fields[COUNT] = 0
    # No part has this number, so ``STOP_TRIANGLE`` is not read before it is set.
    fields[STOP_PART] = roles.size
    reals[NEAR], reals[FAR], reals[WINDOW] = interval
    reals[STOP_T] = np.inf
    project_line(origin, direction, reals[LINE:], fields[AXES:])


@njit_inline
def intersect_backward(
    handle: SceneHandle,
    buffer: RayBuffer,
    roles: Roles,
    origin: Floats,
    direction: Floats,
) -> np.int64:
    """Collect the surfaces behind a ray's origin.

    Args:
        handle: The ``SceneHandle``.
        buffer: From ``new_ray_buffer``.
        roles: (P,) uint8, none of them OPAQUE; kept alive by the caller.
        origin: (3,) m.
        direction: (3,) unit vector of the ray.

    Returns:
        The number of surfaces, unsorted and with distances below 0 in the buffer's list
        of crossings; if they do not fit, only the first of them are there.
    """
    _prepare(buffer, roles, origin, direction, Interval(-np.inf, BEHIND, np.inf))
    _run_query(handle, buffer, origin, direction, -1.0, 0.0, np.inf)
    return np.int64(buffer.fields[COUNT])


@njit_inline
def intersect_forward(
    handle: SceneHandle,
    buffer: RayBuffer,
    roles: Roles,
    origin: Floats,
    direction: Floats,
    interval: Interval,
) -> tuple[np.int64, float, np.int64]:
    """Collect the surfaces of an interval up to the first opaque one.

    A surface at the very origin is ahead, and never also in the list of
    ``intersect_backward``.

    Args:
        handle: The ``SceneHandle``.
        buffer: From ``new_ray_buffer``.
        roles: (P,) uint8; kept alive by the caller.
        origin: (3,) m.
        direction: (3,) unit vector.
        interval: An ``Interval``.

    Returns:
        The number of surfaces, unsorted in the buffer's list of crossings; if they do
        not fit, only the first of them are there. The distance up to which the list is
        complete; it can hold some beyond. The opaque part at that distance, or -1.
    """
    _prepare(buffer, roles, origin, direction, interval)
    _run_query(handle, buffer, origin, direction, 1.0, interval.near, interval.far)
    reals = buffer.reals
    # A window that began later may end before the opaque surface.
    stopped = reals[STOP_T] <= reals[FAR]
    part = np.int64(buffer.fields[STOP_PART]) if stopped else np.int64(-1)
    return np.int64(buffer.fields[COUNT]), reals[FAR], part


# The buffer of a point query in words of 4 bytes: RTCPointQuery (32 bytes),
# RTCPointQueryContext, and the fields of the callback: the addresses of owners and
# roles, and the result.
RADIUS_WORD: Final = 4
QUERY_CONTEXT_WORD: Final = 8
QUERY_FIELDS_WORD: Final = 128
QUERY_BUFFER_SIZE: Final = QUERY_FIELDS_WORD // 2 + 3


class QueryBuffer(NamedTuple):
    """The memory of one point query, seen in three ways.

    Attributes:
        words: The whole buffer as integers of 8 bytes.
        query: The whole buffer as reals of 4 bytes, of which the query comes first.
        fields: The callback's fields as integers of 8 bytes.
    """

    words: NDArray[np.uint64]
    query: NDArray[np.float32]
    fields: NDArray[np.uint64]


@c_predicate
def on_nearby_primitive(call: Pointer) -> bool:
    """Check a triangle whose box is within the radius; Embree calls this.

    Args:
        call: RTCPointQueryFunctionArguments.

    Returns:
        Whether the radius was changed.
    """
    members = carray(call, 2, np.uint64)  # query, user data
    triangle = np.uint64(carray(call, 5, np.uint32)[4])
    fields = carray(pointer(members[1]), 3, np.uint64)
    place = fields[0] + triangle * np.uint64(4)
    part = carray(pointer(place), 1, np.uint32)[0]
    if carray(pointer(fields[1] + np.uint64(part)), 1, np.uint8)[0] != OPAQUE:
        return False
    fields[2] = 1
    query = carray(pointer(members[0]), 5, np.float32)
    query[RADIUS_WORD] = 0.0  # one is enough: end the traversal
    return True


@njit_cached
def new_query_buffer() -> QueryBuffer:
    """Allocate a buffer."""
    words = _aligned(QUERY_BUFFER_SIZE)
    return QueryBuffer(words, words.view(np.float32), words[QUERY_FIELDS_WORD // 2 :])


@njit_inline
def is_opaque_nearby(
    handle: SceneHandle,
    roles: Roles,
    point: Floats,
    radius: float,
    buffer: QueryBuffer,
) -> bool:
    """Return whether something opaque may be within a radius around a point.

    The boxes around triangles count instead of the triangles: False is certain, and
    after True everything may be a little farther away.

    Args:
        handle: The ``SceneHandle``.
        roles: (P,) uint8.
        point: (3,) m, relative to the scene's centre.
        radius: m.
        buffer: From ``new_query_buffer``.
    """
    query, fields = buffer.query, buffer.fields
    for axis in range(3):
        query[axis] = point[axis]
    query[RADIUS_WORD] = radius
    fields[0], fields[1] = handle.scenes[0, 2], np.uint64(roles.ctypes.data)
    fields[2] = 0
    address = np.uint64(buffer.words.ctypes.data)
    context = address + np.uint64(4 * QUERY_CONTEXT_WORD)
    user_data = address + np.uint64(4 * QUERY_FIELDS_WORD)
    addresses = handle.scenes[0, 0], address, context, handle.on_nearby, user_data
    _call(handle.point_query, addresses)
    return bool(fields[2] == np.uint64(1))
