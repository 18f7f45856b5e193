"""Decorators that compile functions to machine code with numba, and cache the result.

Compiled functions run without Python's global lock. numba checks only whether the
module of a cached function has changed, not the modules of the functions and constants
that were compiled into it. The cache folder is therefore named after a hash of all
modules that import this one: any edit of a kernel module leads to an empty folder.

Rule: constants, and named tuples that kernels take, are defined in modules that import
this one, so that they are part of the hash.

The folder is in ``NUMBA_CACHE_DIR`` if that is set, else beside this module, else in
the user's cache folder. Where none can be written, each process compiles for itself.
"""

import functools
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba
from numba import types
from numba.misc.appdirs import AppDirs

F = TypeVar("F", bound=Callable[..., Any])
_njit: Any = numba.njit
_cfunc: Any = numba.cfunc
_config: Any = numba.config
_app_dirs: Any = AppDirs

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
    folder = cache_folder()
    if folder is not None:
        try:
            with _numba_cache_dir(folder):
                return make(cache=True, **options)(function)
        except RuntimeError:  # the function's source is in no file
            pass
    return make(**options)(function)


@contextmanager
def _numba_cache_dir(folder: Path) -> Iterator[None]:
    """Let numba cache the functions that are decorated meanwhile in a folder."""
    before = _config.CACHE_DIR
    _config.CACHE_DIR = str(folder)
    try:
        yield
    finally:
        _config.CACHE_DIR = before


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
    """Return a hash of the modules of a package that import this module."""
    digest = hashlib.sha256((package / "jit.py").read_bytes())
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
    user = Path(_app_dirs(appname="numba", appauthor=False).user_cache_dir)
    # Without a home folder, "~" is left in the path as it is.
    return [PACKAGE / "__pycache__", *([user] if user.is_absolute() else [])]


def _remove_oldest(parent: Path) -> None:
    folders = sorted(parent.glob(f"{PREFIX}*"), key=lambda each: -each.stat().st_mtime)
    for folder in folders[MAX_FOLDERS:]:
        shutil.rmtree(folder, ignore_errors=True)
