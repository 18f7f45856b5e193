"""Files that are there whole or not at all."""

import contextlib
import os
import secrets
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path


def write_atomically(files: Mapping[Path, bytes]) -> None:
    """Write files that belong together, each whole or not at all.

    All are written under other names beside their places first, and take their places
    one right after the other, in order, only when all are complete. So a disk that
    fills up leaves what was there, and a process that is killed never a part of a file,
    at worst a hidden one that ends in ``.part``.

    A link stays, and the file that it leads to is replaced. What is no file, such as a
    device or a pipe, is written to and stays as well.

    Args:
        files: What is to be in them. One that names another should come after it.

    Raises:
        OSError: If one cannot be written; then no file is changed, unless the last
            step, the renaming, fails.
    """
    others = [path for path in files if _is_no_file(path)]
    places = {path: _followed(path) for path in files if path not in others}
    parts = {path: _beside(place) for path, place in places.items()}
    try:
        for path, part in parts.items():
            with _naming(path):
                _write(part, files[path])
        for path in others:
            with _naming(path):
                path.write_bytes(files[path])
        for path, part in parts.items():
            part.replace(places[path])
    except BaseException:
        for part in parts.values():
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)
        raise


@contextlib.contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Have errors name the file that is wanted, not the one beside it."""
    try:
        yield
    except OSError as error:
        error.filename = str(path)
        raise


def _is_no_file(path: Path) -> bool:
    try:
        return not stat.S_ISREG(path.stat().st_mode)
    except FileNotFoundError:
        return False


def _followed(path: Path) -> Path:
    """Give what a path leads to by links, be it there or not."""
    return Path(os.path.realpath(path))


def _beside(place: Path) -> Path:
    """Give a name in the same folder that no other process takes."""
    return place.with_name(f".{secrets.token_hex(8)}.part")


def _write(path: Path, data: bytes) -> None:
    """Write a new file, with the rights that new files have."""
    handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    with os.fdopen(handle, "wb") as file:
        file.write(data)
