"""Read the triangles of glTF files, and check their counts.

A few hundred bytes of glTF can declare any number of values, share one buffer between
thousands of meshes, or build a chain of nodes that takes minutes to traverse. So the
data of the scene graph is counted before it is read, and no other data is read.

Source: the specification of glTF 2.0, and of the extension KHR_mesh_quantization.
"""

import base64
import binascii
import struct
from collections.abc import Iterator
from typing import Annotated, Any, Final, TypeAlias, TypeVar
from urllib.parse import unquote

import numpy as np
from annotated_types import Ge, Le, Len, MaxLen
from pydantic import BaseModel, FailFast, ValidationError
from pydantic_core import ErrorDetails

from radarsim.geometry import Floats
from radarsim.scene.mesh_files import (
    MAX_SURFACES,
    MAX_TRIANGLES,
    MeshError,
    MeshFiles,
    expect_at_most,
)
from radarsim.validation import describe_invalid, short_repr

MAX_JSON_BYTES: Final = 16 * 1024 * 1024
MAX_NODES: Final = 10_000
MAX_LEVELS: Final = 100  # levels of nested nodes
MAX_VERTICES: Final = 3 * MAX_TRIANGLES

_HEADER = struct.Struct("<4sII")  # magic, version, length
_CHUNK = struct.Struct("<I4s")  # length, type
_INDEX_TYPES: Final = {5121: "u1", 5123: "<u2", 5125: "<u4"}
_TYPES: Final = {5120: "i1", 5122: "<i2", 5126: "<f4", **_INDEX_TYPES}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6  # primitive modes; the others are lines and points
# Files that require any other extension are refused, since an extension could change
# the triangles.
_QUANTIZATION: Final = "KHR_mesh_quantization"
_EXTENSIONS_OF_LOOKS: Final = (
    *("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_"),
)

_Index: TypeAlias = Annotated[int, Ge(0)]
# Validation stops at the first wrong value, since a list of all errors could exhaust
# the memory.
_Numbers: TypeAlias = Annotated[list[float], FailFast()]
_Item = TypeVar("_Item")
_Items: TypeAlias = Annotated[list[_Item], MaxLen(MAX_NODES), FailFast()]


class _Object(BaseModel, extra="ignore"):
    """A JSON object; keys without a field here are ignored."""


_AnyObject = TypeVar("_AnyObject", bound=_Object)


class _Asset(_Object):
    version: str = "2.0"


class _Buffer(_Object):
    uri: str | None = None


class _BufferView(_Object):
    buffer: _Index
    byteOffset: _Index = 0  # noqa: N815 - the format's keys
    byteLength: _Index  # noqa: N815
    byteStride: Annotated[int, Ge(1), Le(252)] | None = None  # noqa: N815


class _Accessor(_Object):
    bufferView: _Index | None = None  # noqa: N815
    byteOffset: _Index = 0  # noqa: N815
    componentType: int  # noqa: N815
    count: _Index
    type: str
    normalized: bool = False
    sparse: object = None


class _Attributes(_Object):
    POSITION: _Index


class _Primitive(_Object):
    attributes: _Attributes
    indices: _Index | None = None
    material: _Index | None = None
    mode: int = 4


class _Mesh(_Object):
    primitives: Annotated[list[_Primitive], MaxLen(MAX_SURFACES), FailFast()]


class _Node(_Object):
    mesh: _Index | None = None
    children: _Items[_Index] = []
    matrix: Annotated[_Numbers, Len(16, 16)] = []
    translation: Annotated[_Numbers, Len(3, 3)] = []
    rotation: Annotated[_Numbers, Len(4, 4)] = []
    scale: Annotated[_Numbers, Len(3, 3)] = []


class _Roots(_Object):
    nodes: _Items[_Index] = []


class Material(_Object):
    """A material; ``extras`` is application-specific data of any type."""

    name: str | None = None
    extras: Any = None


class _Tree(_Object):
    """The keys of a glTF file's JSON that this module reads."""

    asset: _Asset = _Asset()
    extensionsRequired: Annotated[list[str], FailFast()] = []  # noqa: N815
    scene: _Index = 0
    scenes: _Items[_Roots] = []
    nodes: _Items[_Node] = []
    meshes: _Items[_Mesh] = []
    materials: _Items[Material] = []
    accessors: Annotated[list[_Accessor], MaxLen(10 * MAX_NODES), FailFast()] = []
    bufferViews: Annotated[list[_BufferView], MaxLen(10 * MAX_NODES), FailFast()] = []  # noqa: N815
    buffers: _Items[_Buffer] = []


class GltfFile:
    """A glTF file with parsed JSON; ``surfaces`` reads its triangles.

    Attributes:
        materials: All materials of the file.
    """

    def __init__(self, content: bytes, suffix: str, files: MeshFiles) -> None:
        """Parse the JSON of a file.

        Args:
            content: Bytes of the file.
            suffix: ``.glb`` or ``.gltf``.
            files: Reads buffers in other files, and counts triangles.

        Raises:
            MeshError: If the file is broken or too large, or requires an unknown
                extension.
        """
        text, self._binary = (
            _split_glb(content) if suffix == ".glb" else (content, None)
        )
        # The text is limited before parsing, since parsed objects take many times the
        # memory of their text.
        expect_at_most(len(text), MAX_JSON_BYTES, "bytes of JSON")
        try:
            self._tree = _Tree.model_validate_json(text)
        except ValidationError as error:
            raise MeshError(_describe(error.errors(include_url=False)[0])) from error
        version = self._tree.asset.version
        if version.partition(".")[0] != "2":
            raise MeshError(f"glTF version {version[:20]}, expected glTF 2")
        for name in self._tree.extensionsRequired:
            if name != _QUANTIZATION and not name.startswith(_EXTENSIONS_OF_LOOKS):
                needed = f"requires the extension {short_repr(name)}"
                raise MeshError(f"{needed}, expected only {_QUANTIZATION}")
        self.materials = self._tree.materials
        self._files = files
        self._buffers: dict[int, bytes | memoryview] = {}

    def surfaces(self) -> Iterator[tuple[str | None, Any, Any, Floats]]:
        """Yield material name, vertices, faces and matrix of each visible primitive.

        Raises:
            MeshError: If the file is broken, or exceeds a limit.
            OSError: If a buffer cannot be read.
        """
        count = vertices = 0
        for node, matrix in self._nodes():
            if node.mesh is None:
                continue
            for primitive in _item(self._tree.meshes, node.mesh, "mesh").primitives:
                if primitive.mode not in (_TRIANGLES, _STRIP, _FAN):
                    continue
                expect_at_most(count := count + 1, MAX_SURFACES, "surfaces")
                positions = self._accessor(primitive.attributes.POSITION, "VEC3")
                corners = positions.count
                expect_at_most(vertices := vertices + corners, MAX_VERTICES, "vertices")
                if primitive.indices is not None:
                    corners = self._accessor(primitive.indices, "SCALAR").count
                separate = primitive.mode == _TRIANGLES
                triangles = corners // 3 if separate else max(0, corners - 2)
                self._files.budget.take(triangles, "triangles")
                yield (*self._read(primitive), matrix)

    def _nodes(self) -> Iterator[tuple[_Node, Floats]]:
        """Yield the scene's nodes and their matrices; children are in reverse order.

        A MeshError is raised if the nodes do not form trees.
        """
        tree = self._tree
        roots = _item(tree.scenes, tree.scene, "scene").nodes if tree.scenes else []
        seen: set[int] = set()
        left: list[tuple[int, int, Floats]] = []

        def add(indices: list[int], level: int, matrix: Floats) -> None:
            expect_at_most(level, MAX_LEVELS, "levels of nodes")
            for index in indices:
                if index in seen:  # Cycles and shared nodes could take forever.
                    raise MeshError(
                        f"node {index} is in the scene twice, expected once"
                    )
                seen.add(index)
                left.append((index, level, matrix))

        add(roots, 1, np.eye(4))
        while left:
            index, level, outer = left.pop()
            node = _item(tree.nodes, index, "node")
            matrix = outer @ _matrix(node)
            if node.children:
                add(node.children, level + 1, matrix)
            yield node, matrix

    def _accessor(self, index: int, kind: str) -> _Accessor:
        """Return an accessor; raise MeshError if it is of an unsupported type."""
        accessor = _item(self._tree.accessors, index, "accessor")
        name = f"accessor {index}"
        if accessor.bufferView is None or accessor.sparse is not None:
            raise MeshError(f"{name} is sparse or compressed, expected plain values")
        types = _TYPES if kind == "VEC3" else _INDEX_TYPES
        if accessor.type != kind or accessor.componentType not in types:
            given = f"{accessor.type[:20]} of {accessor.componentType}"
            raise MeshError(f"{name} is {given}, expected {kind} of {list(types)}")
        if accessor.count == 0:
            raise MeshError(f"{name} is empty, expected values")
        return accessor

    def _read(self, primitive: _Primitive) -> tuple[str | None, Any, Any]:
        """Return the material, the vertices and the faces of a primitive."""
        positions = primitive.attributes.POSITION
        vertices = self._values(positions, 3).astype(np.float64)
        accessor = self._tree.accessors[positions]
        kind = np.dtype(_TYPES[accessor.componentType])
        if accessor.normalized and kind.kind != "f":
            vertices = np.maximum(vertices / np.iinfo(kind).max, -1.0)
        if primitive.indices is None:
            corners = np.arange(len(vertices))
        else:
            corners = self._values(primitive.indices, 1)[:, 0].astype(np.int64)
        name = None
        if primitive.material is not None:
            name = _item(self.materials, primitive.material, "material").name
        return name, vertices, _faces(corners, primitive.mode)

    def _values(self, index: int, width: int) -> Any:
        """Return a view of the values of an accessor, (N, width)."""
        accessor = self._tree.accessors[index]
        view = _item(self._tree.bufferViews, accessor.bufferView or 0, "buffer view")
        kind = np.dtype(_TYPES[accessor.componentType])
        size = width * kind.itemsize
        stride = view.byteStride or size
        end = accessor.byteOffset + (accessor.count - 1) * stride + size
        expect_at_most(end, view.byteLength, f"bytes of accessor {index}")
        if view.buffer not in self._buffers:
            self._buffers[view.buffer] = self._buffer(view.buffer)
        content = self._buffers[view.buffer]
        end = view.byteOffset + view.byteLength
        expect_at_most(end, len(content), f"bytes of buffer {view.buffer}")
        start = view.byteOffset + accessor.byteOffset
        shape, strides = (accessor.count, width), (stride, kind.itemsize)
        return np.ndarray(shape, kind, content, start, strides)

    def _buffer(self, index: int) -> bytes | memoryview:
        """Return a buffer's bytes from the GLB chunk, base64 text or another file."""
        uri = _item(self._tree.buffers, index, "buffer").uri
        if uri is None:
            if self._binary is None:
                raise MeshError("a buffer has no uri, expected a uri or a GLB file")
            return self._binary
        head, separator, data = uri.partition("base64,")
        if not separator:
            return self._files.read(self._files.find(unquote(head)))
        try:
            return base64.b64decode(data)
        except binascii.Error as error:
            raise MeshError(f"a buffer, expected valid base64: {error}") from error


def _matrix(node: _Node) -> Floats:
    """Return the matrix, (4, 4), that transforms a node to the frame of its parent."""
    import trimesh  # noqa: PLC0415 - slow, see `meshes`

    transformations: Any = trimesh.transformations
    matrix = np.reshape(node.matrix, (4, 4)).T if node.matrix else np.eye(4)
    if node.translation:
        matrix = matrix @ transformations.translation_matrix(node.translation)
    if node.rotation:
        x, y, z, w = node.rotation
        matrix = matrix @ transformations.quaternion_matrix([w, x, y, z])
    if node.scale:
        matrix = matrix @ np.diag([*node.scale, 1.0])
    return matrix


def _faces(corners: Any, mode: int) -> Any:
    """Convert the vertex indices of a list, strip or fan to triangles, (F, 3)."""
    if mode == _TRIANGLES:
        return corners.reshape(-1, 3)
    if mode == _FAN:
        first = np.full(max(0, len(corners) - 2), corners[0])
        return np.column_stack([corners[1:-1], corners[2:], first])
    faces = np.column_stack([corners[:-2], corners[1:-1], corners[2:]])
    faces[1::2] = faces[1::2, ::-1].copy()  # give all triangles the same orientation
    return faces


def _describe(details: ErrorDetails) -> str:
    """Return the message for a validation error: its key path and the reason."""
    if details["type"] == "json_invalid":
        return f"not JSON: {details['ctx']['error']}"
    keys = ".".join(str(key)[:40] for key in details["loc"])
    return f"{keys}: {describe_invalid(details)}"


def _split_glb(content: bytes) -> tuple[bytes, memoryview | None]:
    """Return the JSON and the binary chunk of a GLB file."""
    if len(content) < _HEADER.size:
        raise MeshError(f"{len(content)} bytes, expected at least {_HEADER.size}")
    magic, version, _ = _HEADER.unpack_from(content)
    if magic != b"glTF" or version != 2:
        raise MeshError(f"{magic!r} version {version}, expected b'glTF' version 2")
    chunks: dict[bytes, memoryview] = {}
    at = _HEADER.size
    while len(content) - at >= _CHUNK.size and len(chunks) < 2:
        size, kind = _CHUNK.unpack_from(content, at)
        at += _CHUNK.size
        if len(content) - at < size:
            text = f"a chunk of {size} bytes, expected at most {len(content) - at}"
            raise MeshError(text)
        if kind in (b"JSON", b"BIN\0"):
            chunks.setdefault(kind, memoryview(content)[at : at + size])
        at += size
    if b"JSON" not in chunks:
        raise MeshError("no JSON chunk, expected one")
    return bytes(chunks[b"JSON"]), chunks.get(b"BIN\0")


def _item(items: list[_AnyObject], index: int, name: str) -> _AnyObject:
    """Return an item of a list in the file; raise MeshError if the item is missing."""
    if index >= len(items):
        raise MeshError(f"{name} {index}, expected one of the {len(items)} in the file")
    return items[index]
