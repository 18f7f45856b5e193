"""Converts SDF shapes into keys of a map file.

Shapes that a map file does not have become meshes. All meshes are copied as GLB files
into a folder next to the map. Source: the specification of SDFormat 1.11.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from radarsim.addons.imports.collada import read_collada
from radarsim.addons.imports.imported_map import ImportedMap
from radarsim.addons.imports.sdf_frames import LeftOut
from radarsim.addons.imports.source_file import XmlElement, place, read_bytes
from radarsim.errors import ForeignFileError, MissingPackage, install_command
from radarsim.geometry import Floats
from radarsim.scene.mesh_files import (
    MAX_FILE_BYTES,
    MAX_SURFACES,
    MAX_TRIANGLES,
    MeshBudget,
    MeshError,
    check_vertices,
)
from radarsim.scene.shapes import CYLINDER_SIDES, Mesh, concatenate, sphere

KNOWN: Final = (".dae", ".glb", ".gltf", ".obj", ".ply", ".stl")
MAX_POINTS: Final = 10_000  # points in the polylines of a shape
FARTHEST: Final = 1e5  # m; largest coordinate of a point


class MeshCopies:
    """Creates the mesh files of a map, and reads each original file once."""

    def __init__(self, imported: ImportedMap, folder: str) -> None:
        """Create an empty collection of mesh files.

        Args:
            imported: The map, to which the files are added.
            folder: Name of the folder for the files, next to the map.
        """
        self._map = imported
        self._folder = folder
        self._budget = MeshBudget()  # shared by all copies
        self._originals: dict[Path, list[tuple[str, Mesh]]] = {}
        self._made: dict[tuple[object, ...], tuple[str, int] | Exception] = {}
        self._triangles = 0

    def add(
        self, file: Path, scale: list[float], part: str = "", *, centred: bool = False
    ) -> dict[str, object]:
        """Copy a mesh file if needed; return the keys of a map object with this mesh.

        Args:
            file: The original file.
            scale: Factors along the axes; negative factors mirror the mesh.
            part: Name of the only node to use; empty for all nodes.
            centred: Whether the centre of the bounding box becomes the origin.

        Raises:
            ForeignFileError: If the file cannot be read.
            MeshError: If the mesh cannot be used.
            MissingPackage: If it is a COLLADA file and pycollada is not installed.
        """
        # Objects that differ only by a uniform scale, such as trees of many sizes,
        # share one copy of the mesh.
        uniform = scale[0] if len(set(scale)) == 1 and scale[0] > 0 else 1.0
        own = tuple(each / uniform for each in scale)
        key = (file, own, part, centred)
        if key not in self._made:
            try:
                meshes = self._placed(file, own, part, centred=centred)
                self._made[key] = self._write(file.stem, meshes)
            except (MeshError, ForeignFileError) as error:
                self._made[key] = error
        shape = self._shape(key)
        return shape if uniform == 1 else {**shape, "scale": uniform}

    def add_mesh(self, name: str, mesh: Mesh) -> dict[str, object]:
        """Write a computed mesh; return the keys of a map object with this mesh.

        Raises:
            MeshError: If a map cannot contain the mesh.
        """
        key = (name, *(array.tobytes() for array in mesh))
        if key not in self._made:
            self._made[key] = self._write(name, [mesh])
        return self._shape(key)

    def _shape(self, key: tuple[object, ...]) -> dict[str, object]:
        """Return the map keys of an object that uses a mesh written before."""
        made = self._made[key]
        if isinstance(made, Exception):
            raise made
        name, count = made
        if self._triangles + count > MAX_TRIANGLES:
            raise MeshError(f"more than {MAX_TRIANGLES} triangles in all meshes")
        self._triangles += count
        return {"mesh": name, "up_axis": "y"}

    def _placed(
        self, file: Path, scale: tuple[float, ...], part: str, *, centred: bool
    ) -> list[Mesh]:
        """Return the scaled meshes of a file; ``centred`` moves them to the origin."""
        if file not in self._originals:
            self._originals[file] = self._read(file)
        original = self._originals[file]
        meshes = [mesh for name, mesh in original if part in ("", name)]
        if not meshes:
            known = sorted({name for name, _ in original if name})[:8]
            raise MeshError(f"no part {part!r}, expected one of {known}")
        if len(meshes) > MAX_SURFACES:
            meshes = [concatenate(meshes)]
        low = np.min([vertices.min(0) for vertices, _ in meshes], axis=0)
        high = np.max([vertices.max(0) for vertices, _ in meshes], axis=0)
        origin = (low + high) / 2 if centred else np.zeros(3)
        mirrored = np.prod(scale) < 0
        with np.errstate(all="ignore"):
            return [
                ((vertices - origin) * scale, faces[:, ::-1] if mirrored else faces)
                for vertices, faces in meshes
            ]

    def _write(self, stem: str, meshes: list[Mesh]) -> tuple[str, int]:
        """Create a GLB file; return its path relative to the map, and its triangles.

        Raises:
            MeshError: If a map cannot contain the mesh.
        """
        import trimesh  # noqa: PLC0415 - slow, and not needed without meshes

        scene: Any = trimesh.Scene()
        has_area = False
        for vertices, faces in meshes:
            check_vertices(vertices)
            single = vertices.astype(np.float32)
            corners = single[faces]
            differ = (corners != np.roll(corners, 1, axis=1)).any(axis=2)
            has_area |= bool(differ.all(axis=1).any())
            x, y, z = single.T
            turned = np.column_stack([x, z, -y])  # y is up in GLB
            scene.add_geometry(trimesh.Trimesh(turned, faces, process=False))
        if not has_area:
            raise MeshError("all triangles have an area of 0")
        content: bytes = scene.export(file_type="glb")
        self._budget.take(len(content), "bytes")
        stem = re.sub(r"[^\w-]", "_", stem, flags=re.ASCII)[:80]
        name = f"{stem}_{len(self._map.meshes) + 1}.glb"
        self._map.meshes[name] = content
        return f"{self._folder}/{name}", sum(len(faces) for _, faces in meshes)

    def _read(self, file: Path) -> list[tuple[str, Mesh]]:
        if file.suffix.lower() != ".dae":
            from radarsim.scene.meshes import read_surfaces  # noqa: PLC0415 - slow

            found = read_surfaces(file, file.parent)
            meshes = [("", (each.vertices, each.faces)) for each in found]
        else:
            meshes, problems = read_collada(read_bytes(file, MAX_FILE_BYTES))
            for problem in problems:
                self._map.notes.append(place(file, 1, f"a part is left out: {problem}"))
        self._budget.take(sum(len(faces) for _, (_, faces) in meshes), "triangles")
        return meshes


def read_shape(
    geometry: XmlElement, scale: Sequence[float], copies: MeshCopies
) -> dict[str, object]:
    """Return the keys of a map object for an SDF shape other than a mesh file.

    Args:
        geometry: Element ``geometry`` that contains the shape.
        scale: Factors along the axes; round shapes use the larger one, as in Gazebo.
        copies: Creates the mesh files.

    Raises:
        LeftOut: If the shape is left out.
        ForeignFileError: If a size of the shape is missing or wrong.
    """
    element = geometry.children[0]
    tag = element.tag
    across, along = max(scale[:2]), scale[2]
    match tag:
        case "box":
            sizes = _sizes(element, "size", 3)
            return {"box": [a * b for a, b in zip(sizes, scale, strict=True)]}
        case "sphere":
            return {"sphere": _sizes(element, "radius")[0] * max(scale)}
        case "cylinder" | "capsule" | "cone":
            radius = _sizes(element, "radius")[0] * across
            length = _sizes(element, "length")[0] * along
            if tag == "cylinder":
                return {"cylinder": [radius, length]}
            vertices, faces = _round(tag, radius, length)
        case "ellipsoid":
            vertices, faces = sphere(1.0)
            vertices = vertices * _sizes(element, "radii", 3) * scale
        case "polyline":
            vertices, faces = _extruded(geometry)
            vertices = vertices * scale
        case "plane":
            text = "<plane> is not needed: robots drive at z = 0 without it"
            raise LeftOut(element, text, "")
        case "empty":
            raise LeftOut(element, "<empty> has no shape", "")
        case other:
            text = f"<{other[:40]}> is left out"
            raise LeftOut(element, text, f"with <{other[:40]}>")
    try:
        return copies.add_mesh(tag, (vertices, faces))
    except MeshError as error:
        text = f"<{tag}> is left out: {error}"
        raise LeftOut(element, text, f"with <{tag}> that cannot be used") from error


def read_mesh(
    mesh: XmlElement, file: Path, factors: Sequence[float], copies: MeshCopies
) -> dict[str, object]:
    """Return the keys of a map object for an SDF shape with a mesh file.

    Raises:
        LeftOut: If the mesh cannot be used.
        ForeignFileError: If the scale of the mesh is wrong.
    """
    uri = mesh.text_of("uri")
    text, suffix = f"the mesh {uri!r} is left out", Path(uri).suffix.lower()
    if not file.is_file() or suffix not in KNOWN:
        text += f", expected {', '.join(KNOWN)}"
        raise LeftOut(mesh, text, f"{suffix[:20] or 'files'} that are not read")
    given = mesh.first("scale")
    own = given.numbers(3) if given and given.text.strip() else [1.0, 1.0, 1.0]
    scale = [a * b for a, b in zip(own, factors, strict=True)]
    if 0 in scale:
        raise LeftOut(mesh, f"{text}: a scale of 0", "with a scale of 0")
    part = mesh.first("submesh")
    named = part.text_of("name") if part else ""
    centred = part is not None and part.text_of("center") in ("true", "1")
    try:
        return copies.add(file, scale, named, centred=centred)
    except (MeshError, ForeignFileError) as error:
        reason = f"{suffix} that cannot be used"
        raise LeftOut(mesh, f"{text}: {error}", reason) from error
    except MissingPackage as error:
        reason = f"{suffix} without pycollada ({install_command('collada')})"
        text += ": pycollada is not installed"
        raise LeftOut(mesh, text, reason) from error


def _sizes(element: XmlElement, tag: str, count: int = 1) -> list[float]:
    found = element.first(tag)
    if found is None:
        raise element.wrong(f"expected <{tag}>")
    values = found.numbers(count)
    if min(values) <= 0:
        text = f"<{tag}> {found.text.strip()[:80]}, expected more than 0"
        raise found.wrong(text)
    return values


def _round(tag: str, radius: float, length: float) -> Mesh:
    """Return a capsule or a cone, with its centre at the origin."""
    from trimesh import creation  # noqa: PLC0415 - slow, and rarely needed

    if tag == "cone":
        solid = creation.cone(radius, length, sections=CYLINDER_SIDES)
        return solid.vertices - [0, 0, length / 2], np.array(solid.faces, np.int32)
    sections = CYLINDER_SIDES // 2, CYLINDER_SIDES
    solid = creation.capsule(length, radius, count=sections)
    return np.array(solid.vertices), np.array(solid.faces, np.int32)


def _extruded(geometry: XmlElement) -> Mesh:
    """Return a mesh of extruded polylines; a polyline inside another is a hole."""
    import shapely  # noqa: PLC0415 - slow, and rarely needed
    from trimesh import creation  # noqa: PLC0415 - slow, and rarely needed

    first = geometry.children[0]
    [height] = _sizes(first, "height")
    lines = [[*line.all("point")] for line in geometry.all("polyline")]
    if sum(map(len, lines)) > MAX_POINTS:
        text = f"a polyline of more than {MAX_POINTS} points, expected fewer"
        raise first.wrong(text)
    area = shapely.Polygon()
    for points in lines:
        plan = [point.numbers(2) for point in points]
        ring = shapely.Polygon(plan if len(plan) > 2 else ())
        if ring.is_empty or not ring.is_valid or np.max(np.abs(plan)) > FARTHEST:
            text = "a <polyline> that crosses itself, or encloses nothing"
            raise LeftOut(first, f"{text}, is left out", "with a wrong <polyline>")
        area = area.symmetric_difference(ring)
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(area))
    found: Floats = shapely.get_coordinates(shapely.orient_polygons(triangles))
    if not len(found):
        text = "<polyline>s without an area are left out"
        raise LeftOut(first, text, "with a wrong <polyline>")
    # The outline of a triangle has four points, because it ends at its first corner.
    corners = found.reshape(-1, 4, 2)[:, :3]
    vertices, faces = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    solid = creation.extrude_triangulation(vertices, faces.reshape(-1, 3), 1.0)
    return solid.vertices * [1, 1, height], np.array(solid.faces, np.int32)
