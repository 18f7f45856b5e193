"""Decorators that compile functions to machine code with numba, and cache the result.

Compiled functions run without Python's global lock. Where the cache is, and when it is
valid, is the matter of ``kernel_cache``.

Rule: constants, and named tuples that kernels take, are defined in modules that import
this one, so that they are part of the hash that the name of the cache folder holds.
"""

from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba import types
from numba.core import caching
from numba.core import event as events

from radarsim.compilation import compilation, subject_of
from radarsim.kernel_cache import PACKAGE, cache_folder

F = TypeVar("F", bound=Callable[..., Any])
_njit: Any = numba.njit
_cfunc: Any = numba.cfunc
_Listener: Any = events.Listener
_register: Any = events.register
_CacheLocator: Any = caching._CacheLocator
_locator_classes: Any = caching.FunctionCache._impl_class._locator_classes


class _KernelListener(_Listener):  # type: ignore[misc] # numba has no types
    """Notes when a function of this package is compiled instead of read."""

    def on_start(self, event: Any) -> None:
        if self._is_ours(event):
            compilation.begin(subject_of(_module_of(event)))

    def on_end(self, event: Any) -> None:
        if self._is_ours(event):
            compilation.end()

    def _is_ours(self, event: Any) -> bool:
        return _module_of(event).startswith("radarsim.")


def _module_of(event: Any) -> str:
    return str(event.data["dispatcher"].py_func.__module__)


class _PassListener(_Listener):  # type: ignore[misc] # numba has no types
    """Notes when a callback is compiled, of which numba tells only the passes."""

    def __init__(self, until_end: ExitStack) -> None:
        self._until_end = until_end
        self._has_begun = False

    def on_start(self, _: Any) -> None:
        if not self._has_begun:
            self._has_begun = True
            self._until_end.enter_context(compilation.running())

    def on_end(self, _: Any) -> None:
        """Wait for the end of the last pass."""


_register("numba:compile", _KernelListener())


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
    return _compiled_callback(types.void, function)


def c_predicate(function: Callable[[Any], Any]) -> Any:
    """Compile a function of one pointer that returns a bool, for C to call."""
    return _compiled_callback(types.boolean, function)


def _compiled_callback(result: Any, function: Any) -> Any:
    make = partial(_cfunc, result(types.voidptr))
    with (
        ExitStack() as until_end,
        events.install_listener("numba:run_pass", _PassListener(until_end)),
    ):
        return _compiled(make, function)


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
