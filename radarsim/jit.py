"""Decorators that compile functions to machine code with numba, and cache the result.

Compiled functions run without Python's global lock. Where the cache is, and when it is
valid, is the matter of ``kernel_cache``.

Rule: constants, and named tuples that kernels take, are defined in modules that import
this one, or that have the comment ``# compiled into kernels``, so that they are part of
the hash that the name of the cache folder holds.

numba does not read annotations: it infers the types of a kernel from the arguments of
its first call. They are there for readers and for mypy.
"""

import functools
import gc
import hashlib
import pickle
import sys
from collections.abc import Callable, Hashable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NewType, Protocol, TypeAlias, TypeVar

import numba
import numpy as np
from numba import types
from numba.core import event, serialize
from numba.core.base import BaseContext
from numba.core.ccallback import CFunc
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult
from numba.core.registry import CPUDispatcher
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
    """Notes when a function of this package is compiled instead of read.

    Garbage is not collected meanwhile: numba makes and keeps so many objects that to
    look through them takes a sixth of the time.
    """

    def __init__(self) -> None:
        self._depth = 0
        self._was_enabled = False

    def on_start(self, event: event.Event) -> None:
        if not _is_ours(event):
            return
        if not self._depth:
            self._was_enabled = gc.isenabled()
            gc.disable()
        self._depth += 1
        compilation.begin(subject_of(_module_of(event)))

    def on_end(self, event: event.Event) -> None:
        if not _is_ours(event):
            return
        compilation.end()
        self._depth -= 1
        if not self._depth and self._was_enabled:
            gc.enable()


def _module_of(event: event.Event) -> str:
    return str(event.data["dispatcher"].py_func.__module__)


def _is_ours(event: event.Event) -> bool:
    return _module_of(event).startswith("radarsim.")


event.register("numba:compile", _CompileListener())


_OPTIONS: Final[dict[str, Any]] = {"error_model": "numpy", "nogil": True}


def njit_cached(function: Function) -> Function:
    """Compile a function when it is first called; division by zero gives inf or nan.

    It should not assign an array to a part of another: for the message of the error
    that this can raise, numba compiles two to three seconds of text formatting.
    """
    kernel: Function = numba.njit(**_OPTIONS)(function)
    _keep(kernel, function)
    return kernel


def njit_inline(function: Function) -> Function:
    """Compile a function into its callers.

    It must not create arrays: it is compiled without reference counting. Called from
    Python, it is compiled once more, on its own.
    """
    # Both options are for row a of the benchmarks. With reference counting a scan
    # takes twenty times as long: each access to an array in a named tuple counts. Where
    # LLVM decides what to inline it takes two to four times as long.
    options = {"forceinline": True, "_nrt": False}
    wrappers = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    inlined: Function = _InlinedFunction(
        function,
        targetoptions=_OPTIONS | {"nopython": True} | options | wrappers,
        pipeline_class=_InlinedCompiler,
    )
    return inlined


class _InlinedFunction(CPUDispatcher):  # type: ignore[misc] # numba has no types
    """A function without machine code of its own, of which numba makes some for each.

    Half of the time to compile the ray engine would be spent on machine code that
    nothing calls.
    """

    @functools.cached_property
    def on_its_own(self) -> Callable[..., object]:
        """The same function with machine code."""
        return njit_cached(self.py_func)  # type: ignore[no-any-return]

    def __call__(self, *args: object) -> object:
        return self.on_its_own(*args)

    def get_call_template(
        self, args: Sequence[types.Type], kws: Mapping[str, types.Type]
    ) -> tuple[object, ...]:
        # numba would compile it once for each constant that is passed to it.
        plain = [types.unliteral(each) for each in args]
        named = {name: types.unliteral(each) for name, each in kws.items()}
        template: tuple[object, ...] = super().get_call_template(plain, named)
        return template

    def add_overload(self, compiled: CompileResult) -> None:
        # Not for calls from Python, as there is nothing to call.
        self.overloads[tuple(compiled.signature.args)] = compiled


class _InlinedCompiler(Compiler):  # type: ignore[misc] # numba has no types
    """Compiles up to what LLVM links into callers."""

    def compile_extra(self, function: Callable[..., object]) -> CompileResult:
        state = self.state
        state.flags.no_compile = True
        codegen = state.targetctx.codegen()
        state.library = _InlinedLibrary(codegen, function.__qualname__)
        compiled = super().compile_extra(function)
        # Callers look the function up by its entry point, of which it has none.
        entry_point = object()
        libraries = [state.library]
        state.targetctx.insert_user_function(entry_point, compiled.fndesc, libraries)
        return compiled._replace(entry_point=entry_point)


class _InlinedLibrary(JITCodeLibrary):  # type: ignore[misc] # numba has no types
    """Code that is optimised and made machine code with that of a caller only."""

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


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
