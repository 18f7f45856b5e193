"""Check what a mesh file announces against its size, before it is parsed.

Parsers allocate what a header counts, and spend seconds on each of many small pieces.
"""

import re
from typing import Final

from radarsim.scene.mesh_files import (
    MAX_SURFACES,
    MAX_TRIANGLES,
    MeshBudget,
    MeshError,
    expect_at_most,
)
from radarsim.validation import short_repr

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


def check_stl(content: bytes, budget: MeshBudget) -> None:
    """Check an STL file.

    Raises:
        MeshError: If it has too many triangles or solids, or its header counts another
            number than it contains.
    """
    count = int.from_bytes(content[80:_STL_HEADER], "little")
    size = _STL_HEADER + _STL_TRIANGLE * count
    if len(content) == size:
        budget.take(count, "triangles")
    elif content[:256].lstrip()[:5].lower() == b"solid":
        budget.take(len(content), "bytes of text")
        budget.take(content.count(b"endfacet"), "triangles")
        expect_at_most(content.count(b"endsolid"), MAX_SURFACES, "solids")
    elif len(content) > _STL_HEADER:
        expected = f"expected a file of {size} bytes, not of {len(content)}"
        raise MeshError(f"{count} triangles in the header, {expected}")


def check_ply(content: bytes, budget: MeshBudget) -> None:
    """Check a PLY file.

    Raises:
        MeshError: If its header is broken, or counts more than the file can contain.
    """
    end = content.find(b"end_header", 0, _PLY_HEADER)
    if end < 0:
        text = f"no end of the header, expected one within {_PLY_HEADER} bytes"
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
        expected = f"expected a file that is {-left} bytes longer"
        raise MeshError(f"{short_repr(counts)} in the header, {expected}")


def _ply_elements(header: bytes) -> tuple[list[tuple[str, int, int]], bool]:
    """Return name, count and least bytes of each element; whether they are text."""
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
                size = 2 if is_text else _PLY_BYTES.get(kind, 1)
                elements[-1] = (name, total, row + size)
            case _:
                pass
    for name, total, row in elements:
        if total and not row:
            raise MeshError(f"element {name!r} in the header, expected a property")
    return elements, is_text
