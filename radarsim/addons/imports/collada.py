"""Reads the triangles of scenes in COLLADA files, with the package pycollada.

Source: the specification of COLLADA 1.4.1. As in Gazebo, ``unit`` is applied and
``up_axis`` is ignored: models in Gazebo worlds are upright without ``up_axis``.
"""

import io
import warnings
from typing import Any, Final
from xml.etree import ElementTree

import numpy as np

from radarsim.errors import MissingPackage, import_optional
from radarsim.geometry import Floats
from radarsim.scene.mesh_files import (
    MeshBudget,
    MeshError,
    check_vertices,
    expect_at_most,
)
from radarsim.scene.shapes import Mesh, concatenate

MAX_ELEMENTS: Final = 2_000_000
MAX_NODES: Final = 100_000
MAX_PROBLEMS: Final = 8  # number of errors that are reported per file
# Other elements, such as images and scripts, are removed before pycollada parses.
_READ: Final = ("library_geometries", "library_nodes", "library_visual_scenes", "scene")


class _TreeBuilder(ElementTree.TreeBuilder):
    """Builds a limited number of XML elements, and refuses document types."""

    def __init__(self) -> None:
        super().__init__()
        self._count = 0

    def start(self, tag: Any, attrs: Any, /) -> Any:
        self._count += 1
        expect_at_most(self._count, MAX_ELEMENTS, "elements")
        return super().start(tag, attrs)

    def doctype(self, *_: object) -> None:
        # Document types are refused. Their entities could expand to gigabytes, or
        # include the content of other files.
        raise MeshError("a DOCTYPE declaration, expected none")


def read_collada(content: bytes) -> tuple[list[tuple[str, Mesh]], list[str]]:
    """Read the triangles of the scene in a COLLADA file.

    Args:
        content: The file.

    Returns:
        The meshes, m, each with the name of its node, and the errors of parts of the
        file that are left out.

    Raises:
        MeshError: If the file is malformed or too large, or has no triangles.
        MissingPackage: If pycollada is not installed.
    """
    collada = import_optional("collada", "collada")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            # If a number is malformed, numpy only warns, and drops the rest of the
            # list. The warning is turned into an error here.
            warnings.filterwarnings("error", "string or file could not be read")
            return _read(content, collada)
    except (MeshError, MissingPackage):
        raise
    except MemoryError as error:
        raise MeshError("too large for the memory") from error
    except Exception as error:  # parsers of malformed files may raise any error
        reason = (str(error).splitlines() or [type(error).__name__])[0][:120]
        raise MeshError(f"cannot be read as COLLADA: {reason}") from error


def _read(content: bytes, collada: Any) -> tuple[list[tuple[str, Mesh]], list[str]]:
    parser = ElementTree.XMLParser(target=_TreeBuilder())
    parser.feed(content)
    root = parser.close()
    namespace = root.tag.removesuffix("COLLADA")
    unit = root.find(f"{namespace}asset/{namespace}unit")
    metres = 1.0 if unit is None else float(unit.get("meter", "1"))
    if not 0 < metres < np.inf:
        raise MeshError(f"a unit of {metres} m, expected more than 0")
    for child in list(root):
        if child.tag.removeprefix(namespace) not in _READ:
            root.remove(child)
    unread = [f"{namespace}instance_{each}" for each in ("camera", "light")]
    for node in root.iter(f"{namespace}node"):
        for child in [each for each in node if each.tag in unread]:
            node.remove(child)  # cameras and lights have no meshes
    for instance in root.iter(f"{namespace}instance_geometry"):
        del instance[:]  # remove references to materials, which were removed above
    for mesh in root.iter(f"{namespace}mesh"):
        _reduce_to_positions(mesh, namespace)
    # pycollada gets only XML that was checked above, since pycollada also unpacks zip
    # files, and may use another parser that accepts entities and other encodings.
    reduced = io.BytesIO(ElementTree.tostring(root))
    file = collada.Collada(reduced, ignore=[collada.DaeError])
    if file.scene is None:
        raise MeshError("no scene, expected <scene>")
    meshes = [
        (name, (vertices * metres, faces))
        for name, (vertices, faces) in _meshes(file.scene, collada)
    ]
    if not meshes:
        raise MeshError("no triangles")
    return meshes, [str(error)[:200] for error in file.errors[:MAX_PROBLEMS]]


def _reduce_to_positions(mesh: ElementTree.Element, namespace: str) -> None:
    """Remove normals, colours and textures, which are large and often wrong."""
    source = ""
    for vertices in mesh.findall(f"{namespace}vertices"):
        for each in list(vertices):
            if each.get("semantic") == "POSITION":
                source = each.get("source", "")
            else:
                vertices.remove(each)
    for each in mesh.findall(f"{namespace}source"):
        if f"#{each.get('id')}" != source:
            mesh.remove(each)
    for each in mesh.findall(f"*/{namespace}input"):
        if each.get("semantic") not in ("VERTEX", "POSITION"):
            # An ``input`` element has a column of indices, so it cannot be removed
            # alone. It is marked as a colour instead, because colours are never read.
            each.set("semantic", "COLOR")
            each.set("source", source)


def _meshes(scene: Any, collada: Any) -> list[tuple[str, Mesh]]:
    """Return the mesh of each geometry in a scene, in the file's unit of length."""
    found: list[tuple[str, Mesh]] = []
    budget, count = MeshBudget(), 0
    left = [("", np.eye(4), node) for node in reversed(scene.nodes)]
    while left:
        name, outer, node = left.pop()
        if isinstance(node, collada.scene.GeometryNode):
            pieces = [_triangles(each, collada) for each in node.geometry.primitives]
            vertices, faces = concatenate([_NOTHING, *pieces])
            budget.take(len(faces), "triangles")
            if len(faces):
                placed = vertices @ outer[:3, :3].T + outer[:3, 3]
                mirrored = np.linalg.det(outer[:3, :3]) < 0
                found.append((name, (placed, faces[:, ::-1] if mirrored else faces)))
        elif isinstance(node, collada.scene.Node):
            # If each node has two instances of the next node, the number of nodes
            # doubles at each level and could exceed the memory.
            count += len(node.children)
            expect_at_most(count, MAX_NODES, "nodes")
            own = getattr(node, "node", node).xmlnode.get("name", name)
            matrix = outer @ node.matrix
            left += [(own, matrix, child) for child in reversed(node.children)]
    return found


_NOTHING: Final[Mesh] = np.zeros((0, 3)), np.zeros((0, 3), np.int32)


def _triangles(primitive: Any, collada: Any) -> Mesh:
    """Return the triangles of a primitive of a geometry; lines have no triangles."""
    if isinstance(primitive, collada.polylist.Polylist):
        # The counts are checked first, because pycollada allocates memory for all
        # indices that the polygons declare.
        corners, said = len(primitive.index), int(primitive.vcounts.sum())
        if corners != said:
            raise MeshError(f"<vcount> counts {said} corners, expected {corners}")
        primitive = primitive.triangleset()
    if not isinstance(primitive, collada.triangleset.TriangleSet) or not len(primitive):
        return _NOTHING
    # All primitives share one array of vertices, so only the used vertices are kept.
    used, corner = np.unique(primitive.vertex_index, return_inverse=True)
    if used[0] < 0:
        raise MeshError(f"vertex index {used[0]}, expected at least 0")
    vertices: Floats = primitive.vertex[used].astype(np.float64)
    check_vertices(vertices)
    return vertices, corner.reshape(-1, 3).astype(np.int32)
