"""Read triangles and material names from mesh files.

trimesh parses the formats; it is imported at the first file, because the import takes
longer than everything else that loading a map of primitives does. It gets bytes and
never a path: files that a mesh file refers to are read on its behalf, and only from
inside of the map's folder. These are the buffers of a glTF file: textures do not matter
here, and of an OBJ file's material library only the names do, which the OBJ file itself
contains.
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
from radarsim.scene.shapes import Faces, Mesh, concatenate
from radarsim.scene.topology import (
    count_degenerate,
    count_open_edges,
    orient_outward,
    weld_vertices,
)
from radarsim.validation import short_repr

SUFFIXES = (".glb", ".gltf", ".obj", ".ply", ".stl")

_OPTIONS: dict[str, dict[str, Any]] = {
    ".obj": {"split_objects": True},
    ".ply": {"skip_materials": True},
}
_MATERIAL_LIBRARY = "names.mtl"
_FALLBACK_HEADER = "model.gltf"  # trimesh asks for it if a glTF file is broken
_TEXTURES = (".bmp", ".gif", ".jpeg", ".jpg", ".ktx2", ".png", ".tga", ".webp")


class MeshError(Exception):
    """A mesh file cannot be used; the message says why."""


@dataclass(frozen=True, eq=False)
class Surface:
    """One piece of a mesh file, in the frame of the file.

    Attributes:
        material: The name of its material in the file, if it has one.
        vertices: (V, 3) in the file's unit.
        faces: (F, 3) vertex indices.
    """

    material: str | None
    vertices: Floats
    faces: Faces

    @property
    def mesh(self) -> Mesh:
        """The vertices and the faces."""
        return self.vertices, self.faces


def find_inside(folder: Path, start: Path, reference: str) -> Path:
    """Resolve a reference to a file, following symbolic links.

    Args:
        folder: The folder that must contain the file, links resolved.
        start: The folder that the reference is relative to.
        reference: A relative path.

    Raises:
        MeshError: If it leads out of the folder, or there is no such file.
    """
    text = short_repr(reference)
    try:
        path = (start / reference).resolve()
        exists = path.is_file()
    except (OSError, RuntimeError, ValueError) as error:  # loops, NUL, endless names
        raise MeshError(f"{text}, expected the path of a file") from error
    if not path.is_relative_to(folder):
        raise MeshError(f"{text}, expected a file in the map's own folder")
    if not exists:
        raise MeshError(f"{text}, expected an existing file")
    return path


def read_surfaces(path: Path, folder: Path) -> list[Surface]:
    """Read the surfaces of a mesh file, the transforms of its scene graph applied.

    Args:
        path: A file that `find_inside` has returned.
        folder: The folder that must contain all files that this one refers to, links
            resolved.

    Raises:
        MeshError: If the file is broken, or contains no triangles.
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
    except Exception as error:  # broken files make parsers raise anything
        file_type = suffix[1:].upper()
        text = f"{path.name!r}: cannot be read as {file_type}: {_reason(error)}"
        raise MeshError(text) from error
    with_faces = [surface for surface in surfaces if surface is not None]
    if not with_faces:
        raise MeshError(f"{path.name!r}: no triangles")
    return with_faces


def join_volume(surfaces: list[Surface]) -> Mesh:
    """Join surfaces into one mesh that encloses volumes, oriented outward.

    Surfaces that are closed by themselves stay separate, even where they touch; the
    others are welded together where their vertices coincide.

    Raises:
        MeshError: If the mesh is open, or parts of it enclose nothing, see `topology`.
    """
    vertices, faces = _weld(surfaces)
    doubled, flat = count_degenerate(vertices, faces)
    if doubled:
        text = "faces are present in both orientations, with nothing inside"
        raise MeshError(f"{doubled} {text}")
    if flat:
        raise MeshError(f"{flat} faces enclose no volume, as sheets with two sides")
    return vertices, faces


def join_surfaces(surfaces: list[Surface]) -> Mesh:
    """Join surfaces into one mesh as they are; closed ones are oriented outward."""
    try:
        return _weld(surfaces)
    except MeshError:
        return concatenate([weld_vertices(*surface.mesh) for surface in surfaces])


def _weld(surfaces: list[Surface]) -> Mesh:
    closed: list[Mesh] = []
    remaining: list[Mesh] = []
    for surface in surfaces:
        vertices, faces = weld_vertices(*surface.mesh)
        oriented = orient_outward(vertices, faces)
        if oriented is None:
            remaining.append((vertices, faces))
        else:
            closed.append((vertices, oriented))
    if remaining:
        vertices, faces = weld_vertices(*concatenate(remaining))
        oriented = orient_outward(vertices, faces)
        if oriented is None:
            count = count_open_edges(faces)
            raise MeshError(f"not closed: {count} edges have no partner")
        closed.append((vertices, oriented))
    return concatenate(closed)


class _References:
    """Resolver that trimesh asks for the files that a mesh file refers to."""

    file_name = None

    def __init__(self, start: Path, folder: Path) -> None:
        self._start = start
        self._folder = folder
        self._virtual: dict[str, bytes] = {}

    def add(self, name: str, content: bytes) -> None:
        """Add a virtual file, which hides one of that name on the disk."""
        self._virtual[name] = content

    def get(self, name: str) -> bytes:
        """Return the bytes of a file."""
        if name in self._virtual:
            return self._virtual[name]
        if name == _FALLBACK_HEADER or name.lower().endswith(_TEXTURES):
            raise FileNotFoundError(name)
        return find_inside(self._folder, self._start, unquote(name)).read_bytes()

    __getitem__ = get


def _content(path: Path, suffix: str, references: _References) -> bytes:
    """Read a file; give an OBJ file a virtual library of its materials' names."""
    content = path.read_bytes()
    if suffix != ".obj":
        return content
    text = re.sub(r"(?m)^\s*mtllib.*$", "", content.decode("utf-8", "replace"))
    names = dict.fromkeys(re.findall(r"(?m)^\s*usemtl[ \t]+(.*\S)", text))
    library = "".join(f"newmtl {name}\nKd 1 1 1\n" for name in names)
    references.add(_MATERIAL_LIBRARY, library.encode())
    return f"mtllib {_MATERIAL_LIBRARY}\n{text}".encode()


def _load(content: bytes, suffix: str, references: Any) -> Any:
    import trimesh  # noqa: PLC0415 - slow, see above

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
    """Return one line that says why a file cannot be read.

    If parsing fails, trimesh tries another format, another file, or a module that
    guesses the encoding, and these fail last: the first error is the reason.
    """
    consequences = (ImportError, OSError, UnicodeError)
    while isinstance(error, consequences) and error.__context__ is not None:
        error = error.__context__
    text = f"no {error}" if isinstance(error, KeyError) else str(error)
    return (text.splitlines() or [type(error).__name__])[0][:120]


def _surface(scene: Any, node: str) -> Surface | None:
    """Return a node's triangles; None for points and lines."""
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
    if np.linalg.det(matrix[:3, :3]) < 0:  # mirroring inverts the orientation
        faces = faces[:, ::-1]
    material = getattr(getattr(geometry.visual, "material", None), "name", None)
    return Surface(material or None, vertices, faces.astype(np.int32))
