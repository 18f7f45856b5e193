"""Triangles and material names out of mesh files.

trimesh reads the formats; it is imported at the first file, because that takes longer
than everything else that loading a map of primitives does. It gets bytes and never a
path: what a mesh file refers to is read for it, from inside the map's folder alone.
Only a glTF file's buffers are: pictures do not matter here, and of an OBJ file's
material library only the names do, which stand in the OBJ file itself.
"""

import io
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from radarsim.geometry import Floats
from radarsim.scene.shapes import Faces
from radarsim.scene.topology import (
    count_empty,
    count_open_edges,
    orient_outward,
    weld_vertices,
)

SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")

_OPTIONS: dict[str, dict[str, Any]] = {
    ".obj": {"split_objects": True},
    ".ply": {"skip_materials": True},
}
_LIBRARY = "names.mtl"
_OTHER_HEADER = "model.gltf"  # asked for in place of a glTF file that is broken
_PICTURES = (".bmp", ".gif", ".jpeg", ".jpg", ".ktx2", ".png", ".tga", ".webp")


class MeshError(Exception):
    """A mesh file cannot be used; the text says why."""


@dataclass(frozen=True, eq=False)
class Surface:
    """One piece of a mesh file, in the frame of the file.

    Attributes:
        material: The name of its material in the file, None where it has none.
        vertices: (V, 3) in the file's unit.
        faces: (F, 3) rows of vertex numbers.
    """

    material: str | None
    vertices: Floats
    faces: Faces


def find_inside(folder: Path, start: Path, reference: str) -> Path:
    """Find the file that a reference names, following symbolic links.

    Args:
        folder: Where the file must lie, links resolved.
        start: The folder that the reference starts from.
        reference: A relative path.

    Raises:
        MeshError: If it leads out of the folder, or there is no such file.
    """
    cut = repr(reference)[:80]
    try:
        path = (start / reference).resolve()
        there = path.is_file()
    except (OSError, RuntimeError, ValueError) as error:  # loops, NUL, endless names
        raise MeshError(f"{cut}, expected the path of a file") from error
    if not path.is_relative_to(folder):
        raise MeshError(f"{cut}, expected a file in the map's own folder")
    if not there:
        raise MeshError(f"{cut}, expected an existing file")
    return path


def read_surfaces(path: Path, folder: Path) -> list[Surface]:
    """Read the surfaces of a mesh file, the transforms of its scene graph applied.

    Args:
        path: A file that find_inside has found.
        folder: Where the files must lie that this one refers to, links resolved.

    Raises:
        MeshError: If the file is broken, or holds no triangles.
    """
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise MeshError(f"{path.name!r}, expected one of {list(SUFFIXES)}")
    references = _References(path.parent, folder)
    try:
        scene = _load(_content(path, suffix, references), suffix, references)
        surfaces = [_surface(scene, node) for node in scene.graph.nodes_geometry]
    except MeshError as error:
        raise MeshError(f"{path.name!r}: refers to {error}") from error
    except MemoryError as error:
        raise MeshError(f"{path.name!r}: too large") from error
    except Exception as error:  # broken files make loaders stumble in every way
        kind = suffix[1:].upper()
        text = f"{path.name!r}: cannot be read as {kind}: {_reason(error)}"
        raise MeshError(text) from error
    whole = [surface for surface in surfaces if surface is not None]
    if not whole:
        raise MeshError(f"{path.name!r}: no triangles")
    return whole


def join_volume(surfaces: list[Surface]) -> tuple[Floats, Faces]:
    """Join surfaces into one mesh that encloses volumes, wound outward.

    Surfaces that are closed by themselves stay apart from each other, even where they
    touch; the others are sewn together where their vertices coincide.

    Raises:
        MeshError: If they stay open, or have nothing inside, see emptiness.py.
    """
    vertices, faces = _sewn(surfaces)
    twice, flat = count_empty(vertices, faces)
    if twice:
        text = "faces stand there twice, once each way round, with nothing inside"
        raise MeshError(f"{twice} {text}")
    if flat:
        raise MeshError(f"{flat} faces enclose no volume, as sheets with two sides")
    return vertices, faces


def _sewn(surfaces: list[Surface]) -> tuple[Floats, Faces]:
    closed: list[tuple[Floats, Faces]] = []
    rest: list[tuple[Floats, Faces]] = []
    for surface in surfaces:
        vertices, faces = weld_vertices(surface.vertices, surface.faces)
        turned = orient_outward(vertices, faces)
        if turned is None:
            rest.append((vertices, faces))
        else:
            closed.append((vertices, turned))
    if rest:
        vertices, faces = weld_vertices(*_stack(rest))
        turned = orient_outward(vertices, faces)
        if turned is None:
            count = count_open_edges(faces)
            raise MeshError(f"not closed: {count} edges have no partner")
        closed.append((vertices, turned))
    return _stack(closed)


def join_surfaces(surfaces: list[Surface]) -> tuple[Floats, Faces]:
    """Join surfaces into one mesh as they are; closed ones are wound outward."""
    try:
        return _sewn(surfaces)
    except MeshError:
        return _stack([weld_vertices(each.vertices, each.faces) for each in surfaces])


class _References:
    """What trimesh asks for the files that a mesh file refers to."""

    file_name = None

    def __init__(self, start: Path, folder: Path) -> None:
        self._start = start
        self._folder = folder
        self._made: dict[str, bytes] = {}

    def make(self, name: str, content: bytes) -> None:
        """Let a name stand for this content, whatever is on the disk."""
        self._made[name] = content

    def get(self, name: str) -> bytes:
        """Give the bytes of a file."""
        if name in self._made:
            return self._made[name]
        if name == _OTHER_HEADER or name.lower().endswith(_PICTURES):
            raise FileNotFoundError(name)
        return find_inside(self._folder, self._start, unquote(name)).read_bytes()

    __getitem__ = get


def _content(path: Path, suffix: str, references: _References) -> bytes:
    """Read a file; an OBJ file gets a library that has just the names of materials."""
    content = path.read_bytes()
    if suffix != ".obj":
        return content
    text = re.sub(r"(?m)^\s*mtllib.*$", "", content.decode("utf-8", "replace"))
    names = dict.fromkeys(re.findall(r"(?m)^\s*usemtl[ \t]+(.*\S)", text))
    library = "".join(f"newmtl {name}\nKd 1 1 1\n" for name in names)
    references.make(_LIBRARY, library.encode())
    return f"mtllib {_LIBRARY}\n{text}".encode()


def _load(content: bytes, suffix: str, references: Any) -> Any:
    import trimesh  # noqa: PLC0415 - see above

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return trimesh.load_scene(
            io.BytesIO(content),
            file_type=suffix[1:],
            resolver=references,
            process=False,
            **_OPTIONS.get(suffix, {}),
        )


def _reason(error: BaseException) -> str:
    """Say in one line why a file cannot be read.

    Where that fails, trimesh tries another format, another file, or a module that
    guesses the encoding, and it is that which fails last: the first error counts.
    """
    second = (ImportError, OSError, UnicodeError)
    while isinstance(error, second) and error.__context__ is not None:
        error = error.__context__
    text = f"no {error}" if isinstance(error, KeyError) else str(error)
    return (text.splitlines() or [type(error).__name__])[0][:120]


def _surface(scene: Any, node: str) -> Surface | None:
    """Give a node's triangles; None for points and lines."""
    matrix, name = scene.graph[node]
    geometry = scene.geometry[name]
    faces = np.array(getattr(geometry, "faces", ()), dtype=np.int64).reshape(-1, 3)
    if not len(faces):
        return None
    matrix = np.array(matrix, dtype=np.float64)
    local = np.array(geometry.vertices, dtype=np.float64)
    vertices = local @ matrix[:3, :3].T + matrix[:3, 3]
    if not 0 <= faces.min() <= faces.max() < len(vertices):
        raise ValueError("a face names a vertex that is not there")
    if not np.isfinite(vertices).all():
        raise ValueError("a vertex is not finite")
    if np.linalg.det(matrix[:3, :3]) < 0:  # a mirror turns faces round
        faces = faces[:, ::-1]
    material = getattr(getattr(geometry.visual, "material", None), "name", None)
    return Surface(material or None, vertices, faces.astype(np.int32))


def _stack(meshes: list[tuple[Floats, Faces]]) -> tuple[Floats, Faces]:
    """Put meshes into one, each with vertices of its own."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    moved = [faces + start for (_, faces), start in zip(meshes, starts, strict=False)]
    vertices = np.vstack([vertices for vertices, _ in meshes])
    return vertices, np.vstack(moved).astype(np.int32)
