"""Files of other programs: where they may be, and what is wrong with them."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Final

from radarsim.errors import ForeignFileError, describe_os_error
from radarsim.scene.mesh_files import MeshError, find_inside
from radarsim.validation import short_repr

MAX_TEXT_BYTES: Final = 16 * 2**20


def wrong(path: Path, line: int, text: str) -> ForeignFileError:
    """Return the error of a place in a file."""
    return ForeignFileError(place(path, line, text))


def place(path: Path, line: int, text: str) -> str:
    """Return a text about a line of a file."""
    return f"{path}:{line}: {text}"


def read_bytes(path: Path, most: int = MAX_TEXT_BYTES) -> bytes:
    """Read a file.

    Raises:
        ForeignFileError: If it cannot be read, or is too large.
    """
    try:
        with path.open("rb") as file:
            # One byte more tells that there are too many, also of a device that has no
            # size.
            content = file.read(most + 1)
    except OSError as error:
        raise ForeignFileError(f"{path}: {describe_os_error(error)}") from error
    if len(content) > most:
        raise ForeignFileError(f"{path}: expected at most {most} bytes")
    return content


def read_text(path: Path) -> str:
    """Read a file of UTF-8 text; line ends become line feeds.

    Raises:
        ForeignFileError: If it cannot be read, is too large, or is no text.
    """
    content = read_bytes(path)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise wrong(path, line, "bytes that are no text, expected UTF-8") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


def find_beside(path: Path, line: int, reference: str) -> Path:
    """Return the path of a file that another one refers to.

    Args:
        path: The file that refers to it.
        line: Where it does.
        reference: A path relative to its folder.

    Raises:
        ForeignFileError: If it leads out of the folder, or there is no such file.
    """
    folder = path.parent.resolve()
    try:
        return find_inside(folder, folder, reference)
    except MeshError as error:
        text = str(error).replace("the map's own folder", "the folder of this one")
        raise wrong(path, line, text) from error


def find_in(folders: Iterable[Path], reference: str) -> Path | None:
    """Return the first file or folder of a name in folders, links resolved.

    Args:
        folders: Where it may be, or below.
        reference: A path relative to them.

    Returns:
        None if there is none, or if it would lead out of them.
    """
    for folder in folders:
        inside = folder.resolve()
        try:
            path = (inside / reference).resolve()
            if path.is_relative_to(inside) and path.exists():
                return path
        except (OSError, RuntimeError, ValueError):  # too long, loops, or with NUL
            continue
    return None


def parse_numbers(path: Path, line: int, text: str, count: int) -> list[float]:
    """Parse numbers with white space between them.

    Raises:
        ForeignFileError: If there are not so many finite ones.
    """
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        plural = "a number" if count == 1 else f"{count} numbers"
        raise wrong(path, line, f"{short_repr(text.strip())}, expected {plural}")
    return numbers


def rounded(numbers: Iterable[float]) -> list[float]:
    """Return numbers as they are written, to a hundredth of a millimetre."""
    return [round(float(number), 5) + 0.0 for number in numbers]
