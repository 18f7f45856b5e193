"""The folder in which the compiled kernels are cached.

numba checks only whether the module of a cached function has changed, not the modules
of the functions and constants that were compiled into it. The folder is therefore named
after a hash of all modules that import ``radarsim.jit``, or have the comment that
their constants are compiled into kernels: any edit of them leads to an empty folder. It
does not depend on where the package is installed, so that all environments of a user
that have the same version share it.

The folder is in ``NUMBA_CACHE_DIR`` if that is set, else in the user's cache folder,
else beside this module. Where none can be written, each process compiles for itself.

numba is not imported here: whether there is something to compile is known before.
"""

import functools
import hashlib
import os
import shutil
import sys
import tempfile
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Final

PACKAGE: Final = Path(__file__).parent
PREFIX: Final = "radarsim-"  # prefix of the names of cache folders
SUFFIX: Final = ".nbc"  # suffix of the names of files of machine code
COMPLETE: Final = "complete"  # file that is there when all kernels of a server are
MAX_FOLDERS: Final = 8  # cache folders that are kept, such as those of other branches
# What is in each module of which something is compiled into kernels: most import the
# decorators, others have a comment.
MARKS: Final = (b"radarsim.jit import", b"# compiled into kernels")
COMPILERS: Final = ("numba", "llvmlite", "numpy")  # their versions count as well


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


def is_cold() -> bool:
    """Return whether no kernel is cached, so that all have to be compiled."""
    folder = cache_folder()
    try:
        return folder is None or not any(folder.glob(f"*/*{SUFFIX}"))
    except OSError:  # it may not be read any more
        return True


def is_complete() -> bool:
    """Return whether all that a server needs is cached, as far as is known."""
    folder = cache_folder()
    try:
        return folder is not None and (folder / COMPLETE).is_file()
    except OSError:
        return False


def mark_complete() -> None:
    """Note that all that a server needs is cached; without a cache nothing is noted."""
    folder = cache_folder()
    if folder is not None:
        with suppress(OSError):
            (folder / COMPLETE).touch()


def kernel_hash(package: Path) -> str:
    """Return a hash of all that is compiled into kernels of a package, and versions."""
    digest = hashlib.sha256((package / "jit.py").read_bytes())
    digest.update((package / "kernel_files.py").read_bytes())
    digest.update(" ".join(map(version, COMPILERS)).encode())
    for path in sorted(package.glob("*/*.py")):
        text = path.read_bytes()
        if is_compiled_into_kernels(text):
            digest.update(b"%s %d " % (path.name.encode(), len(text)))
            digest.update(text)
    return digest.hexdigest()[:16]


def is_compiled_into_kernels(text: bytes) -> bool:
    """Return whether something in a module is compiled into kernels, by its text."""
    return any(mark in text for mark in MARKS)


def _parents() -> list[Path]:
    """Return the folders in which cache folders may be, best first."""
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return [Path(chosen).absolute()]
    # Without a home folder, "~" is left in the path as it is.
    user = Path(os.path.expanduser(_user_cache())) / "radarsim"  # noqa: PTH111
    return [*([user] if user.is_absolute() else []), PACKAGE / "__pycache__"]


def _user_cache() -> str:
    if sys.platform == "darwin":
        return "~/Library/Caches"
    name = "LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME"
    return os.environ.get(name) or "~/.cache"


def _remove_oldest(parent: Path) -> None:
    folders = sorted(parent.glob(f"{PREFIX}*"), key=lambda each: -each.stat().st_mtime)
    for folder in folders[MAX_FOLDERS:]:
        shutil.rmtree(folder, ignore_errors=True)
