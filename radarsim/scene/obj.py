"""Read Wavefront OBJ files: vertices, polygons, and the names of their materials.

trimesh takes seconds for files whose polygons have different numbers of corners, and
reads comments after a statement and corners counted from the end wrongly. All lines of
a kind are parsed at once here: what is done for each is done by numpy.

The format has one statement in a line. ``v x y z`` adds a vertex. ``f 3 4 5 6`` adds a
polygon; corners count the vertices of the file from 1, or backwards from -1, the last
one above the line. What follows a corner after a slash is a texture or a normal, which
do not matter here. ``o`` and ``usemtl`` name the object and the material of the
polygons below.
"""

import re
import warnings
from collections.abc import Iterator
from contextlib import suppress
from typing import Final, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.scene.mesh_files import (
    MAX_SURFACES,
    MeshBudget,
    check_vertices,
    expect_at_most,
)
from radarsim.scene.shapes import Faces, Surface

MAX_LINES: Final = 5_000_000  # without blank ones
MAX_CHANGES: Final = 200_000  # of the object or the material, each with polygons

_COMMENTS: Final = re.compile(rb"#[^\n]*")
_AFTER_CORNERS: Final = re.compile(rb"#[^\n]*|/\S*")  # comments, textures and normals
_BOM: Final = b"\xef\xbb\xbf"

_Characters: TypeAlias = NDArray[np.uint8]
_Booleans: TypeAlias = NDArray[np.bool_]
_Integers: TypeAlias = NDArray[np.int64]
_Number = TypeVar("_Number", np.float64, np.int64)


class _Lines(NamedTuple):
    """The lines of a file, of which each begins with its statement.

    Attributes:
        characters: All characters of the file; the last one ends a line.
        starts: (L,) index of the first character of each line.
        ends: (L,) index of the character that ends it.
    """

    characters: _Characters
    starts: _Integers
    ends: _Integers

    def are(self, statement: bytes) -> _Booleans:
        """Return which lines have a statement, (L,)."""
        found = np.ones(len(self.starts), dtype=bool)
        for number, letter in enumerate(statement):
            found &= self._character(number) == letter
        after = self._character(len(statement))
        found &= (after == ord(" ")) | (after == ord("\t"))
        return found

    def argument(self, line: int) -> str:
        """Return what follows the statement in a line."""
        text = self.characters[self.starts[line] : self.ends[line]].tobytes()
        return " ".join(text.decode("utf-8", "replace").split()[1:])

    def _character(self, number: int) -> _Characters:
        """Return a character of each line, (L,), or the one that ends it."""
        return self.characters[np.minimum(self.starts + number, self.ends)]


def read_obj(content: bytes, budget: MeshBudget) -> list[Surface]:
    """Read the pieces of an OBJ file; the one that begins last is the first.

    Args:
        content: The file.
        budget: What the file may contain.

    Raises:
        MeshError: If it is too long, or has too many lines, triangles or pieces.
        ValueError: If it is broken.
    """
    budget.take(len(content), "bytes of text")
    lines = _split_lines(content)
    is_vertex, is_polygon = lines.are(b"v"), lines.are(b"f")
    polygons = np.flatnonzero(is_polygon)
    numbers, counts = _parse(lines, is_polygon, _AFTER_CORNERS, np.int64)
    triangles = np.maximum(counts - 2, 0)
    budget.take(int(triangles.sum()), "triangles")
    vertices = _vertices(*_parse(lines, is_vertex, _COMMENTS, np.float64))
    above = np.repeat(np.cumsum(is_vertex, dtype=np.int64)[polygons], counts)
    corners = _resolve(numbers, above, len(vertices))
    faces = corners[_fans(counts, triangles)]
    materials, owners = _owners(lines, polygons)
    return [
        Surface(materials[number] or None, *_select(vertices, faces[which]))
        for number, which in _group(np.repeat(owners, triangles))
    ]


def _split_lines(content: bytes) -> _Lines:
    """Drop blank lines and blanks before statements, and join continued lines."""
    text = content.removeprefix(_BOM).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    text = text.replace(b"\\\n", b" ").strip() + b"\n"  # a line goes on after these
    text = re.sub(rb"\n\s+", b"\n", text)
    expect_at_most(text.count(b"\n"), MAX_LINES, "lines")
    characters = np.frombuffer(text, dtype=np.uint8)
    ends = np.flatnonzero(characters == ord("\n"))
    return _Lines(characters, np.concatenate([[0], ends[:-1] + 1]), ends)


def _parse(
    lines: _Lines, which: _Booleans, dropped: re.Pattern[bytes], dtype: type[_Number]
) -> tuple[NDArray[_Number], _Integers]:
    """Parse the numbers of some lines; return them, and how many each line has.

    Args:
        lines: All lines.
        which: (L,) which of them have numbers.
        dropped: What is no number in them.
        dtype: The type of the numbers.
    """
    lengths = lines.ends - lines.starts + 1
    characters = lines.characters[np.repeat(which, lengths)]
    lengths = lengths[which]
    characters[np.cumsum(lengths) - lengths] = ord(" ")  # the statements
    # Only what is no number needs a regular expression; numpy parses all numbers at
    # once, and the words are counted to find out which line each belongs to.
    text = dropped.sub(b"", characters.tobytes())
    characters = np.frombuffer(b" " + text, dtype=np.uint8)
    is_blank = characters <= ord(" ")
    words = np.cumsum(is_blank[:-1] & ~is_blank[1:])
    totals = words[characters[1:] == ord("\n")]
    numbers = np.zeros(0, dtype=dtype)
    with warnings.catch_warnings(), suppress(ValueError, DeprecationWarning):
        # Older versions of numpy only warn of what is no number.
        warnings.simplefilter("error", DeprecationWarning)
        numbers = np.fromstring(text, dtype=dtype, sep=" ")
    if len(numbers) != totals.max(initial=0):
        kind = "a whole number" if dtype is np.int64 else "a number"
        raise ValueError(f"a line has something else where {kind} is expected")
    return numbers, np.diff(totals, prepend=0)


def _vertices(numbers: Floats, counts: _Integers) -> Floats:
    """Return the vertices, (V, 3); what follows the coordinates does not matter."""
    if (counts < 3).any():
        raise ValueError("a vertex does not have three coordinates")
    firsts = np.cumsum(counts) - counts
    vertices: Floats = numbers[firsts[:, None] + np.arange(3)]
    check_vertices(vertices)
    return vertices


def _resolve(numbers: _Integers, above: _Integers, count: int) -> Faces:
    """Return the vertex index of corners.

    Args:
        numbers: The numbers in the file, from 1, or from -1 backwards.
        above: For each corner, how many vertices are above it in the file.
        count: How many vertices there are.
    """
    indices = np.where(numbers < 0, above + numbers, numbers - 1)
    if indices.size and not 0 <= indices.min() <= indices.max() < count:
        raise ValueError("a face names a vertex that is not there")
    return indices.astype(np.int32)


def _fans(counts: _Integers, triangles: _Integers) -> _Integers:
    """Return the triangles of polygons, (T, 3) indices of corners.

    Args:
        counts: How many corners each polygon has.
        triangles: How many triangles each has.
    """
    polygons = np.repeat(np.arange(len(counts)), triangles)
    first = (np.cumsum(counts) - counts)[polygons]
    number = np.arange(len(polygons)) - (np.cumsum(triangles) - triangles)[polygons]
    fans = np.column_stack([first, first + number + 1, first + number + 2])
    # Which corner is first changes the last digit of where a beam hits; in the second
    # half of a quadrangle it has always been the third.
    second_half = (counts[polygons] == 4) & (number == 1)
    fans[second_half] = np.roll(fans[second_half], -1, axis=1)
    return fans


def _owners(lines: _Lines, polygons: _Integers) -> tuple[list[str], _Integers]:
    """Return the material of each piece, and the number of each polygon's piece.

    Args:
        lines: All lines.
        polygons: The numbers of the lines of polygons.
    """
    objects, materials = (np.flatnonzero(lines.are(s)) for s in (b"o", b"usemtl"))
    above = np.searchsorted(objects, polygons), np.searchsorted(materials, polygons)
    count = len(materials) + 1
    pairs, inverse = np.unique(above[0] * count + above[1], return_inverse=True)
    expect_at_most(len(pairs), MAX_CHANGES, "changes of object or material")
    pieces: dict[tuple[str, str], int] = {}
    numbers = np.zeros(len(pairs), dtype=np.int64)
    for i, pair in enumerate(pairs.tolist()):
        object_, material = divmod(pair, count)
        names = _name(lines, objects, object_), _name(lines, materials, material)
        numbers[i] = pieces.setdefault(names, len(pieces))
    expect_at_most(len(pieces), MAX_SURFACES, "objects and materials")
    return [material for _, material in pieces], numbers[inverse]


def _name(lines: _Lines, statements: _Integers, number: int) -> str:
    """Return the name in a statement, counted from 1; empty for 0."""
    return lines.argument(int(statements[number - 1])) if number else ""


def _group(owners: _Integers) -> Iterator[tuple[int, _Integers]]:
    """Yield owners and the indices of what they own; what begins last is first."""
    order = np.argsort(owners, kind="stable")
    numbers, firsts = np.unique(owners[order], return_index=True)
    groups = np.split(order, firsts[1:])
    # parts of a scene are in this order, and what refers to them by number
    for index in np.argsort(order[firsts])[::-1].tolist():
        yield int(numbers[index]), groups[index]


def _select(vertices: Floats, faces: Faces) -> tuple[Floats, Faces]:
    """Return faces with the vertices that they have, and with few others."""
    if faces.size >= len(vertices):  # most are used, and sorting would take longer
        return vertices, faces
    used, renamed = np.unique(faces, return_inverse=True)
    return vertices[used], renamed.reshape(-1, 3).astype(np.int32)
