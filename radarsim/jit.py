"""Decorators that compile functions to machine code with numba, and cache the result.

Compiled functions run without Python's global lock. Where the cache is, and when it is
valid, is the matter of ``kernel_cache``.

Rule: constants, and named tuples that kernels take, are defined in modules that import
this one, or that have the comment ``# compiled into kernels``, so that they are part of
the hash that the name of the cache folder holds.
"""

from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Any, TypeVar, cast

import numba
from numba import types
from numba.core import ccallback
from numba.core import event as events

from radarsim.compilation import compilation, subject_of
from radarsim.kernel_files import KernelCache

F = TypeVar("F", bound=Callable[..., Any])
_njit: Any = numba.njit
_CFunc: Any = ccallback.CFunc
_Listener: Any = events.Listener
_register: Any = events.register


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
    return cast(F, _compiled(function, nogil=True))


def njit_inline(function: F) -> F:
    """Compile a function into its callers.

    It must not create arrays: it is compiled without reference counting, which would
    cost as much as all the rest.
    """
    options = {"nogil": True, "forceinline": True, "_nrt": False}
    return cast(F, _compiled(function, **options))


def c_callback(function: Callable[[Any], None]) -> Any:
    """Compile a function of one pointer that C can call by its ``address``."""
    return _compiled_callback(types.void, function)


def c_predicate(function: Callable[[Any], Any]) -> Any:
    """Compile a function of one pointer that returns a bool, for C to call."""
    return _compiled_callback(types.boolean, function)


def _compiled_callback(result: Any, function: Any) -> Any:
    signature = (types.voidptr,), result
    callback = _CFunc(
        function,
        signature,
        {},
        {"error_model": "numpy", "forceinline": True},
    )
    _cache(callback, function)
    with (
        ExitStack() as until_end,
        events.install_listener("numba:run_pass", _PassListener(until_end)),
    ):
        callback.compile()
    return callback


def _compiled(function: Any, **options: Any) -> Any:
    dispatcher = _njit(error_model="numpy", **options)(function)
    _cache(dispatcher, function)
    return dispatcher


def _cache(compiled: Any, function: Any) -> None:
    """Let numba keep what it compiles, if the function is of this package."""
    with suppress(RuntimeError):
        compiled._cache = KernelCache(function)
