"""Embree's shared library: where it is, what it must be, and its functions' types."""

import ctypes
import functools
import importlib.metadata
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene as PlainScene
from numba.np.numpy_support import carray
from numpy.typing import ArrayLike, NDArray

from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.jit import c_callback
from radarsim.raycast.crossings import TINY
from radarsim.raycast.intersect import meet, meet_nearby, pointer

PROPERTY_VERSION: Final = 0
PROPERTY_USER_GEOMETRY: Final = 100

_POINTER, _NUMBER, _COUNT = ctypes.c_void_p, ctypes.c_int, ctypes.c_uint
_TRUTH = ctypes.c_bool
SIGNATURES: Final[dict[str, tuple[Any, list[Any]]]] = {
    "rtcNewDevice": (_POINTER, [ctypes.c_char_p]),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, [_POINTER, _NUMBER]),
    "rtcGetDeviceError": (_NUMBER, [_POINTER]),
    "rtcReleaseDevice": (None, [_POINTER]),
    "rtcNewScene": (_POINTER, [_POINTER]),
    "rtcCommitScene": (None, [_POINTER]),
    "rtcReleaseScene": (None, [_POINTER]),
    "rtcNewGeometry": (_POINTER, [_POINTER, _NUMBER]),
    "rtcSetGeometryUserPrimitiveCount": (None, [_POINTER, _COUNT]),
    "rtcSetGeometryUserData": (None, [_POINTER, _POINTER]),
    "rtcSetGeometryBoundsFunction": (None, [_POINTER, _POINTER, _POINTER]),
    "rtcSetGeometryIntersectFunction": (None, [_POINTER, _POINTER]),
    "rtcCommitGeometry": (None, [_POINTER]),
    "rtcAttachGeometry": (_COUNT, [_POINTER, _POINTER]),
    "rtcReleaseGeometry": (None, [_POINTER]),
    "rtcPointQuery": (_TRUTH, [_POINTER] * 5),
    "rtcIntersect1": (None, [_POINTER, _POINTER, _POINTER]),
}


@functools.cache
def open_library() -> ctypes.CDLL:
    """Open the Embree 4 that embreex brings.

    Raises:
        EngineError: If there is none, or one of another version or build.
    """
    try:
        files = importlib.metadata.files("embreex") or []
    except importlib.metadata.PackageNotFoundError:
        files = []
    return load_library([Path(str(f.locate())) for f in files if "embree4" in f.name])


def load_library(paths: list[Path]) -> ctypes.CDLL:
    """Open the one library there is to be among files, and see that it is Embree 4.

    Raises:
        EngineError: If it is not.
    """
    if len(paths) != 1:
        names = [path.name for path in paths]
        raise EngineError(f"{names!r} in embreex, expected one library of Embree 4")
    try:
        library = ctypes.CDLL(str(paths[0]))
        # Unsaid, ctypes would cut pointers to 32 bits.
        for name, (result, arguments) in SIGNATURES.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        raise EngineError(f"cannot use {paths[0]}: {error}") from error
    expect_version(library)
    return library


def expect_version(library: ctypes.CDLL) -> None:
    """Refuse another version than 4, and a build without user geometries.

    Raises:
        EngineError: If it is one.
    """
    device = library.rtcNewDevice(None)
    if not device:
        raise EngineError("Embree made no device, expected one with its defaults")
    version = library.rtcGetDeviceProperty(device, PROPERTY_VERSION)
    boxes = library.rtcGetDeviceProperty(device, PROPERTY_USER_GEOMETRY)
    library.rtcReleaseDevice(device)
    if version // 10000 != 4 or not boxes:
        raise EngineError(
            f"Embree {version}, user geometries {bool(boxes)}, expected 4xxxx and True"
        )


# Section from raycast.embree.
# The one door to Embree: a sealed set of triangles, and all that a ray meets there.
#
# Theory of operation
# ===================
# embreex brings Embree 4's own shared library in its wheel; ctypes opens that file
# and
# builds the scene. Rays go from compiled code straight to ``rtcIntersect1``, with no
# Python between two rays.
#
# Embree computes in float32, which at 1 km is off by more than a foliage's edge is
# thick: a grazing ray gains or loses a chord of centimetres. So Embree only says
# which
# triangles a ray may meet: to Embree they are boxes, wider than the triangles by more
# than float32 can err. For each box on its way a callback crosses the triangle
# itself,
# in float64, see ``line``. What is penetrable goes on a list; what is opaque shortens
# the ray. So one traversal, from one origin, gives *all* surfaces up to the first
# opaque
# one, and no ray is ever restarted behind a hit. Restarts with a shifted origin lose
# thin exits, restarts at the next float lose surfaces that coincide; a list loses
# neither.
#
# Rule 1: a scene is sealed when it is made. Embree would ignore what is added later.
# Rule 2: what goes in is checked: shapes, finite vertices, indices in range. Embree
# reads past arrays and drops whole meshes in silence.
# Rule 3: far from the scene nothing is cast: a ray that starts outside is taken to
# the
# sphere around the scene first, so that Embree sees no larger numbers than the
# scene's.

# How much wider than its triangle a box is, for each metre of the scene's radius.
# float32 rounds what Embree compares to 6e-8 of it, some eight times over.
WIDER: Final = 2e-6

GEOMETRY_USER: Final = 120  # one of RTCGeometryType


@c_callback
def _bound(call: Any) -> None:
    """Embree asks: in which box is triangle i?"""
    fields = carray(call, 3, np.uint64)  # the table, i, where the answer goes
    numbers = carray(call, 3, np.uint32)
    table = carray(pointer(fields[0]), 2, np.uint64)
    margin = carray(pointer(fields[0]), 2, np.float64)[1]
    place = table[0] + np.uint64(numbers[2]) * np.uint64(72)
    corners = carray(pointer(place), 9, np.float64)
    box = carray(pointer(fields[2]), 8, np.float32)
    for axis in range(3):
        a, b, c = corners[axis], corners[axis + 3], corners[axis + 6]
        box[axis] = min(a, b, c) - margin
        box[axis + 4] = max(a, b, c) + margin


class Mesh(NamedTuple):
    """The triangles of one part.

    Attributes:
        vertices: (V, 3) m, of at most 1 km around the scene's middle, the origin.
        faces: (F, 3) indices of vertices.
    """

    vertices: ArrayLike
    faces: ArrayLike


class Handle(NamedTuple):
    """What ``intersect`` needs to know of a scene; valid while the scene lives.

    Attributes:
        numbers: (4,) uint64: addresses of Embree's function, Embree's scene, the
            corners of the triangles, and the numbers of the parts that they are of.
        radius: m, of a sphere around the origin that holds everything.
        margin: m, how much wider than their triangles the boxes are.
    """

    numbers: NDArray[np.uint64]
    radius: float
    margin: float


class EmbreeScene:
    """A sealed set of triangle meshes.

    Attributes:
        handle: For ``look_ahead`` and ``look_back``.
        triangles: (T, 9) m, the corners of all triangles, mesh after mesh.
        asked: For ``is_anything_opaque``.
    """

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        """Check, copy and build.

        Raises:
            EngineError: If Embree cannot be opened, or a mesh is not what it has to be.
        """
        library = open_library()
        corners = [_checked(index, mesh) for index, mesh in enumerate(meshes)]
        self.triangles = np.concatenate([np.zeros((0, 9)), *corners])
        counts = [len(rows) for rows in corners]
        self._owners = np.repeat(np.arange(len(meshes), dtype=np.uint32), counts)
        points = self.triangles.reshape(-1, 3)
        radius = float(np.sqrt((points**2).sum(axis=1).max(initial=0.0)))
        margin = WIDER * radius
        device, scene = _build(library, self.triangles, margin)
        self._close = weakref.finalize(self, _release, library, scene, device)
        function = ctypes.cast(library.rtcIntersect1, ctypes.c_void_p).value
        query = ctypes.cast(library.rtcPointQuery, ctypes.c_void_p).value
        self.asked = np.array([query, meet_nearby.address], np.uint64)
        triangles, owners = self.triangles.ctypes.data, self._owners.ctypes.data
        numbers = np.array([function, scene, triangles, owners], np.uint64)
        self.handle = Handle(numbers, radius + margin, margin)


class FirstHits:
    """The same meshes and rays through embreex's own call: a second opinion.

    It finds first hits alone, in float32. Benchmarks measure by it.
    """

    def __init__(
        self, meshes: Sequence[Mesh], origins: Floats, directions: Floats
    ) -> None:
        """Build the scene, and round the rays: (N, 3) m and (N, 3) unit vectors."""
        self._scene = PlainScene()
        for vertices, faces in meshes:
            corners = np.asarray(vertices, np.float32)
            TriangleMesh(self._scene, corners, np.asarray(faces, np.int32))
        self._rays = np.float32(origins), np.float32(directions)
        self.run()  # Embree builds its tree at the first call

    def run(self) -> NDArray[np.int32]:
        """Cast all rays; give the triangle that each hits in its mesh, -1 for none."""
        found: NDArray[np.int32] = self._scene.run(*self._rays)
        return found

    def everything(self) -> dict[str, NDArray[Any]]:
        """Cast all rays; give all that embreex tells, such as geomID and tfar."""
        found: dict[str, NDArray[Any]] = self._scene.run(*self._rays, output=1)
        return found


def _checked(index: int, mesh: Mesh) -> Floats:
    """Give the corners of a mesh's triangles, (F, 9) m."""
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
    vertices = np.where(np.abs(vertices) < TINY, 0.0, vertices)
    corners: Floats = vertices[faces].reshape(-1, 9)
    return corners


def _build(library: ctypes.CDLL, triangles: Floats, margin: float) -> tuple[int, int]:
    """Build Embree's tree of boxes around triangles.

    Returns:
        The device and the scene, to be released.
    """
    device = library.rtcNewDevice(None)
    scene = library.rtcNewScene(device)
    geometry = library.rtcNewGeometry(device, GEOMETRY_USER)
    table = np.array([triangles.ctypes.data, 0], np.uint64)
    table.view(np.float64)[1] = margin
    library.rtcSetGeometryUserPrimitiveCount(geometry, len(triangles))
    library.rtcSetGeometryUserData(geometry, table.ctypes.data)
    library.rtcSetGeometryBoundsFunction(geometry, _bound.address, None)
    library.rtcSetGeometryIntersectFunction(geometry, meet.address)
    library.rtcCommitGeometry(geometry)
    library.rtcAttachGeometry(scene, geometry)
    library.rtcReleaseGeometry(geometry)
    library.rtcCommitScene(scene)
    error = library.rtcGetDeviceError(device)
    if error:
        _release(library, scene, device)
        raise EngineError(f"Embree error {error} over {len(triangles)} triangles")
    return device, scene


def _release(library: ctypes.CDLL, scene: int, device: int) -> None:
    library.rtcReleaseScene(scene)
    library.rtcReleaseDevice(device)
