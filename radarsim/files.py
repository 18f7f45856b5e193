"""Writes files atomically: each file completely or not at all."""

import contextlib
import errno
import os
import secrets
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from radarsim.processes import unfinished_files

PICTURE_MARK: Final = b"Software\0radarsim"  # metadata of PNG files
PAGE_MARK: Final = '<meta name="generator" content="radarsim">'
_MARKS: Final = (
    PICTURE_MARK,
    PAGE_MARK.encode(),
    b"<dc:title>radarsim</dc:title>",  # the creator in an SVG file
    b"/Creator (radarsim)",  # at the end of a PDF file
)
_MARKED_SIZE: Final = 2**20  # bytes; only marks within this size are found


def write_atomically(files: Mapping[Path, bytes]) -> None:
    """Write files that belong together, each file completely or not at all.

    The files are written to temporary files in the same folders. When all are complete,
    they are renamed one after the other, in order. So a full disk leaves the old files
    unchanged, and there are no partial files. A process that is killed by SIGKILL can
    leave hidden temporary files with the suffix ``.part``.

    Symbolic links stay, and their targets are replaced. Devices and pipes are written
    to directly.

    Args:
        files: The content of each file. A file that refers to another file should come
            after it.

    Raises:
        OSError: If a file cannot be written; then no file is changed, unless the last
            step, the renaming, fails.
    """
    special = [path for path in files if _is_special(path)]
    parts: list[tuple[Path, str]] = []
    with contextlib.ExitStack() as until_end:
        for path in (each for each in files if each not in special):
            target = os.path.realpath(path)
            part = until_end.enter_context(_temporary_file(target))
            parts.append((part, target))
            with _report_as(path):
                _write_new(part, files[path])
        # Devices are written after the temporary files are complete, since writing to a
        # device cannot be undone.
        for path in special:
            with _report_as(path):
                path.write_bytes(files[path])
        for part, target in parts:
            part.replace(target)


@contextlib.contextmanager
def written_atomically(path: Path) -> Iterator[Path]:
    """Write a file in several steps; the old file is replaced when the new is complete.

    Use this function for files that do not fit into memory. After an error or an
    interrupt, the temporary file is removed, and an old file stays unchanged.

    Args:
        path: The file. A symbolic link stays, and its target is replaced.

    Yields:
        The hidden temporary file in the same folder, to which the caller writes.

    Raises:
        OSError: If the file cannot be written, or is a device or a pipe.
    """
    if _is_special(path):
        raise OSError(errno.EINVAL, "not a regular file", str(path))
    target = os.path.realpath(path)
    with _temporary_file(target) as part, _report_as(path):
        _write_new(part, b"")
        yield part
        part.replace(target)


@contextlib.contextmanager
def _report_as(path: Path) -> Iterator[None]:
    """Make errors in the block name the requested file, not the temporary file."""
    try:
        yield
    except OSError as error:
        error.filename = str(path)
        raise


def _is_special(path: Path) -> bool:
    """Return whether a path exists and is not a regular file."""
    try:
        return not stat.S_ISREG(path.stat().st_mode)
    except FileNotFoundError:
        return False


@contextlib.contextmanager
def _temporary_file(target: str) -> Iterator[Path]:
    """Yield an unused hidden path in a file's folder; remove the file at the end."""
    part = Path(target).with_name(f".{secrets.token_hex(8)}.part")
    try:
        yield part
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        unfinished_files.discard(str(part))


def _write_new(path: Path, data: bytes) -> None:
    """Write a new file; raise FileExistsError if the path exists."""
    unfinished_files.add(str(path))
    # ``tempfile`` is not used, since only the owner could read its files.
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    with os.fdopen(handle, "wb") as file:
        file.write(data)


def is_by_radarsim(path: Path) -> bool:
    """Return whether a file is a picture or a page that radarsim wrote."""
    try:
        with path.open("rb") as file:
            data = file.read(_MARKED_SIZE)
    except OSError:
        return False
    return any(mark in data for mark in _MARKS)
