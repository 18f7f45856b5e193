"""Decorators that compile functions to machine code with numba, and cache the result.

Compiled functions run without Python's global lock. numba checks only whether the
module of a cached function has changed, not the modules of the functions and constants
that were compiled into it. The cache folder is therefore named after a hash of all
modules that import this one: any edit of a kernel module leads to an empty folder.
The folder does not depend on where the package is installed, so that all environments
of a user that have the same version share it.

Rule: constants, and named tuples that kernels take, are defined in modules that import
this one, so that they are part of the hash.

The folder is in ``NUMBA_CACHE_DIR`` if that is set, else in the user's cache folder,
else beside this module. Where none can be written, each process compiles for itself.
"""

import functools
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import llvmlite
import numba
import numpy as np
from numba import types
from numba.core import caching
from numba.misc.appdirs import AppDirs

F = TypeVar("F", bound=Callable[..., Any])
_njit: Any = numba.njit
_cfunc: Any = numba.cfunc
_config: Any = numba.config
_app_dirs: Any = AppDirs
_CacheLocator: Any = caching._CacheLocator
_locator_classes: Any = caching.FunctionCache._impl_class._locator_classes

PACKAGE: Final = Path(__file__).parent
PREFIX: Final = "radarsim-"  # prefix of the names of cache folders
MAX_FOLDERS: Final = 8  # cache folders that are kept, such as those of other branches


def njit_cached(function: F) -> F:
    """Compile a function when it is first called; division by zero gives inf or nan."""
    return cast(F, _compiled(_njit, function, nogil=True))


def njit_inline(function: F) -> F:
    """Compile a function into its callers.

    It must not create arrays: it is compiled without reference counting, which would
    cost as much as all the rest.
    """
    options = {"nogil": True, "forceinline": True, "_nrt": False}
    return cast(F, _compiled(_njit, function, **options))


def c_callback(function: Callable[[Any], None]) -> Any:
    """Compile a function of one pointer that C can call by its ``address``."""
    return _compiled(partial(_cfunc, types.void(types.voidptr)), function)


def c_predicate(function: Callable[[Any], Any]) -> Any:
    """Compile a function of one pointer that returns a bool, for C to call."""
    return _compiled(partial(_cfunc, types.boolean(types.voidptr)), function)


def _compiled(make: Any, function: Any, **options: Any) -> Any:
    options["error_model"] = "numpy"
    if cache_folder() is not None:
        try:
            return make(cache=True, **options)(function)
        except RuntimeError:  # the function's source is in no file
            pass
    return make(**options)(function)


class KernelCacheLocator(_CacheLocator):  # type: ignore[misc] # numba has no types
    """Tells numba where the machine code of a function of this package is cached.

    Unlike numba's own locators it takes no account of the path and the time stamp of
    the source file: the name of the folder stands for the content of all kernels.
    """

    def __init__(self, function: Any, path: Path, folder: Path) -> None:
        self._line = function.__code__.co_firstlineno
        self._folder = folder / path.parent.name

    @classmethod
    def from_function(cls, function: Any, source: str) -> "KernelCacheLocator | None":
        """Return a locator; None for a function that is not of this package."""
        path = Path(source).absolute()
        folder = cache_folder() if PACKAGE in path.parents else None
        return None if folder is None else cls(function, path, folder)

    def get_cache_path(self) -> str:
        """Return the folder in which the function is cached."""
        return str(self._folder)

    def get_source_stamp(self) -> str:
        """Return what has to be equal for cached code to be valid."""
        return ""

    def get_disambiguator(self) -> str:
        """Return what tells functions of the same name in a module apart."""
        return str(self._line)


_locator_classes.insert(0, KernelCacheLocator)  # numba asks them in turn


@functools.cache
def cache_folder() -> Path | None:
    """Return the folder for the code as it is, created; None if none can be written."""
    name = PREFIX + kernel_hash(PACKAGE)
    for parent in _parents():
        folder = parent / name
        try:
            if not folder.is_dir():
                folder.mkdir(parents=True, exist_ok=True)
                _remove_oldest(parent)
            tempfile.TemporaryFile(dir=folder).close()
            os.utime(folder)  # folders not used for longest are removed first
        except OSError:
            continue
        return folder
    return None


def kernel_hash(package: Path) -> str:
    """Return a hash of the modules of a package that import this one, and versions."""
    digest = hashlib.sha256((package / "jit.py").read_bytes())
    versions = numba.__version__, llvmlite.__version__, np.__version__
    digest.update(" ".join(versions).encode())
    for path in sorted(package.glob("*/*.py")):
        text = path.read_bytes()
        if b"radarsim.jit import" in text:
            digest.update(b"%s %d " % (path.name.encode(), len(text)))
            digest.update(text)
    return digest.hexdigest()[:16]


def _parents() -> list[Path]:
    """Return the folders in which cache folders may be, best first."""
    if _config.CACHE_DIR:
        return [Path(_config.CACHE_DIR).absolute()]
    user = Path(_app_dirs(appname="radarsim", appauthor=False).user_cache_dir)
    # Without a home folder, "~" is left in the path as it is.
    return [*([user] if user.is_absolute() else []), PACKAGE / "__pycache__"]


def _remove_oldest(parent: Path) -> None:
    folders = sorted(parent.glob(f"{PREFIX}*"), key=lambda each: -each.stat().st_mtime)
    for folder in folders[MAX_FOLDERS:]:
        shutil.rmtree(folder, ignore_errors=True)
