"""Read triangles and material names from mesh files.

trimesh parses STL and PLY; it is imported at the first file, because the import takes
longer than everything else that loading a map of primitives does. It gets bytes and
never a path, and only files whose counts have been checked. Files that a mesh file
refers to are read only from inside of the map's folder. These are the buffers of a glTF
file: textures do not matter here, and of an OBJ file's material library only the names
do, which the OBJ file itself contains. OBJ files are read here, since trimesh takes
seconds where polygons have different numbers of corners, and reads comments after a
statement and corners counted from the end wrongly.
"""

import io
import warnings
from array import array
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np

from radarsim.geometry import Floats
from radarsim.scene.gltf import GltfFile
from radarsim.scene.mesh_files import (
    MAX_SURFACES,
    MeshBudget,
    MeshError,
    MeshFiles,
    check_ply,
    check_stl,
    check_vertices,
    expect_at_most,
)
from radarsim.scene.shapes import Mesh, Surface, concatenate
from radarsim.scene.topology import (
    connect_faces,
    count_degenerate,
    orient_outward,
    weld_vertices,
)

_Number = TypeVar("_Number", float, int)

SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")
MAX_LINES: Final = 5_000_000  # of an OBJ file
_BOM: Final = b"\xef\xbb\xbf"


def read_surfaces(
    path: Path, folder: Path, budget: MeshBudget | None = None
) -> list[Surface]:
    """Read the surfaces of a mesh file, the transforms of its scene graph applied.

    Args:
        path: A file that `mesh_files.find_inside` has returned.
        folder: The folder that must contain all files that this one refers to, links
            resolved.
        budget: What the files may contain, with others of the map; None for all.

    Raises:
        MeshError: If the file is broken or too large, or contains no triangles.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise MeshError(f"{path.name!r}, expected one of {list(SUFFIXES)}")
    files = MeshFiles(path.parent, folder, budget or MeshBudget())
    try:
        surfaces = _read(files.read(path), suffix, files)
    except MeshError as error:
        raise MeshError(f"{path.name!r}: {error}") from error
    except MemoryError as error:
        raise MeshError(f"{path.name!r}: too large") from error
    except Exception as error:  # broken files make parsers raise anything
        file_type = suffix[1:].upper()
        text = f"{path.name!r}: cannot be read as {file_type}: {_reason(error)}"
        raise MeshError(text) from error
    if not surfaces:
        raise MeshError(f"{path.name!r}: no triangles")
    return surfaces


def join_volume(surfaces: list[Surface]) -> Mesh:
    """Join surfaces into one mesh that encloses volumes, oriented outward.

    Surfaces that are closed by themselves stay separate, even where they touch; the
    others are welded together where their vertices coincide.

    Args:
        surfaces: Each of them welded by itself.

    Raises:
        MeshError: If the mesh is open, or parts of it enclose nothing, see `topology`.
    """
    vertices, faces = concatenate(_weld(surfaces))
    doubled, flat = count_degenerate(vertices, faces)
    if doubled:
        text = "faces are present in both orientations, with nothing inside"
        raise MeshError(f"{doubled} {text}")
    if flat:
        raise MeshError(f"{flat} faces enclose no volume, as two-sided sheets")
    return vertices, faces


def join_surfaces(surfaces: list[Surface]) -> Mesh:
    """Join surfaces into one mesh as they are; closed ones are oriented outward.

    Args:
        surfaces: Each of them welded by itself.
    """
    try:
        return concatenate(_weld(surfaces))
    except MeshError:
        return concatenate([surface[1:] for surface in surfaces])


def _weld(surfaces: list[Surface]) -> list[Mesh]:
    """Orient the closed surfaces, and weld the others into one that has to be closed.

    Raises:
        MeshError: If that one is open.
    """
    # Surfaces that are closed alone are not welded to others: two boxes that touch
    # would become one with a wall inside, which encloses nothing.
    closed: list[Mesh] = []
    remaining: list[Mesh] = []
    for _, vertices, faces in surfaces:
        oriented = orient_outward(vertices, faces)
        if oriented is None:
            remaining.append((vertices, faces))
        else:
            closed.append((vertices, oriented))
    if remaining:
        vertices, faces = remaining[0]
        if len(remaining) > 1:
            vertices, faces = weld_vertices(*concatenate(remaining))
        oriented = orient_outward(vertices, faces)
        if oriented is None:
            count = connect_faces(faces).open_edges
            raise MeshError(f"not closed: {count} edges have no partner")
        closed.append((vertices, oriented))
    return closed


def _read(content: bytes, suffix: str, files: MeshFiles) -> list[Surface]:
    """Read the surfaces in the content of a file."""
    if suffix == ".obj":
        return read_obj(content, files.budget)
    if suffix in (".glb", ".gltf"):
        with np.errstate(all="ignore"):  # what overflows is refused
            file = GltfFile(content, suffix, files)
            found = [_surface(*each) for each in file.surfaces()]
        return [surface for surface in found if surface is not None]
    # Parsers allocate what a header counts, and spend seconds on each of many small
    # pieces, so a file of a few hundred bytes is counted before they get it.
    check = check_ply if suffix == ".ply" else check_stl
    content = check(content, files.budget)
    import trimesh  # noqa: PLC0415 - slow, see above

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        scene = trimesh.load_scene(
            io.BytesIO(content),
            file_type=suffix[1:],
            process=False,
            skip_materials=True,
        )
    surfaces = (_node_surface(scene, node) for node in scene.graph.nodes_geometry)
    return [surface for surface in surfaces if surface is not None]


def _reason(error: BaseException) -> str:
    """Return one line that says why a file cannot be read.

    If parsing fails, trimesh tries another format, another file, or a module that
    guesses the encoding, and these fail last: the first error is the reason.
    """
    consequences = (ImportError, OSError, UnicodeError)
    while isinstance(error, consequences) and error.__context__ is not None:
        error = error.__context__
    text = f"no {error}" if isinstance(error, KeyError) else str(error)
    return (text.splitlines() or [type(error).__name__])[0][:120]


def _node_surface(scene: Any, node: str) -> Surface | None:
    matrix, name = scene.graph[node]
    geometry = scene.geometry[name]
    faces = np.asarray(getattr(geometry, "faces", ()))
    return _surface(None, np.asarray(geometry.vertices, np.float64), faces, matrix)


def _surface(
    material: str | None, vertices: Floats, faces: Any, matrix: Any
) -> Surface | None:
    """Return placed triangles; None for points and lines."""
    faces = faces.reshape(-1, 3)
    if not len(faces):
        return None
    matrix = np.array(matrix, dtype=np.float64)
    if not np.array_equal(matrix, np.eye(4)):
        vertices = vertices @ matrix[:3, :3].T + matrix[:3, 3]
    _check_corners(faces, len(vertices))
    check_vertices(vertices)
    if np.linalg.det(matrix[:3, :3]) < 0:  # mirroring inverts the orientation
        faces = faces[:, ::-1]
    return Surface(material or None, vertices, faces.astype(np.int32))


def read_obj(content: bytes, budget: MeshBudget) -> list[Surface]:
    """Read the pieces of an OBJ file; the one that begins last is the first.

    The format has one statement in a line. ``v x y z`` adds a vertex. ``f 3 4 5 6``
    adds a polygon; corners count the vertices of the file from 1, or backwards from -1,
    the last one above the line. What follows a corner after a slash is a texture or a
    normal. ``o`` and ``usemtl`` name the object and the material of the polygons below.

    Args:
        content: The file.
        budget: What the file may contain.

    Raises:
        MeshError: If it is too long, or has too many lines, triangles or pieces.
        ValueError: If it is broken.
    """
    budget.take(len(content), "bytes of text")
    text = content.removeprefix(_BOM).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    expect_at_most(text.count(b"\n"), MAX_LINES, "lines")
    coordinates = array("d")
    pieces: dict[tuple[str, str], array[int]] = {}  # corners by object and material
    names = {b"o": "", b"usemtl": ""}
    for line in io.BytesIO(text.replace(b"\\\n", b" ")):  # a line goes on after these
        statement, *words = line.partition(b"#")[0].split() or [b""]
        if statement == b"v" and words:
            numbers = _parse(float, words, "a number")
            if len(numbers) < 3:
                raise ValueError("a vertex does not have three coordinates")
            coordinates.extend(numbers[:3])
        elif statement == b"f" and len(words) > 2:
            budget.take(len(words) - 2, "triangles")
            firsts = [word.partition(b"/")[0] for word in words]
            above = len(coordinates) // 3
            corners = [
                above + each if each < 0 else each - 1
                for each in _parse(int, firsts, "a whole number")
            ]
            piece = pieces.setdefault((names[b"o"], names[b"usemtl"]), array("q"))
            expect_at_most(len(pieces), MAX_SURFACES, "objects and materials")
            piece.extend(corners[:3])
            if len(corners) == 4:
                # Which corner is first changes the last digit of where a beam hits; in
                # the second half of a quadrangle it has always been the third.
                piece.extend((corners[2], corners[3], corners[0]))
                continue
            for second, third in pairwise(corners[2:]):
                piece.extend((corners[0], second, third))
        elif statement in names and words:  # what looks like a comment is of the name
            names[statement] = " ".join(line.decode("utf-8", "replace").split()[1:])
    vertices = np.array(coordinates).reshape(-1, 3)
    check_vertices(vertices)
    # Parts of a scene are in this order, and what refers to them by number.
    return [
        Surface(material or None, *_select(vertices, np.array(corners).reshape(-1, 3)))
        for (_, material), corners in reversed(pieces.items())
    ]


def _parse(
    kind: Callable[[bytes], _Number], words: list[bytes], what: str
) -> list[_Number]:
    try:
        return [kind(word) for word in words]
    except ValueError:
        text = f"a line has something else where {what} is expected"
        raise ValueError(text) from None


def _select(vertices: Floats, faces: Any) -> Mesh:
    """Return faces with the vertices that they have, and with few others."""
    _check_corners(faces, len(vertices))
    if faces.size >= len(vertices):  # most are used, and sorting would take longer
        return vertices, faces.astype(np.int32)
    used, renamed = np.unique(faces, return_inverse=True)
    return vertices[used], renamed.reshape(-1, 3).astype(np.int32)


def _check_corners(faces: Any, count: int) -> None:
    if not 0 <= faces.min() <= faces.max() < count:
        raise ValueError("a face refers to a vertex that does not exist")
