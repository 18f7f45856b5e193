"""The door to numba: functions that run as machine code, without Python's lock.

What is compiled is kept on disk, beside the module. That store notices a change of
the module itself, not of functions that it takes from other modules: after editing
one, remove the ``__pycache__`` of those that call it.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar, cast

import numba
from numba import types

F = TypeVar("F", bound=Callable[..., Any])
_njit: Any = numba.njit
_cfunc: Any = numba.cfunc


def njit_cached(function: F) -> F:
    """Compile a function when it is first called; division by zero gives inf or nan."""
    return cast(F, _kept(_njit, function, nogil=True))


def njit_inline(function: F) -> F:
    """Compile a function into those that call it.

    It makes no arrays, so that nobody need count who holds those it is given: counting
    would cost as much as all the rest.
    """
    options = {"nogil": True, "forceinline": True, "_nrt": False}
    return cast(F, _kept(_njit, function, **options))


def c_callback(function: Callable[[Any], None]) -> Any:
    """Compile a function that takes a pointer, for C to call by its ``address``."""
    return _kept(partial(_cfunc, types.void(types.voidptr)), function)


def c_predicate(function: Callable[[Any], Any]) -> Any:
    """Compile a function that takes a pointer and says yes or no, for C to call."""
    return _kept(partial(_cfunc, types.boolean(types.voidptr)), function)


def _kept(make: Any, function: Any, **options: Any) -> Any:
    """Compile, and keep the result on disk if there is a place that can be written."""
    options["error_model"] = "numpy"
    try:
        return make(cache=True, **options)(function)
    except RuntimeError:  # numba found no such place
        return make(**options)(function)
