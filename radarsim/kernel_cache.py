"""The folder in which the compiled kernels are cached.

numba checks only whether the module of a cached function has changed, not the modules
of the functions and constants that were compiled into it. The folder is therefore named
after a hash of all modules that import ``radarsim.jit``, or have the comment that
their constants are compiled into kernels: any edit of them leads to an empty folder. It
does not depend on where the package is installed, so that all environments of a user
that have the same version share it.

The folder is in ``radarsim`` within ``NUMBA_CACHE_DIR`` if that is set, else within the
user's cache folder, else beside this module. Where none can be used, each process
compiles for itself.

The files hold machine code and pickles, so whoever can write them can run anything in
the name of those who read them. They are read only where nobody but the user and root
can have written, and only if their checksum is right.

numba is not imported here: whether there is something to compile is known before.

The first scan on a machine compiles the ray engine for a minute or so; the first
server, the first map and the first camera compile what they need besides. The log tells
of it; a program can add an observer to ``compilation`` as well, before numba is
imported.
"""

import functools
import hashlib
import logging
import os
import re
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib.metadata import version
from pathlib import Path
from typing import Final

from radarsim.errors import describe_os_error
from radarsim.files import write_atomically

PACKAGE: Final = Path(__file__).parent
PREFIX: Final = "radarsim-"  # prefix of the names of cache folders
SUFFIX: Final = ".nbc"  # suffix of the names of files of machine code
COMPLETE: Final = "complete"  # file that is there when all kernels of a server are
_FOLDER_NAME: Final = re.compile(f"{PREFIX}[0-9a-f]{{16}}")
_OTHERS: Final = stat.S_IWGRP | stat.S_IWOTH  # permissions of others to write
_CHECKSUM_SIZE: Final = hashlib.sha256().digest_size
MAX_FOLDERS: Final = 8  # cache folders that are kept, such as those of other branches
# What is in each module of which something is compiled into kernels: most import the
# decorators, others have a comment.
MARKS: Final = (b"radarsim.jit import", b"# compiled into kernels")
COMPILERS: Final = ("numba", "llvmlite", "numpy")  # their versions count as well
logger: Final = logging.getLogger(__name__)
ENGINE: Final = "the ray engine"
# What kernels belong to, by the beginning of their module; others are of the engine.
_SUBJECTS: Final = {
    "radarsim.sensors.echo": "the extraction of echoes",
    "radarsim.autonomy.mapping": "mapping",
    "radarsim.autonomy.exploration": "exploration",
    "radarsim.server.camera": "the camera",
}


@functools.cache
def cache_folder() -> Path | None:
    """Return the folder for the code as it is, created; None if none can be used.

    The first one that can be written is chosen; if there is none, the first one that
    can be read, such as that of a system administrator. Folders that others can write
    to are not used, which the log tells.
    """
    name = PREFIX + kernel_hash(PACKAGE)
    readable = None
    for parent in _parents():
        try:
            folder = (parent / name).resolve()
            is_new = not folder.is_dir()
            if is_new:
                _make_folders(folder)
            if distrust := find_distrust(folder):
                logger.warning("compiled code in %s is not used: %s", folder, distrust)
                continue
            readable = readable or folder
            tempfile.TemporaryFile(dir=folder).close()
            os.utime(folder)  # folders not used for longest are removed first
        except OSError:
            continue
        if is_new:
            _remove_oldest(folder.parent)
        return folder
    return readable


def find_distrust(folder: Path) -> str | None:
    """Return why code in a folder must not be run; None if it may be.

    The folder and all folders above it must belong to the user or to root, and nobody
    else may write to them, except to folders above in which nobody can rename what
    belongs to others, such as ``/tmp``.

    Args:
        folder: Absolute path without symbolic links.

    Raises:
        OSError: If the folder is not there.
    """
    for each in (folder, *folder.parents):
        if problem := _find_other_writer(each.stat(), sticky=each != folder):
            return f"{each} {problem}"
    return None


def _find_other_writer(status: os.stat_result, *, sticky: bool = False) -> str | None:
    """Return who else can write; where ``sticky``, that bit protects from others."""
    if sys.platform == "win32":
        return None  # the user's folders are protected by access control lists
    if status.st_uid not in {os.geteuid(), 0}:
        return f"belongs to another user ({status.st_uid})"
    if status.st_mode & _OTHERS and not (sticky and status.st_mode & stat.S_ISVTX):
        return f"can be written by others (mode {stat.S_IMODE(status.st_mode):o})"
    return None


_is_trusted_folder: Final = functools.cache(lambda folder: not find_distrust(folder))


def write_code(path: Path, code: bytes) -> None:
    """Write machine code to a file of the cache, with a checksum.

    Raises:
        OSError: If it cannot be written.
    """
    _make_folders(path.parent)
    write_atomically({path: _checksum(path, code) + code}, mode=0o644)


def read_code(path: Path) -> bytes | None:
    """Return the machine code in a file of the cache; None if it must not be run.

    Raises:
        OSError: If there is no such file, or it cannot be read.
    """
    # A symbolic link would lead out of the folders that were looked at.
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0))
    with os.fdopen(handle, "rb") as file:
        data = file.read()
        if _find_other_writer(os.fstat(handle)) or not _is_trusted_folder(path.parent):
            return None
    code = data[_CHECKSUM_SIZE:]
    return code if data[:_CHECKSUM_SIZE] == _checksum(path, code) else None


def _checksum(path: Path, code: bytes) -> bytes:
    # With the name, so that the code of another function is not run in its place.
    return hashlib.sha256(path.name.encode() + b"\0" + code).digest()


def _make_folders(folder: Path) -> None:
    """Create a folder and those above it, so that only the user can write to them."""
    for each in reversed((folder, *folder.parents)):
        if not each.exists():
            each.mkdir(mode=0o755, exist_ok=True)


def is_cold() -> bool:
    """Return whether no kernel is cached, so that all have to be compiled."""
    folder = cache_folder()
    try:
        return folder is None or not any(folder.rglob(f"*{SUFFIX}"))
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
    digest.update(" ".join(map(version, COMPILERS)).encode())
    # At all depths: a kernel two folders deep would otherwise run stale.
    for path in sorted(package.rglob("*.py")):
        text = path.read_bytes()
        if is_compiled_into_kernels(text):
            name = path.relative_to(package).as_posix()
            digest.update(b"%s %d " % (name.encode(), len(text)))
            digest.update(text)
    return digest.hexdigest()[:16]


def is_compiled_into_kernels(text: bytes) -> bool:
    """Return whether something in a module is compiled into kernels, by its text."""
    return any(mark in text for mark in MARKS)


def _parents() -> list[Path]:
    """Return the folders in which cache folders may be, best first."""
    if chosen := os.environ.get("NUMBA_CACHE_DIR"):
        return [Path(chosen).absolute() / "radarsim"]
    # Without a home folder, "~" is left in the path as it is.
    user = Path(os.path.expanduser(_user_cache())) / "radarsim"  # noqa: PTH111
    beside = PACKAGE / "__pycache__" / "radarsim"
    return [*([user] if user.is_absolute() else []), beside]


def _user_cache() -> str:
    if sys.platform == "darwin":
        return "~/Library/Caches"
    name = "LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME"
    return os.environ.get(name) or "~/.cache"


def _remove_oldest(parent: Path) -> None:
    """Remove the cache folders that were not used for longest, and nothing else."""
    with suppress(OSError):  # another process removes the same ones
        ours = [each for each in parent.iterdir() if _FOLDER_NAME.fullmatch(each.name)]
        for folder in sorted(ours, key=lambda each: -each.stat().st_mtime)[
            MAX_FOLDERS:
        ]:
            shutil.rmtree(folder, ignore_errors=True)


@dataclass(slots=True)
class Compilation:
    """The compilation in this process.

    Attributes:
        observers: Called with what is compiled when it begins, and with None when it
            ends.
        subjects: What was compiled so far.
        unsaved: Why compiled code could not be kept, if that has happened.
        on_unsaved: Called when that happens for the first time.
    """

    observers: list[Callable[[str | None], object]] = field(default_factory=list)
    subjects: set[str] = field(default_factory=set)
    unsaved: OSError | None = None
    on_unsaved: Callable[[OSError], object] = lambda _: None
    _depth: int = 0

    @contextmanager
    def running(self, subject: str = ENGINE) -> Iterator[None]:
        """Tell the observers that something is compiled meanwhile."""
        self.begin(subject)
        try:
            yield
        finally:
            self.end()

    def begin(self, subject: str = ENGINE) -> None:
        """Begin to compile; kernels that are compiled into others are within."""
        self._depth += 1
        if self._depth > 1:
            return
        if subject not in self.subjects:
            logger.info("%s", describe(subject, again=bool(self.subjects)))
            self.subjects.add(subject)
        self._tell(subject)

    def end(self) -> None:
        """End what was begun last."""
        self._depth -= 1
        if self._depth == 0:
            self._tell(None)

    def report_unsaved(self, error: OSError) -> None:
        """Report that compiled code cannot be kept; the log is told once."""
        if self.unsaved is None:
            self.unsaved = error
            text = "compiled code cannot be kept in %s, see NUMBA_CACHE_DIR: %s"
            logger.warning(text, cache_folder(), describe_os_error(error))
            self.on_unsaved(error)

    def _tell(self, subject: str | None) -> None:
        for observer in tuple(self.observers):
            observer(subject)


compilation: Final = Compilation()


def subject_of(module: str) -> str:
    """Return what the kernels of a module belong to.

    >>> subject_of("radarsim.autonomy.mapping.scan_matching")
    'mapping'
    """
    found = (name for start, name in _SUBJECTS.items() if module.startswith(start))
    return next(found, ENGINE)


def describe(subject: str, *, again: bool = False) -> str:
    """Return what happens, and how often.

    Args:
        subject: What is compiled.
        again: Whether something else was told before, and how often that happens.
    """
    if again:
        return f"compiling {subject} as well"
    if cache_folder() is None:
        return (
            f"compiling {subject}, at each start, since no cache folder can be"
            " used, see NUMBA_CACHE_DIR"
        )
    return f"compiling {subject}, once on this machine"
