"""Embree's own shared library, which the wheel of embreex brings."""

import ctypes
import functools
import importlib.metadata
from pathlib import Path
from typing import Any, Final

from radarsim.errors import EngineError

PROPERTY_VERSION: Final = 0
PROPERTY_USER_GEOMETRY: Final = 100

_POINTER, _INT, _UINT = ctypes.c_void_p, ctypes.c_int, ctypes.c_uint
_BOOL = ctypes.c_bool
SIGNATURES: Final[dict[str, tuple[Any, list[Any]]]] = {
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


@functools.cache
def open_library() -> ctypes.CDLL:
    """Open the Embree 4 in the wheel of embreex.

    Raises:
        EngineError: If there is none, or one of another version or build.
    """
    try:
        files = importlib.metadata.files("embreex") or []
    except importlib.metadata.PackageNotFoundError:
        files = []
    return load_library([Path(str(f.locate())) for f in files if "embree4" in f.name])


def load_library(paths: list[Path]) -> ctypes.CDLL:
    """Open the only file of a list, and check that it is Embree 4.

    Raises:
        EngineError: If there is not one file, or it is not Embree 4.
    """
    if len(paths) != 1:
        names = [path.name for path in paths]
        raise EngineError(f"{names!r} in embreex, expected one library of Embree 4")
    try:
        library = ctypes.CDLL(str(paths[0]))
        # Without declared types ctypes would cut pointers to 32 bits.
        for name, (result, arguments) in SIGNATURES.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
    except (OSError, AttributeError) as error:
        raise EngineError(f"cannot use {paths[0]}: {error}") from error
    expect_version(library)
    return library


def expect_version(library: ctypes.CDLL) -> None:
    """Check for version 4, built with user geometries.

    Raises:
        EngineError: If the library is another one.
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
