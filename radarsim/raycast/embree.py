"""Scenes of triangles in Embree.

Theory of operation
===================
The wheel of embreex contains the shared library of Embree 4. ctypes opens the library
and builds the scene. The engine calls ``rtcIntersect1`` directly, without any Python
code between two rays.

Embree computes in float32. At 1 km, its rounding errors are so large that a ray that
grazes foliage would gain or lose centimetres of path. So Embree only selects candidate
triangles: they are stored as user geometry, with bounding boxes that are enlarged by
more than the error of float32. For each box that the ray hits, a callback intersects
the triangle in float64, see ``intersect.hpp``.
Penetrable surfaces are collected in a list; an opaque surface shortens the ray. So one
traversal finds *all* surfaces up to the first opaque surface, and no ray is restarted
behind a hit. Restarts with an offset would miss thin parts, and restarts at the next
float would miss coincident surfaces; the list has both.

A horizontal ray only crosses triangles that reach its height. Sensors are mounted
horizontally and robots drive on floors, so most rays have one of few heights. For each
of these heights, a slice is built: a second hierarchy without the triangles that do not
reach the height, and with boxes only around the parts of triangles near the height. A
slice of a forest has a fraction of the forest's leaves. A ray has bit by bit the same
crossings in a slice and in the whole scene: the candidates differ, but each triangle is
intersected by the same operations.

Rule 1: a scene does not change after it is built. Embree would ignore later additions.
Rule 2: parts check their meshes: shapes, finite vertices, indices in range. Embree only
gets copies of the triangles, since it reads beyond the ends of arrays.
Rule 3: a ray that starts outside the scene is first advanced to the bounding sphere of
the scene, so that Embree gets no numbers larger than the scene's coordinates.

The bounding box of a triangle in a slice contains only its part near the height. This
box is smaller than that of the whole triangle, so fewer rays hit it.
"""

import ctypes
import functools
import importlib.metadata
import math
import weakref
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from radarsim.engine import Packed, address, engine
from radarsim.errors import EngineError
from radarsim.geometry import Floats

PROPERTY_VERSION: Final = 0
PROPERTY_USER_GEOMETRY: Final = 100

# The functions of Embree that are called, with the types of results and arguments.
_POINTER, _INT, _UINT = ctypes.c_void_p, ctypes.c_int, ctypes.c_uint
_BOOL = ctypes.c_bool
SIGNATURES: Final[dict[str, tuple[type | None, list[type]]]] = {
    "rtcNewDevice": (_POINTER, [ctypes.c_char_p]),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, [_POINTER, _INT]),
    "rtcGetDeviceError": (_INT, [_POINTER]),
    "rtcReleaseDevice": (None, [_POINTER]),
    "rtcNewScene": (_POINTER, [_POINTER]),
    "rtcCommitScene": (None, [_POINTER]),
    "rtcReleaseScene": (None, [_POINTER]),
    "rtcNewGeometry": (_POINTER, [_POINTER, _INT]),
    "rtcSetGeometryUserPrimitiveCount": (None, [_POINTER, _UINT]),
    "rtcSetGeometryUserData": (None, [_POINTER, _POINTER]),
    "rtcSetGeometryBoundsFunction": (None, [_POINTER, _POINTER, _POINTER]),
    "rtcSetGeometryIntersectFunction": (None, [_POINTER, _POINTER]),
    "rtcCommitGeometry": (None, [_POINTER]),
    "rtcAttachGeometry": (_UINT, [_POINTER, _POINTER]),
    "rtcReleaseGeometry": (None, [_POINTER]),
    "rtcPointQuery": (_BOOL, [_POINTER] * 5),
    "rtcIntersect1": (None, [_POINTER, _POINTER, _POINTER]),
}
# Margin of a box around its triangle, per metre of the scene's radius. Each rounding to
# float32 has a relative error of up to 6e-8, and Embree rounds about eight times before
# a comparison.
RELATIVE_MARGIN: Final = 2e-6
TINY: Final = 1e-30  # m; smaller coordinates are set to zero, see ``intersect.hpp``
GEOMETRY_USER: Final = 120  # one of RTCGeometryType
_BLOCK: Final = 100_000  # triangles per block, to limit the memory of temporary arrays
MAX_SLICES: Final = 32
# A slice is built after RAYS_PER_SLICE horizontal rays at its height, plus one ray per
# TRIANGLES_PER_RAY triangles. By then, tracing these rays has taken about as long as
# building the slice.
RAYS_PER_SLICE: Final = 1000
TRIANGLES_PER_RAY: Final = 20
SMALL_SLICE: Final = 50_000  # triangles; larger slices have at most half of the scene


@functools.cache
def open_library() -> ctypes.CDLL:
    """Open the library of Embree 4 in the wheel of embreex.

    Raises:
        EngineError: If there is no library, or it has another version or build.
    """
    try:
        files = importlib.metadata.files("embreex") or []
    except importlib.metadata.PackageNotFoundError:
        files = []
    return load_library([Path(str(f.locate())) for f in files if "embree4" in f.name])


def load_library(paths: list[Path]) -> ctypes.CDLL:
    """Open Embree from a list of one path, and check that its version is 4.

    Raises:
        EngineError: If there is not exactly one file, or it is not Embree 4.
    """
    if len(paths) != 1:
        names = [path.name for path in paths]
        raise EngineError(f"embreex has {names!r}, expected one file of Embree 4")
    try:
        library = ctypes.CDLL(str(paths[0]))
        # Without declared types, ctypes would truncate pointers to 32 bits.
        for name, (result, arguments) in SIGNATURES.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        raise EngineError(f"cannot use {paths[0]}: {error}") from error
    expect_version(library)
    return library


def expect_version(library: ctypes.CDLL) -> None:
    """Check that a library is Embree 4, built with user geometries.

    Raises:
        EngineError: If the version or the build differs.
    """
    device = library.rtcNewDevice(None)
    if not device:
        raise EngineError("Embree could not create a device")
    version = library.rtcGetDeviceProperty(device, PROPERTY_VERSION)
    boxes = library.rtcGetDeviceProperty(device, PROPERTY_USER_GEOMETRY)
    library.rtcReleaseDevice(device)
    if version // 10000 != 4 or not boxes:
        raise EngineError(
            f"Embree {version}, user geometries {bool(boxes)}, expected 4xxxx and True"
        )


def clip_to_slab(triangles: Floats, low: float, high: float) -> Floats:
    """Clip triangles to the slab between two heights, and return their bounds.

    Args:
        triangles: (T, 9) m, the corners of triangles that reach into the slab.
        low: z of the lower end of the slab, m.
        high: z of the upper end of the slab, m.

    Returns:
        (T, 9) m, three points for each triangle: the lower corner of the box, its upper
        corner, and its lower corner again.
    """
    outlines = np.zeros((len(triangles), 9))
    engine.clip_to_slab(triangles, low, high, outlines)
    return outlines


class EmbreeScene:
    """Triangle meshes in Embree, and slices of the meshes for horizontal rays.

    Attributes:
        hierarchies: The packed ``Hierarchy`` of the whole scene, followed by those of
            the slices.
        handle: The packed ``SceneHandle``; replaced when a slice is added.
        triangles: (T, 9) m, the corners of all triangles, mesh after mesh.
    """

    def __init__(self, meshes: Sequence[tuple[Floats, NDArray[Any]]]) -> None:
        """Copy the meshes and build the scene.

        Args:
            meshes: The triangles of each part: (V, 3) m, finite, at most 1 km from the
                scene's centre, the origin; and (F, 3) vertex indices.

        Raises:
            EngineError: If Embree cannot be opened.
        """
        library = open_library()
        counts = [len(faces) for _, faces in meshes]
        self.triangles = _triangles(meshes, sum(counts))
        owners = np.repeat(np.arange(len(meshes), dtype=np.uint32), counts)
        radius = _radius(self.triangles)
        margin = RELATIVE_MARGIN * radius
        whole = _build(self.triangles, owners, margin)
        self.hierarchies = [whole]
        self._unsliced_rays: dict[float, int] = {}
        self.handle = engine.structures["SceneHandle"].pack(
            intersect=_address_of(library.rtcIntersect1),
            point_query=_address_of(library.rtcPointQuery),
            addresses=np.array([whole.address], np.uint64),
            heights=np.array([np.nan]),
            sliced=np.zeros(0, np.int64),
            radius=radius + margin,
            margin=margin,
        )

    def add_slice(self, height: float) -> None:
        """Build a slice, which speeds up horizontal rays at a height.

        Results of rays do not change. Several threads may add slices at the same time;
        then one of the slices may stay unused.

        Args:
            height: z of the rays, m.
        """
        whole, handle = self.hierarchies[0], self.handle
        margin, sliced = handle.margin, handle.sliced
        # The slab uses twice the margin, since Embree rounds its boxes to float32.
        low, high = height - 2.0 * margin, height + 2.0 * margin
        a, b, c = self.triangles[:, 2::3].T
        is_above, is_below = np.minimum(a, b) > high, np.maximum(a, b) < low
        kept = np.flatnonzero(~(is_above & (c > high) | is_below & (c < low)))
        part = whole
        if len(kept) <= max(SMALL_SLICE, len(a) // 2):  # to limit the memory of slices
            corners, owners = self.triangles[kept], whole.owners[kept]
            outlines = clip_to_slab(corners, low, high)
            part = _build(corners, owners, margin, outlines, len(sliced))
            self.hierarchies.append(part)
            sliced = np.append(sliced, kept)
        added = {
            "addresses": np.append(handle.addresses, np.uint64(part.address)),
            "heights": np.append(handle.heights, height),
            "sliced": sliced,
        }
        self.handle = handle.structure.pack(**handle.fields | added)

    def count_unsliced(self, height: float, rays: int) -> None:
        """Count horizontal rays at a height; after many rays, build a slice for it.

        Args:
            height: z of the last of these rays, m.
            rays: Number of these rays.
        """
        # Rays are counted by height. A rising robot scans only once or twice at each
        # height, so no slice is built for it.
        count = self._unsliced_rays.pop(height, 0) + rays
        enough = RAYS_PER_SLICE + len(self.triangles) // TRIANGLES_PER_RAY
        if count < enough:
            self._unsliced_rays[height] = count
            if len(self._unsliced_rays) > MAX_SLICES:
                del self._unsliced_rays[next(iter(self._unsliced_rays))]
        elif len(self.handle.heights) <= MAX_SLICES:
            self.add_slice(height)


def _address_of(function: "ctypes._NamedFuncPointer") -> int:
    return ctypes.cast(function, ctypes.c_void_p).value or 0


def _triangles(meshes: Sequence[tuple[Floats, NDArray[Any]]], count: int) -> Floats:
    """Return the corners of all triangles, (T, 9) m, tiny numbers set to 0."""
    triangles = np.zeros((count, 9))
    end = 0
    for vertices, faces in meshes:
        rounded = np.where(np.abs(vertices) < TINY, 0.0, vertices)
        start, end = end, end + len(faces)
        for i, corner in enumerate(faces.T):  # One column at a time halves the memory.
            triangles[start:end, 3 * i : 3 * i + 3] = rounded[corner]
    return triangles


def _radius(triangles: Floats) -> float:
    """Return the radius of the sphere around the origin that contains all triangles."""
    square = 0.0
    for start in range(0, len(triangles), _BLOCK):
        x, y, z = triangles[start : start + _BLOCK].reshape(-1, 3).T
        square = max(square, (x**2 + y**2 + z**2).max())
    return math.sqrt(square)


def _build(
    triangles: Floats,
    owners: NDArray[np.uint32],
    margin: float,
    outlines: Floats | None = None,
    first_sliced: int = 0,
) -> Packed:
    """Build Embree's hierarchy of boxes around triangles.

    Args:
        triangles: (T, 9) m, the corners.
        owners: (T,) uint32, the index of each triangle's mesh.
        margin: Distance by which the boxes are enlarged on each side, m.
        outlines: (T, 9) m, three points for each triangle that its box contains
            instead of the corners; None for the corners.
        first_sliced: Index of the first triangle of this slice in the list of all
            slices.

    Returns:
        The ``Hierarchy`` for the engine; Embree's scene is released with it.
    """
    library = open_library()
    device = library.rtcNewDevice(None)
    scene = library.rtcNewScene(device)
    geometry = library.rtcNewGeometry(device, GEOMETRY_USER)
    surrounded = triangles if outlines is None else outlines
    table = np.array([address(surrounded), 0], np.uint64)
    table.view(np.float64)[1] = margin
    library.rtcSetGeometryUserPrimitiveCount(geometry, len(triangles))
    library.rtcSetGeometryUserData(geometry, table.ctypes.data)
    callbacks = np.zeros(2, np.int64)
    engine.get_callbacks(callbacks)
    on_bounds, on_primitive = callbacks.tolist()
    library.rtcSetGeometryBoundsFunction(geometry, on_bounds, None)
    library.rtcSetGeometryIntersectFunction(geometry, on_primitive)
    library.rtcCommitGeometry(geometry)
    library.rtcAttachGeometry(scene, geometry)
    library.rtcReleaseGeometry(geometry)
    library.rtcCommitScene(scene)
    error = library.rtcGetDeviceError(device)
    packed = engine.structures["Hierarchy"].pack(
        scene=scene, triangles=triangles, owners=owners, first_sliced=first_sliced
    )
    close = weakref.finalize(packed, _release, library, scene, device)
    # No scene is released at exit, since a daemon thread may still trace rays.
    close.atexit = False
    if error:
        raise EngineError(f"Embree error {error} building {len(triangles)} triangles")
    return packed


def _release(library: ctypes.CDLL, scene: int, device: int) -> None:
    library.rtcReleaseScene(scene)
    library.rtcReleaseDevice(device)
