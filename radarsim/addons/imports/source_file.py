"""Files of other programs: where they may be, and what is wrong with them."""

from collections.abc import Iterable
from pathlib import Path

from radarsim.addons.imports.xml_reader import read_bytes, wrong


def read_text(path: Path) -> str:
    """Read a file of text; line ends become line feeds.

    It is UTF-16 if it begins with a byte order mark of that, else UTF-8, or Latin-1 if
    it is not valid UTF-8.

    Raises:
        ForeignFileError: If it cannot be read, is too large, or is no text.
    """
    content = read_bytes(path)
    is_utf_16 = content.startswith((b"\xff\xfe", b"\xfe\xff"))
    try:
        text = content.decode("utf-16" if is_utf_16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        if is_utf_16 or b"\0" in content:
            expected = "expected UTF-8, UTF-16 or Latin-1"
            raise wrong(path, 1, f"bytes that are no text, {expected}") from error
        text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


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
