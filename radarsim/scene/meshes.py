"""Read triangles and material names from mesh files.

trimesh parses STL and PLY. It is imported when the first such file is read, because the
import takes longer than loading a map of primitives. trimesh receives bytes, never a
path, and only after the counts of the file have been checked. Files that a mesh file
refers to must be in the map's folder; only the buffers of glTF files are read. Textures
are ignored, and so is the material library of an OBJ file, since the OBJ file contains
the material names. This module parses OBJ itself, since trimesh takes seconds if
polygons have different numbers of corners, and misreads comments after a statement and
negative vertex indices.
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
MAX_LINES: Final = 5_000_000  # lines of an OBJ file
_BOM: Final = b"\xef\xbb\xbf"


def read_surfaces(
    path: Path, folder: Path, budget: MeshBudget | None = None
) -> list[Surface]:
    """Read the surfaces of a mesh file and apply the transforms of its scene graph.

    Args:
        path: A file that `mesh_files.find_inside` has returned.
        folder: The folder that must contain all referenced files, links resolved.
        budget: Counters of all mesh files of the map; None for new ones.

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
        raise MeshError(f"{path.name!r}: too large for the memory") from error
    except Exception as error:  # Parsers raise any exception if a file is broken.
        file_type = suffix[1:].upper()
        text = f"{path.name!r}: cannot be read as {file_type}: {_reason(error)}"
        raise MeshError(text) from error
    if not surfaces:
        raise MeshError(f"{path.name!r} has no triangles")
    return surfaces


def join_volume(surfaces: list[Surface]) -> Mesh:
    """Join surfaces into one mesh that encloses volumes, oriented outward.

    Closed surfaces stay separate, even where they touch; open surfaces are welded
    together where their vertices coincide.

    Args:
        surfaces: The surfaces; the vertices of each are already welded.

    Raises:
        MeshError: If the mesh is open, or parts of it enclose nothing, see `topology`.
    """
    vertices, faces = concatenate(_weld(surfaces))
    doubled, flat = count_degenerate(vertices, faces)
    if doubled:
        text = "faces occur in both orientations and enclose no volume"
        raise MeshError(f"{doubled} {text}")
    if flat:
        raise MeshError(f"{flat} faces are two-sided sheets that enclose no volume")
    return vertices, faces


def join_surfaces(surfaces: list[Surface]) -> Mesh:
    """Join surfaces into one mesh; if the mesh is closed, it is oriented outward.

    Args:
        surfaces: The surfaces; the vertices of each are already welded.
    """
    try:
        return concatenate(_weld(surfaces))
    except MeshError:
        return concatenate([surface[1:] for surface in surfaces])


def _weld(surfaces: list[Surface]) -> list[Mesh]:
    """Orient closed surfaces outward, and weld open surfaces into one closed mesh.

    Raises:
        MeshError: If the welded surface is still open.
    """
    # Closed surfaces are not welded to others: two boxes that touch would become one
    # box with a wall inside, which encloses nothing.
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
            raise MeshError(f"not closed: {count} unmatched edges")
        closed.append((vertices, oriented))
    return closed


def _read(content: bytes, suffix: str, files: MeshFiles) -> list[Surface]:
    """Read the surfaces in the content of a file."""
    if suffix == ".obj":
        return read_obj(content, files.budget)
    if suffix in (".glb", ".gltf"):
        with np.errstate(all="ignore"):  # `check_vertices` refuses overflows.
            file = GltfFile(content, suffix, files)
            found = [_surface(*each) for each in file.surfaces()]
        return [surface for surface in found if surface is not None]
    # The counts are checked before parsing, since parsers allocate memory for the
    # counts in a header and need seconds for files of many small pieces.
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
    """Return the reason why a file cannot be read, as one line.

    If parsing fails, trimesh tries another format, another file, or a module that
    guesses the encoding. These attempts fail too, so the first error is the reason.
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
    """Return the transformed triangles of a node; None for points and lines."""
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
    """Read an OBJ file as one surface per object and material, in reverse file order.

    The format has one statement per line. ``v x y z`` adds a vertex. ``f 3 4 5 6``
    adds a polygon of vertex indices, which count from 1, or from -1 backwards, where -1
    is the last vertex so far. Indices of textures and normals follow after slashes.
    ``o`` and ``usemtl`` name the object and the material of the polygons that follow.

    Args:
        content: Bytes of the file.
        budget: Counters of all mesh files of the map.

    Raises:
        MeshError: If it is too long, or has too many lines, triangles or pieces.
        ValueError: If a line is invalid.
    """
    budget.take(len(content), "bytes of text")
    text = content.removeprefix(_BOM).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    expect_at_most(text.count(b"\n"), MAX_LINES, "lines")
    coordinates = array("d")
    pieces: dict[tuple[str, str], array[int]] = {}  # corners by object and material
    names = {b"o": "", b"usemtl": ""}
    for line in io.BytesIO(text.replace(b"\\\n", b" ")):  # "\" continues a line
        statement, *words = line.partition(b"#")[0].split() or [b""]
        if statement == b"v" and words:
            numbers = _parse(float, words, "a number")
            if len(numbers) < 3:
                raise ValueError("a vertex has fewer than three coordinates")
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
                # The second triangle of a quad begins at the third corner; another
                # first corner would change the last digit of hit distances.
                piece.extend((corners[2], corners[3], corners[0]))
                continue
            for second, third in pairwise(corners[2:]):
                piece.extend((corners[0], second, third))
        elif statement in names and words:  # A "#" is part of the name, not a comment.
            names[statement] = " ".join(line.decode("utf-8", "replace").split()[1:])
    vertices = np.array(coordinates).reshape(-1, 3)
    check_vertices(vertices)
    # The order of this list determines the numbers of the parts of a scene.
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
        text = f"a line has a wrong value, expected {what}"
        raise ValueError(text) from None


def _select(vertices: Floats, faces: Any) -> Mesh:
    """Return vertices and faces, without the unused vertices if these are many."""
    _check_corners(faces, len(vertices))
    if faces.size >= len(vertices):  # Most are used, so sorting is not worth its time.
        return vertices, faces.astype(np.int32)
    used, renamed = np.unique(faces, return_inverse=True)
    return vertices[used], renamed.reshape(-1, 3).astype(np.int32)


def _check_corners(faces: Any, count: int) -> None:
    if not 0 <= faces.min() <= faces.max() < count:
        raise ValueError("a face refers to a vertex that does not exist")
