"""The door to numba: functions that run as machine code, without Python's lock.

What is compiled is kept on disk, beside the module. That store notices a change of
the module itself, not of functions that it takes from other modules: after editing
one, remove the ``__pycache__`` of those that call it.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba import types

F = TypeVar("F", bound=Callable[..., Any])
_njit: Any = numba.njit


def compiled(function: F) -> F:
    """Compile a function when it is first called; division by zero gives inf or nan."""
    return cast(F, _njit(cache=True, nogil=True, error_model="numpy")(function))


def leaf(function: F) -> F:
    """Compile a function into those that call it.

    It makes no arrays, so that nobody need count who holds those it is given: counting
    would cost as much as all the rest.
    """
    options = {"cache": True, "nogil": True, "error_model": "numpy"}
    return cast(F, _njit(**options, forceinline=True, _nrt=False)(function))


def callback(function: Callable[[Any], None]) -> Any:
    """Compile a function that takes a pointer, for C to call by its ``address``."""
    make: Any = numba.cfunc
    return make(types.void(types.voidptr), cache=True, error_model="numpy")(function)
