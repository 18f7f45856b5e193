"""Access checks and size limits of mesh files.

The counts in a file's header are checked against the file's size before parsing, since
parsers allocate memory for these counts and need seconds for files of many pieces.
"""

import re
from pathlib import Path
from typing import Final

import numpy as np

from radarsim.geometry import Floats
from radarsim.validation import short_repr

MAX_TRIANGLES: Final = 4_000_000
MAX_FILE_BYTES: Final = 256 * 1024 * 1024
MAX_TEXT_BYTES: Final = 32 * 1024 * 1024  # text parsers need 20 times this memory
MAX_SURFACES: Final = 2_000  # pieces of one mesh file, each with a material
MAX_COORDINATE: Final = 1e12  # in any unit, so that computed volumes do not overflow

_LIMITS: Final = {
    "triangles": MAX_TRIANGLES,
    "bytes": MAX_FILE_BYTES,
    "bytes of text": MAX_TEXT_BYTES,
}
MAX_VERTICES: Final = 3 * MAX_TRIANGLES
_STL_HEADER: Final = 84
_STL_TRIANGLE: Final = 50
_PLY_HEADER: Final = 16 * 1024  # bytes; common headers take a few hundred
_PLY_BYTES: Final = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4),
    **dict.fromkeys(("double", "int64", "uint64", "float64"), 8),
}


class MeshError(Exception):
    """A mesh file cannot be used; the message says why."""


class MeshBudget:
    """Counters with limits, which all mesh files of one map share."""

    def __init__(self) -> None:
        self._taken = dict.fromkeys(_LIMITS, 0)

    def take(self, count: int, what: str) -> None:
        """Add to the counter named ``what``, such as "triangles" or "bytes".

        Raises:
            MeshError: If the new total exceeds the limit.
        """
        total, limit = self._taken[what] + count, _LIMITS[what]
        if total > limit:
            expected = f"expected at most {limit} in all mesh files of a map"
            raise MeshError(f"{total} {what}, {expected}")
        self._taken[what] = total


class MeshFiles:
    """Reads a mesh file, and the files that it refers to.

    Attributes:
        budget: Counters of all mesh files of the map.
    """

    def __init__(self, start: Path, folder: Path, budget: MeshBudget) -> None:
        """Store the folders and the counters; no file is read yet.

        Args:
            start: The folder that references are relative to.
            folder: The folder that must contain all files, links resolved.
            budget: Counters of all mesh files of the map.
        """
        self.budget = budget
        self._start = start
        self._folder = folder

    def read(self, path: Path) -> bytes:
        """Return the bytes of a file.

        Raises:
            MeshError: If all files together are too large.
            OSError: If the file cannot be read.
        """
        # No more than the counted size is read, even if the file grows meanwhile.
        size = path.stat().st_size
        self.budget.take(size, "bytes")
        with path.open("rb") as file:
            return file.read(size)

    def find(self, reference: str) -> Path:
        """Return the path of a file that the mesh file refers to.

        Raises:
            MeshError: If the file is outside of the folder, or missing.
        """
        try:
            return find_inside(self._folder, self._start, reference)
        except MeshError as error:
            raise MeshError(f"refers to {error}") from error


def find_inside(folder: Path, start: Path, reference: str) -> Path:
    """Resolve a reference to a file, following symbolic links.

    Args:
        folder: The folder that must contain the file, links resolved.
        start: The folder that the reference is relative to.
        reference: A relative path.

    Raises:
        MeshError: If the path is outside of the folder, or there is no such file.
    """
    try:
        found = (start / reference).resolve()
        is_inside, exists = found.is_relative_to(folder), found.is_file()
    except (OSError, RuntimeError, ValueError) as error:  # link loops, NUL, long names
        text = f"{short_repr(reference)}, expected the path of a file"
        raise MeshError(text) from error
    if not is_inside:
        text = f"{short_repr(reference)}, expected a file in the map's own folder"
        raise MeshError(text)
    if not exists:
        raise MeshError(f"{short_repr(reference)}, expected an existing file")
    return found


def expect_at_most(count: int, most: int, what: str) -> None:
    """Check that a count of elements or bytes does not exceed a limit.

    Raises:
        MeshError: If the count is larger than the limit.
    """
    if count > most:
        raise MeshError(f"{count} {what}, expected at most {most}")


def check_vertices(vertices: Floats) -> None:
    """Check that the coordinates of vertices, (V, 3), are finite and not too large.

    Raises:
        MeshError: If a coordinate is not finite, or too large.
    """
    largest = np.abs(vertices).max(initial=0.0)
    if not largest <= MAX_COORDINATE:  # The negated comparison is also true for NaN.
        expected = f"expected at most {MAX_COORDINATE:g}"
        raise MeshError(f"a vertex has a coordinate of {largest:g} m, {expected} m")


def check_stl(content: bytes, budget: MeshBudget) -> bytes:
    """Check the content of an STL file and return it; text is converted to ASCII.

    Raises:
        MeshError: If it has too many triangles or solids, or the count in its header
            does not match its size.
    """
    count = int.from_bytes(content[80:_STL_HEADER], "little")
    size = _STL_HEADER + _STL_TRIANGLE * count
    # A binary file may begin with "solid" too, so the size is checked first.
    if len(content) == size:
        budget.take(count, "triangles")
    elif content[:256].lstrip()[:5].lower() == b"solid":
        budget.take(len(content), "bytes of text")
        budget.take(content.count(b"endfacet"), "triangles")
        expect_at_most(content.count(b"endsolid"), MAX_SURFACES, "solids")
        return _as_ascii(content)
    elif len(content) > _STL_HEADER:
        expected = f"expected a file of {size} bytes, not of {len(content)}"
        raise MeshError(f"{count} triangles in the header, {expected}")
    return content


def check_ply(content: bytes, budget: MeshBudget) -> bytes:
    """Check the content of a PLY file and return it with its header as ASCII.

    Raises:
        MeshError: If its header is broken, or its counts exceed the size of the file.
    """
    end = content.find(b"end_header", 0, _PLY_HEADER)
    if end < 0:
        text = f"expected 'end_header' within the first {_PLY_HEADER} bytes"
        raise MeshError(text)
    rows, is_text = _ply_elements(content[:end])
    if is_text:
        budget.take(len(content), "bytes of text")
    left = len(content) - end
    for name, count, row_bytes in rows:
        if name == "face":
            budget.take(count, "triangles")
        expect_at_most(count, MAX_VERTICES, f"elements {name!r}")
        left -= count * row_bytes
    if left < 0:
        counts = ", ".join(f"{count} {name}" for name, count, _ in rows)
        expected = f"expected {-left} more bytes in the file"
        raise MeshError(f"{short_repr(counts)} in the header, {expected}")
    return _as_ascii(content[:end]) + content[end:]


def _as_ascii(content: bytes) -> bytes:
    """Replace bytes outside ASCII; names and comments may be in any encoding."""
    return content.decode("ascii", "replace").encode("ascii", "replace")


def _ply_elements(header: bytes) -> tuple[list[tuple[str, int, int]], bool]:
    """Return each element's name, count and least row size, and whether it is text."""
    is_text = False
    elements: list[tuple[str, int, int]] = []
    for line in header.decode("ascii", "replace").splitlines():
        match line.split():
            case ["format", form, *_]:
                is_text = form == "ascii"
            case ["element", name, count]:
                if not re.fullmatch("[0-9]{1,12}", count):
                    text = f"{short_repr(count)} in the header, expected a count"
                    raise MeshError(text)
                elements.append((name[:40], int(count), 0))
            case ["property", "list", kind, _, _] | ["property", kind, _] if elements:
                name, total, row = elements[-1]
                # In a text file, a value takes at least a digit and a blank. A list
                # takes at least the bytes of its count.
                size = 2 if is_text else _PLY_BYTES.get(kind, 1)
                elements[-1] = (name, total, row + size)
            case _:
                pass
    for name, total, row in elements:
        if total and not row:
            raise MeshError(f"element {name!r} in the header has no properties")
    return elements, is_text
