"""Reduce glTF files to their triangles, and check their counts.

A few hundred bytes of glTF can announce any number of values, share one buffer between
thousands of meshes, or build a chain of nodes that takes minutes to follow. Before
trimesh parses a file, everything that is not geometry is dropped, and what is left is
counted as the scene graph uses it.
"""

import base64
import binascii
import struct
from typing import Annotated, Final, TypeAlias, TypeVar
from urllib.parse import unquote

from annotated_types import Ge, Le, Len, MaxLen
from pydantic import BaseModel, ConfigDict, FailFast, Field, ValidationError
from pydantic_core import ErrorDetails

from radarsim.scene.mesh_files import (
    MAX_SURFACES,
    MAX_TRIANGLES,
    MeshBudget,
    MeshError,
    MeshFiles,
    expect_at_most,
)
from radarsim.validation import describe_invalid

MAX_JSON_BYTES: Final = 16 * 1024 * 1024
MAX_NODES: Final = 10_000
MAX_LEVELS: Final = 100  # of nested nodes
MAX_VERTICES: Final = 3 * MAX_TRIANGLES

_HEADER = struct.Struct("<4sII")  # magic, version, length
_CHUNK = struct.Struct("<I4s")  # length, type
_COMPONENT_BYTES: Final = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_COMPONENTS: Final = {"SCALAR": 1, "VEC3": 3}
_TRIANGLE_MODES: Final = (4, 5)  # separate triangles, and strips

_Index: TypeAlias = Annotated[int, Ge(0)]
# The first wrong value ends the validation: millions of errors would fill the memory.
_Numbers: TypeAlias = Annotated[list[float], FailFast()]


class _Object(BaseModel):
    """A JSON object; keys that do not matter here are dropped."""

    model_config = ConfigDict(extra="ignore")


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
    sparse: object = None


_EMPTY: Final = _Accessor(componentType=5126, count=0, type="VEC3")


class _Attributes(_Object):
    POSITION: _Index


class _Primitive(_Object):
    attributes: _Attributes
    indices: _Index | None = None
    material: _Index | None = None
    mode: int = 4


class _Mesh(_Object):
    name: str | None = None
    primitives: Annotated[list[_Primitive], MaxLen(MAX_SURFACES), FailFast()]


class _Node(_Object):
    name: str | None = None
    mesh: _Index | None = None
    children: Annotated[list[_Index], MaxLen(MAX_NODES), FailFast()] = []
    matrix: Annotated[_Numbers, Len(16, 16)] = []
    translation: Annotated[_Numbers, Len(3, 3)] = []
    rotation: Annotated[_Numbers, Len(4, 4)] = []
    scale: Annotated[_Numbers, Len(3, 3)] = []


class _Roots(_Object):
    nodes: Annotated[list[_Index], MaxLen(MAX_NODES), FailFast()] = []


class _Material(_Object):
    name: str | None = None


class _Tree(_Object):
    """The part of a glTF file's JSON that trimesh gets."""

    asset: _Asset = _Asset()
    scene: _Index = 0
    scenes: Annotated[list[_Roots], MaxLen(MAX_NODES), FailFast()] = []
    nodes: Annotated[list[_Node], MaxLen(MAX_NODES), FailFast()] = []
    meshes: Annotated[list[_Mesh], MaxLen(MAX_NODES), FailFast()] = []
    materials: Annotated[list[_Material], MaxLen(MAX_NODES), FailFast()] = []
    accessors: Annotated[list[_Accessor], MaxLen(10 * MAX_NODES), FailFast()] = []
    buffer_views: Annotated[
        list[_BufferView],
        MaxLen(10 * MAX_NODES),
        FailFast(),
        Field(alias="bufferViews"),
    ] = []
    buffers: Annotated[list[_Buffer], MaxLen(MAX_NODES), FailFast()] = []


def reduce_gltf(content: bytes, suffix: str, files: MeshFiles) -> bytes:
    """Reduce a glTF file to its triangles, nodes and the names of its materials.

    Args:
        content: The file.
        suffix: ``.glb`` or ``.gltf``.
        files: Where buffers beside the file are read, and all are added by number.

    Returns:
        The JSON of a glTF file that refers to these buffers.

    Raises:
        MeshError: If it is broken, or too large in any way.
        OSError: If a buffer cannot be read.
    """
    # trimesh gets JSON with virtual buffers also for a GLB file: one form to check
    text, binary = split_glb(content) if suffix == ".glb" else (content, None)
    # Before it is parsed: objects in memory take many times what their text does.
    expect_at_most(len(text), MAX_JSON_BYTES, "bytes of JSON")
    try:
        tree = _Tree.model_validate_json(text)
    except ValidationError as error:
        raise MeshError(_describe(error.errors(include_url=False)[0])) from error
    if tree.asset.version.partition(".")[0] != "2":
        raise MeshError(f"glTF {tree.asset.version[:20]}, expected glTF 2")
    _keep_triangles(tree)
    _check_instances(tree, files.budget)
    _add_buffers(tree, binary, files)
    return tree.model_dump_json(exclude_defaults=True, by_alias=True).encode()


def _describe(details: ErrorDetails) -> str:
    """Return where a file's JSON is broken, and how."""
    if details["type"] == "json_invalid":
        return f"not JSON: {details['ctx']['error']}"
    keys = ".".join(str(key)[:40] for key in details["loc"])
    return f"{keys}: {describe_invalid(details)}"


def split_glb(content: bytes) -> tuple[bytes, memoryview | None]:
    """Return the JSON and the binary chunk of a GLB file."""
    if len(content) < _HEADER.size:
        raise MeshError(f"{len(content)} bytes, expected a header of {_HEADER.size}")
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


def _keep_triangles(tree: _Tree) -> None:
    """Drop primitives of points and lines, and meshes that the scene does not show."""
    shown = set()
    for node in _scene_nodes(tree):
        if node.mesh is not None:
            mesh = _item(tree.meshes, node.mesh, "mesh")
            shown.add(node.mesh)
            mesh.primitives = [p for p in mesh.primitives if p.mode in _TRIANGLE_MODES]
            node.mesh = node.mesh if mesh.primitives else None
    for index, mesh in enumerate(tree.meshes):
        if index not in shown:
            mesh.primitives = []  # trimesh would parse what nobody shows


def _scene_nodes(tree: _Tree) -> list[_Node]:
    """Return the nodes of the scene, which have to form trees."""
    scenes = tree.scenes
    level = _item(scenes, tree.scene, "scene").nodes if scenes else []
    found: dict[int, _Node] = {}
    depth = 0
    while level:
        expect_at_most(depth := depth + 1, MAX_LEVELS, "levels of nodes")
        below: list[int] = []
        for index in level:
            if index in found:  # a loop, or a diamond that doubles at each level
                raise MeshError(f"node {index} is in the scene twice, expected once")
            found[index] = _item(tree.nodes, index, "node")
            below += found[index].children
        level = below
    return list(found.values())


def _check_instances(tree: _Tree, budget: MeshBudget) -> None:
    """Count what the scene shows, with every use of a mesh."""
    surfaces = vertices = triangles = 0
    for node in _scene_nodes(tree):
        primitives = [] if node.mesh is None else tree.meshes[node.mesh].primitives
        expect_at_most(surfaces := surfaces + len(primitives), MAX_SURFACES, "surfaces")
        for primitive in primitives:
            corners = _accessor(tree, primitive.attributes.POSITION, "VEC3").count
            vertices += corners
            if primitive.indices is not None:
                corners = _accessor(tree, primitive.indices, "SCALAR").count
            # A strip of n corners has n - 2 triangles; n is near enough for a limit.
            triangles += corners // 3 if primitive.mode == 4 else corners
    expect_at_most(vertices, MAX_VERTICES, "vertices")
    budget.take(triangles, "triangles")


def _accessor(tree: _Tree, index: int, kind: str) -> _Accessor:
    """Return an accessor that has all its values in a buffer view."""
    accessor = _item(tree.accessors, index, "accessor")
    name = f"accessor {index}"
    if accessor.bufferView is None or accessor.sparse is not None:
        raise MeshError(f"{name} is sparse or compressed, expected plain values")
    if accessor.type != kind or accessor.componentType not in _COMPONENT_BYTES:
        given = f"{accessor.type[:20]} of {accessor.componentType}"
        raise MeshError(f"{name} is {given}, expected {kind} of a known type")
    if accessor.count == 0:
        raise MeshError(f"{name} is empty, expected values")
    view = _item(tree.buffer_views, accessor.bufferView, "buffer view")
    item = _COMPONENTS[kind] * _COMPONENT_BYTES[accessor.componentType]
    stride = view.byteStride or item
    end = accessor.byteOffset + (accessor.count - 1) * stride + item
    expect_at_most(end, view.byteLength, f"bytes of {name}")
    return accessor


def _add_buffers(tree: _Tree, binary: memoryview | None, files: MeshFiles) -> None:
    """Add the buffers that are used as virtual files; empty the others, and views.

    All values of accessors that are not used are dropped as well.
    """
    # Only what triangles need: normals and textures can be most of a file.
    accessors = {
        number
        for mesh in tree.meshes
        for primitive in mesh.primitives
        for number in (primitive.attributes.POSITION, primitive.indices)
    }
    tree.accessors = [
        # Replaced and not removed: others refer to accessors by their numbers.
        accessor if number in accessors else _EMPTY
        for number, accessor in enumerate(tree.accessors)
    ]
    views = {accessor.bufferView for accessor in tree.accessors}
    sizes: dict[int, int] = {}
    for number, view in enumerate(tree.buffer_views):
        if number not in views:
            view.byteOffset = view.byteLength = view.buffer = 0
        _item(tree.buffers, view.buffer, "buffer")
        end = view.byteOffset + view.byteLength
        sizes[view.buffer] = max(end, sizes.get(view.buffer, 0))
    for number, buffer in enumerate(tree.buffers):
        size = sizes.get(number, 0)
        content = _buffer(buffer, binary, files) if size else b""
        expect_at_most(size, len(content), f"bytes of buffer {number}")
        # trimesh sees numbers only: no name of the file's choice reaches the disk
        buffer.uri = str(number)
        files.add(buffer.uri, memoryview(content))


def _buffer(
    buffer: _Buffer, binary: memoryview | None, files: MeshFiles
) -> bytes | memoryview:
    """Return the bytes of a buffer: of the GLB file, in the JSON, or of a file."""
    if buffer.uri is None:
        if binary is None:
            raise MeshError("a buffer has no uri, expected one")
        return binary
    head, separator, data = buffer.uri.partition("base64,")
    if not separator:
        return files.read(files.find(unquote(head)))
    try:
        return base64.b64decode(data)
    except binascii.Error as error:
        raise MeshError(f"a buffer in base64: {error}, expected base64") from error


def _item(items: list[_AnyObject], index: int, name: str) -> _AnyObject:
    """Return an item of a list of the file."""
    if index >= len(items):
        raise MeshError(f"{name} {index}, expected one of the {len(items)} in the file")
    return items[index]
