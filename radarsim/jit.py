"""Decorators that compile functions to machine code with numba, and cache the result.

Compiled functions run without Python's global lock. Where the cache is, and when it is
valid, is the matter of ``kernel_cache``.

Rule: constants, and named tuples that kernels take, are defined in modules that import
this one, or that have the comment ``# compiled into kernels``, so that they are part of
the hash that the name of the cache folder holds.

numba does not read annotations: it infers the types of a kernel from the arguments of
its first call. They are there for readers and for mypy.
"""

import hashlib
import pickle
import sys
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import NewType, Protocol, TypeAlias, TypeVar

import numba
import numpy as np
from numba import types
from numba.core import event, serialize
from numba.core.base import BaseContext
from numba.core.ccallback import CFunc
from numba.core.compiler import CompileResult
from numba.core.typing import Signature

from radarsim.kernel_cache import (
    PACKAGE,
    SUFFIX,
    cache_folder,
    compilation,
    read_code,
    subject_of,
    write_code,
)

# An address as C passes it; numba's ``voidptr``.
Pointer = NewType("Pointer", int)
# An integer in a kernel: numba gives all of them 64 bits.
Int: TypeAlias = int | np.int64

# The types of the arguments, and the processor that the code is for.
Key = Hashable
Function = TypeVar("Function", bound=Callable[..., object])


class KernelCache:
    """The machine code of one function, a file for each types of its arguments.

    numba asks this instead of a cache of its own, which numbers its files and keeps an
    index beside them: two processes that compile a function for different types at the
    same time both take the next number, and then one reads the code of the other. Here
    the name of a file follows from the types, so that processes at worst replace a file
    by an equal one.

    The cache only saves time: a file that cannot be written is reported to
    ``compilation``, and what cannot be read is compiled again.
    """

    def __init__(self, folder: Path, name: str) -> None:
        """Name the files; none has to exist.

        Args:
            folder: Folder in which they are.
            name: What their names begin with.
        """
        self.cache_path = str(folder)
        self._folder = folder
        self._name = name

    def load_overload(self, signature: Signature, target: BaseContext) -> CompileResult:
        """Return the code for a signature, as numba asks for it; None if not known."""
        target.refresh()
        try:
            data = self.load((signature, target.codegen().magic_tuple()))
            return None if data is None else CompileResult._rebuild(target, *data)
        except Exception:  # noqa: BLE001 # whatever is in the file: compile again
            return None

    def save_overload(self, signature: Signature, compiled: CompileResult) -> None:
        """Write the code for a signature, if that is possible."""
        if compiled.library.has_dynamic_globals:
            return  # it holds addresses of this process
        key = signature, compiled.codegen.magic_tuple()
        try:
            self.save(key, compiled._reduce())
        except OSError as error:
            compilation.report_unsaved(error)

    def save(self, key: Key, data: object) -> None:
        """Write the code for a key.

        Raises:
            OSError: If it cannot be written.
        """
        write_code(self._path(key), serialize.dumps((key, data)))

    def load(self, key: Key) -> tuple[object, ...] | None:
        """Return the code for a key; None if there is none that may be run."""
        try:
            code = read_code(self._path(key))
        except OSError:
            return None
        if code is None:
            return None
        found, data = pickle.loads(code)
        # Keys whose texts are equal have the same file.
        return data if found == key else None

    def flush(self) -> None:
        """Remove all files, as numba asks for when a function is to be compiled anew.

        Raises:
            OSError: If one cannot be removed.
        """
        for path in self._folder.glob(f"{self._name}-*{SUFFIX}"):
            path.unlink(missing_ok=True)

    def _path(self, key: Key) -> Path:
        digest = hashlib.sha256(repr(key).encode()).hexdigest()[:16]
        return self._folder / f"{self._name}-{digest}{SUFFIX}"


def cache_of(function: Callable[..., object]) -> KernelCache | None:
    """Return the cache of a function; None if it is not of this package.

    numba's own caches are valid as long as the path and the time stamp of the source
    file are the same. This one is valid as long as it exists: the name of its folder
    stands for the content of all kernels.
    """
    code = function.__code__
    path, folder = Path(code.co_filename).absolute(), cache_folder()
    # What a closure has captured is not part of the hash.
    if folder is None or PACKAGE not in path.parents or function.__closure__:
        return None
    name = f"{path.stem}.{function.__qualname__}-{code.co_firstlineno}"
    name = f"{name}.{sys.implementation.cache_tag}"
    return KernelCache(folder / path.parent.relative_to(PACKAGE), name)


class _CompileListener(event.Listener):  # type: ignore[misc] # numba has no types
    """Notes when a function of this package is compiled instead of read."""

    def on_start(self, event: event.Event) -> None:
        if _is_ours(event):
            compilation.begin(subject_of(_module_of(event)))

    def on_end(self, event: event.Event) -> None:
        if _is_ours(event):
            compilation.end()


def _module_of(event: event.Event) -> str:
    return str(event.data["dispatcher"].py_func.__module__)


def _is_ours(event: event.Event) -> bool:
    return _module_of(event).startswith("radarsim.")


event.register("numba:compile", _CompileListener())


def njit_cached(function: Function) -> Function:
    """Compile a function when it is first called; division by zero gives inf or nan."""
    return _compile(function)


def njit_inline(function: Function) -> Function:
    """Compile a function into its callers.

    It must not create arrays: it is compiled without reference counting.
    """
    # Both options are for row a of ``radarsim bench``. With reference counting a scan
    # takes twenty times as long: each access to an array in a named tuple counts. Where
    # LLVM decides what to inline it takes two to four times as long.
    return _compile(function, forceinline=True, _nrt=False)


def _compile(function: Function, **options: bool) -> Function:
    kernel: Function = numba.njit(error_model="numpy", nogil=True, **options)(function)
    _keep(kernel, function)
    return kernel


class Callback(Protocol):
    """A compiled function that C can call."""

    @property
    def address(self) -> int:
        """Where it is in memory."""
        ...


class _Callback(CFunc):  # type: ignore[misc] # numba has no types
    """A callback that tells when it is compiled, which numba only does of kernels."""

    def _compile_uncached(self) -> CompileResult:
        with compilation.running():
            return super()._compile_uncached()


def c_callback(function: Callable[[Pointer], None]) -> Callback:
    """Compile a function of one pointer for C to call."""
    return _compile_callback(function, types.void)


def c_predicate(function: Callable[[Pointer], bool]) -> Callback:
    """Compile a function of one pointer that returns a bool, for C to call."""
    return _compile_callback(function, types.boolean)


def _compile_callback(
    function: Callable[[Pointer], bool | None], result: types.Type
) -> Callback:
    options = {"error_model": "numpy", "forceinline": True}
    callback = _Callback(function, ((types.voidptr,), result), {}, options)
    _keep(callback, function)
    callback.compile()
    made: Callback = callback
    return made


def _keep(compiled: object, function: Callable[..., object]) -> None:
    """Let numba keep what it compiles, if the function is of this package."""
    cache = cache_of(function)
    if cache is not None:
        compiled._cache = cache  # type: ignore[attr-defined] # numba has no types
