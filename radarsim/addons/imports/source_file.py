"""Files of other programs: where they may be, and what is wrong with them."""

from collections.abc import Iterable
from pathlib import Path

from radarsim.scene.mesh_files import MeshError, find_inside
from radarsim.xml_reader import read_bytes, wrong


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


def rounded(numbers: Iterable[float]) -> list[float]:
    """Return numbers as they are written, to a hundredth of a millimetre."""
    return [round(float(number), 5) + 0.0 for number in numbers]
