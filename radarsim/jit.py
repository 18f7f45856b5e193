"""Decorators that compile functions to machine code with numba, and cache the result.

Compiled functions run without Python's global lock. Where the cache is, and when it is
valid, is the matter of ``kernel_cache``.

Rule: constants, and named tuples that kernels take, are defined in modules that import
this one, or that have the comment ``# compiled into kernels``, so that they are part of
the hash that the name of the cache folder holds.

Files of machine code: one for each function and each types of its arguments.

numba's own cache numbers its files, and keeps an index beside them. Two processes that
compile a function for different types at the same time both take the next number: then
one reads the code of the other. Here the name of a file follows from the types, so that
processes at worst replace a file by an equal one.

The cache only saves time: a file that cannot be written is reported to ``compilation``,
and what cannot be read is compiled again.
"""

import hashlib
import pickle
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba
from numba import types
from numba.core import caching, ccallback, serialize
from numba.core import event as events

from radarsim.files import write_atomically
from radarsim.kernel_cache import PACKAGE, SUFFIX, cache_folder, compilation, subject_of

_CacheLocator: Any = caching._CacheLocator
_CacheImpl: Any = caching.CompileResultCacheImpl
_FunctionCache: Any = caching.FunctionCache
_dumps: Any = serialize.dumps
_UNREADABLE: Final = (OSError, EOFError, pickle.UnpicklingError)


class KernelFiles:
    """The files of one function."""

    def __init__(self, folder: Path, name: str) -> None:
        """Name the files; none has to exist.

        Args:
            folder: Folder in which they are.
            name: What their names begin with.
        """
        self._folder = folder
        self._name = name

    def save(self, key: Any, data: Any) -> None:
        """Write the code for a key, which holds the types and the processor.

        Raises:
            OSError: If it cannot be written.
        """
        write_atomically({self._path(key): _dumps((key, data))})

    def load(self, key: Any) -> Any:
        """Return the code for a key; None if there is none that can be read."""
        try:
            found, data = pickle.loads(self._path(key).read_bytes())
        except _UNREADABLE:
            return None
        return data if found == key else None

    def flush(self) -> None:
        """Remove all files, as numba asks for when a function is to be compiled anew.

        Raises:
            OSError: If one cannot be removed.
        """
        for path in self._folder.glob(f"{self._name}-*{SUFFIX}"):
            path.unlink(missing_ok=True)

    def _path(self, key: Any) -> Path:
        digest = hashlib.sha256(repr(key).encode()).hexdigest()[:16]
        return self._folder / f"{self._name}-{digest}{SUFFIX}"


class KernelCache(_FunctionCache):  # type: ignore[misc] # numba has no types
    """What numba asks for the machine code of a function of this package.

    Raises:
        RuntimeError: If the function is not of this package.
    """

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._cache_file = KernelFiles(Path(self._cache_path), self._impl.filename_base)

    def save_overload(self, signature: Any, data: Any) -> None:
        """Write the code for a signature, if that is possible."""
        try:
            super().save_overload(signature, data)
        except OSError as error:
            compilation.report_unsaved(error)


class _KernelLocator(_CacheLocator):  # type: ignore[misc] # numba has no types
    """Tells numba where the machine code of a function of this package is cached.

    Unlike numba's own locators it takes no account of the path and the time stamp of
    the source file: the name of the folder stands for the content of all kernels.
    """

    def __init__(self, function: Any, path: Path, folder: Path) -> None:
        self._line = function.__code__.co_firstlineno
        self._folder = folder / path.parent.relative_to(PACKAGE)

    @classmethod
    def from_function(cls, function: Any, source: str) -> "_KernelLocator | None":
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


class _KernelCacheImpl(_CacheImpl):  # type: ignore[misc] # numba has no types
    _locator_classes = (_KernelLocator,)


KernelCache._impl_class = _KernelCacheImpl


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
