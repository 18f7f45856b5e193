"""The one door to Embree: a sealed set of meshes, and every hit along a ray.

Theory of operation
===================
embreex brings Embree 4's own shared library in its wheel; ctypes opens that file and
builds the scene. Rays go from compiled code straight to ``rtcIntersect1``, with no
Python between two rays.

A penetrable surface is not a reason to stop: its geometry carries an intersection
filter, which writes the hit down and rejects it, so one traversal, from one origin,
lists *all* penetrable surfaces up to the first opaque one. No ray is ever restarted
behind a hit. Restarts with a shifted origin lose thin exits, restarts at the next
float lose surfaces that coincide; a list loses neither.

Rule 1: a scene is sealed when it is made. Embree would ignore what is added later.
Rule 2: what goes in is checked: shapes, finite vertices, indices in range. Embree
reads past arrays and drops whole meshes in silence.
Rule 3: Embree computes in float32. Its distances choose and order nothing in the end;
callers refine them with the float64 planes of the triangles.
"""

import ctypes
import functools
import importlib.metadata
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from llvmlite import ir
from numba import carray, cfunc, njit, types
from numba.core import cgutils
from numba.extending import intrinsic
from numpy.typing import ArrayLike, NDArray

from radarsim.errors import EngineError

GEOMETRY_TRIANGLES: Final = 0
BUFFER_INDEX: Final = 0
BUFFER_VERTEX: Final = 1
FORMAT_UINT3: Final = 0x5003
FORMAT_FLOAT3: Final = 0x9003
SCENE_ROBUST: Final = 1 << 2  # edges are watertight: no ray slips between two triangles
PROPERTY_VERSION: Final = 0
PROPERTY_FILTERS: Final = 34

# One block of memory serves a call: the ray with its hit, the arguments, the context.
# Embree sees the first 64 bytes of the context; ours follow them.
# RTCRayHit comes first: 12 words for the ray, 8 or 9 for the hit, 4 bytes each.
RAY_END: Final = 8  # the ray's reach goes in, the distance of an opaque hit comes out
ARGUMENTS_WORD: Final = 32  # RTCIntersectArguments: 2 words, then pointers
CONTEXT_WORD: Final = 64
LIST_QUAD: Final = 40  # in 8 byte words: where hits go, how many fit, how many came
BLOCK_BYTES: Final = 512

HIT: Final = np.dtype([("t", "f4"), ("geometry", "u4"), ("triangle", "u4")])


@intrinsic  # type: ignore[untyped-decorator]
def _pointer(typingctx: Any, address: Any) -> Any:
    """Take an integer for the address that it is."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], cgutils.voidptr_t)

    return types.voidptr(types.intp), generate


@intrinsic  # type: ignore[untyped-decorator]
def _call_intersect(
    typingctx: Any, function: Any, scene: Any, ray: Any, arguments: Any
) -> Any:
    """Call ``rtcIntersect1`` at an address: no Python, no lock."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = ir.FunctionType(ir.VoidType(), [cgutils.voidptr_t] * 3)
        callee = builder.inttoptr(args[0], kind.as_pointer())
        pointers = [builder.inttoptr(arg, cgutils.voidptr_t) for arg in args[1:]]
        builder.call(callee, pointers)
        return context.get_dummy_value()

    return types.void(*[types.intp] * 4), generate


@cfunc(types.void(types.voidptr), cache=True)  # type: ignore[untyped-decorator]
def _write_hit_down(call: Any) -> None:
    """Embree asks: does this hit count? Opaque ones do, the others go on the list."""
    fields = carray(call, 5, np.int64)  # valid, user data, context, ray, hit
    ours = carray(_pointer(fields[2]), 12, np.int64)
    hit = carray(_pointer(fields[4]), 7, np.uint32)
    opaque = carray(_pointer(ours[11]), int(hit[6]) + 1, np.uint8)
    if opaque[hit[6]]:
        return
    count = ours[10]
    if count < ours[9]:
        place = ours[8] + count * 12
        distance = carray(_pointer(place), 1, np.float32)
        distance[0] = carray(_pointer(fields[3]), 9, np.float32)[8]
        names = carray(_pointer(place), 3, np.uint32)
        names[1] = hit[6]
        names[2] = hit[5]
    ours[10] = count + 1
    carray(_pointer(fields[0]), 1, np.int32)[0] = 0


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def new_block(opaque: Any, hits: Any) -> Any:
    """Lay out the memory that ``intersect`` works in; one per thread and call.

    Args:
        opaque: (G,) uint8, 1 where a geometry stops the ray.
        hits: (H,) HIT, where the hits on all others are listed.
    """
    block = np.zeros(BLOCK_BYTES // 8 + 8, np.int64)
    block = block[(64 - block.ctypes.data % 64) % 64 // 8 :]  # Embree wants 16
    words = block.view(np.uint32)
    words[ARGUMENTS_WORD + 1] = 0xFFFFFFFF  # every feature
    block[ARGUMENTS_WORD // 2 + 1] = block.ctypes.data + CONTEXT_WORD * 4
    words[CONTEXT_WORD : CONTEXT_WORD + 4] = 0xFFFFFFFF  # no instance
    block[LIST_QUAD] = hits.ctypes.data
    block[LIST_QUAD + 1] = hits.size
    block[LIST_QUAD + 3] = opaque.ctypes.data
    return block


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator]
def intersect(handle: Any, block: Any, origin: Any, direction: Any, reach: Any) -> Any:
    """Cast one ray and list what it meets.

    Args:
        handle: ``EmbreeScene.handle``.
        block: From ``new_block``.
        origin: (3,) m.
        direction: (3,) unit vector.
        reach: How far the ray goes, m.

    Returns:
        How many hits on penetrable surfaces there are, in no order, some of them
        behind the opaque hit, and if more than fit, only the first are written; the
        geometry and the triangle of the first opaque hit, -1 and -1 without one.
    """
    words = block.view(np.uint32)
    floats = block.view(np.float32)
    for axis in range(3):
        floats[axis] = origin[axis]
        floats[4 + axis] = direction[axis]
    floats[3] = 0.0
    floats[7] = 0.0
    floats[RAY_END] = reach
    words[9] = 0xFFFFFFFF
    words[10] = 0
    words[11] = 0
    words[18] = 0xFFFFFFFF
    words[19] = 0xFFFFFFFF
    block[LIST_QUAD + 2] = 0
    address = block.ctypes.data
    _call_intersect(handle[0], handle[1], address, address + ARGUMENTS_WORD * 4)
    if words[18] == 0xFFFFFFFF:
        return block[LIST_QUAD + 2], np.int64(-1), np.int64(-1)
    geometry, triangle = words[18], words[17]
    return block[LIST_QUAD + 2], np.int64(geometry), np.int64(triangle)


class Mesh(NamedTuple):
    """One geometry of a scene.

    Attributes:
        vertices: (V, 3) m.
        faces: (F, 3) indices of vertices.
        listed: Whether some rays pass through it, so that its hits are listed.
    """

    vertices: ArrayLike
    faces: ArrayLike
    listed: bool


class EmbreeScene:
    """A sealed set of triangle meshes.

    Attributes:
        handle: (2,) int64, what ``intersect`` needs: the address of Embree's function
            and of the scene. Valid while this object lives.
    """

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        """Check, copy and build.

        Raises:
            EngineError: If Embree cannot be opened, or a mesh is not what it has to be.
        """
        library = open_library()
        checked = [_checked(index, mesh) for index, mesh in enumerate(meshes)]
        device = library.rtcNewDevice(None)
        if not device:
            raise EngineError("Embree made no device, expected one with its defaults")
        scene = library.rtcNewScene(device)
        self._close = weakref.finalize(self, _release, library, scene, device)
        library.rtcSetSceneFlags(scene, SCENE_ROBUST)
        self._shared = [arrays[:2] for arrays in checked]  # Embree reads these in place
        for vertices, faces, listed in checked:
            _attach(library, device, scene, vertices, faces, listed)
        library.rtcCommitScene(scene)
        error = library.rtcGetDeviceError(device)
        if error:
            raise EngineError(
                f"Embree error {error} while building {len(meshes)} meshes"
            )
        function = ctypes.cast(library.rtcIntersect1, ctypes.c_void_p).value
        self.handle: NDArray[np.int64] = np.array([function, scene], np.int64)


def _checked(
    index: int, mesh: Mesh
) -> tuple[NDArray[np.float32], NDArray[np.uint32], bool]:
    """Give the arrays as Embree shares them, the vertices padded by 16 bytes."""
    vertices = np.asarray(mesh.vertices, np.float64)
    faces = np.asarray(mesh.faces)
    for name, array in (("vertices", vertices), ("faces", faces)):
        if array.ndim != 2 or array.shape[1] != 3:
            raise EngineError(
                f"{name} of shape {array.shape}, expected (n, 3), in mesh {index}"
            )
    if faces.dtype.kind not in "iu":
        raise EngineError(f"faces of {faces.dtype}, expected integers, in mesh {index}")
    if not np.isfinite(vertices).all():
        row = int(np.flatnonzero(~np.isfinite(vertices).all(axis=1))[0])
        raise EngineError(
            f"vertex {row} is {vertices[row].tolist()}, expected finite numbers,"
            f" in mesh {index}"
        )
    if faces.size and (faces.min() < 0 or faces.max() >= len(vertices)):
        raise EngineError(
            f"face indices {faces.min()} to {faces.max()}, expected 0 to"
            f" {len(vertices) - 1}, in mesh {index}"
        )
    padded = np.zeros(vertices.size + 4, np.float32)
    padded[: vertices.size] = vertices.ravel()
    return padded, np.array(faces, np.uint32, order="C"), mesh.listed


def _attach(
    library: Any,
    device: int,
    scene: int,
    vertices: NDArray[np.float32],
    faces: NDArray[np.uint32],
    listed: bool,
) -> None:
    geometry = library.rtcNewGeometry(device, GEOMETRY_TRIANGLES)
    share = library.rtcSetSharedGeometryBuffer
    count = (vertices.size - 4) // 3
    at = vertices.ctypes.data
    share(geometry, BUFFER_VERTEX, 0, FORMAT_FLOAT3, at, 0, 12, count)
    share(geometry, BUFFER_INDEX, 0, FORMAT_UINT3, faces.ctypes.data, 0, 12, len(faces))
    if listed:
        library.rtcSetGeometryIntersectFilterFunction(geometry, _write_hit_down.address)
    library.rtcCommitGeometry(geometry)
    library.rtcAttachGeometry(scene, geometry)
    library.rtcReleaseGeometry(geometry)


def _release(library: Any, scene: int, device: int) -> None:
    library.rtcReleaseScene(scene)
    library.rtcReleaseDevice(device)


@functools.cache
def open_library() -> ctypes.CDLL:
    """Open the Embree 4 that embreex brings, and make sure that it is what we expect.

    Raises:
        EngineError: If there is none, or one of another version or build.
    """
    files = importlib.metadata.files("embreex") or []
    paths = [Path(str(file.locate())) for file in files if "embree4" in file.name]
    if len(paths) != 1:
        names = [path.name for path in paths]
        raise EngineError(f"{names!r} in embreex, expected one library of Embree 4")
    try:
        library = ctypes.CDLL(str(paths[0]))
    except OSError as error:
        raise EngineError(f"cannot open {paths[0]}: {error}") from error
    _declare(library)
    device = library.rtcNewDevice(None)
    version = library.rtcGetDeviceProperty(device, PROPERTY_VERSION)
    filters = library.rtcGetDeviceProperty(device, PROPERTY_FILTERS)
    library.rtcReleaseDevice(device)
    if version // 10000 != 4 or not filters:
        raise EngineError(
            f"Embree {version} with filters {bool(filters)},"
            " expected 4xxxx with filter functions"
        )
    return library


def _declare(library: ctypes.CDLL) -> None:
    """Tell ctypes the types; unsaid, it would cut pointers to 32 bits."""
    pointer, number, size = ctypes.c_void_p, ctypes.c_int, ctypes.c_size_t
    signatures: dict[str, tuple[Any, list[Any]]] = {
        "rtcNewDevice": (pointer, [ctypes.c_char_p]),
        "rtcGetDeviceProperty": (ctypes.c_ssize_t, [pointer, number]),
        "rtcGetDeviceError": (number, [pointer]),
        "rtcReleaseDevice": (None, [pointer]),
        "rtcNewScene": (pointer, [pointer]),
        "rtcSetSceneFlags": (None, [pointer, number]),
        "rtcCommitScene": (None, [pointer]),
        "rtcReleaseScene": (None, [pointer]),
        "rtcNewGeometry": (pointer, [pointer, number]),
        "rtcSetSharedGeometryBuffer": (
            None,
            [pointer, number, ctypes.c_uint, number, pointer, size, size, size],
        ),
        "rtcSetGeometryIntersectFilterFunction": (None, [pointer, pointer]),
        "rtcCommitGeometry": (None, [pointer]),
        "rtcAttachGeometry": (ctypes.c_uint, [pointer, pointer]),
        "rtcReleaseGeometry": (None, [pointer]),
    }
    for name, (result, arguments) in signatures.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
