"""Files of machine code: one for each function and each types of its arguments.

numba's own cache numbers its files, and keeps an index beside them. Two processes that
compile a function for different types at the same time both take the next number: then
one reads the code of the other. Here the name of a file follows from the types, so that
processes at worst replace a file by an equal one.

The cache only saves time: a file that cannot be written is reported to ``compilation``,
and what cannot be read is compiled again.
"""

import hashlib
import pickle
from pathlib import Path
from typing import Any, Final

from numba.core import caching, serialize

from radarsim.atomic_write import write_atomically
from radarsim.compilation import compilation
from radarsim.kernel_cache import PACKAGE, SUFFIX, cache_folder

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
        self._folder = folder / path.parent.name

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
