"""Shapes of SDF as the keys of a map file: those that a map lacks become meshes.

Source: the specification of SDFormat 1.11.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from radarsim.addons.imports.mesh_copies import KNOWN, MeshCopies
from radarsim.addons.imports.sdf_frames import LeftOut
from radarsim.addons.imports.source_file import XmlElement
from radarsim.errors import MissingPackage, install_command
from radarsim.geometry import Floats
from radarsim.scene.mesh_files import MeshError
from radarsim.scene.shapes import CYLINDER_SIDES, Mesh, sphere

MAX_POINTS: Final = 10_000  # of the polylines of a shape
FARTHEST: Final = 1e5  # m, of a point


def read_shape(
    geometry: XmlElement, scale: Sequence[float], copies: MeshCopies
) -> dict[str, object]:
    """Return the keys of a map file for a shape that is no mesh file.

    Args:
        geometry: What holds the shape.
        scale: Factors along its axes; round shapes take the larger one, as in Gazebo.
        copies: Gets the meshes.

    Raises:
        LeftOut: If it becomes nothing.
        ForeignFileError: If a size of it is missing or wrong.
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
    """Return the keys of a map file for a mesh file.

    Raises:
        LeftOut: If it cannot be used.
        ForeignFileError: If its scale is wrong.
    """
    uri = mesh.text_of("uri")
    text, suffix = f"the mesh {uri!r} is left out", Path(uri).suffix.lower()
    if not file.is_file() or suffix not in KNOWN:
        told = f"{text}, expected {', '.join(KNOWN)}"
        raise LeftOut(mesh, told, f"{suffix[:20] or 'files'} that are not read")
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
    except MeshError as error:
        reason = f"{suffix} that cannot be used"
        raise LeftOut(mesh, f"{text}: {error}", reason) from error
    except MissingPackage as error:
        reason = f"{suffix} without pycollada ({install_command('collada')})"
        told = f"{text}: pycollada is not installed"
        raise LeftOut(mesh, told, reason) from error


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
    """Return a capsule or a cone, with its middle at the origin."""
    from trimesh import creation  # noqa: PLC0415 - slow, and not every world has one

    if tag == "cone":
        solid = creation.cone(radius, length, sections=CYLINDER_SIDES)
        return solid.vertices - [0, 0, length / 2], np.array(solid.faces, np.int32)
    sections = CYLINDER_SIDES // 2, CYLINDER_SIDES
    solid = creation.capsule(length, radius, count=sections)
    return np.array(solid.vertices), np.array(solid.faces, np.int32)


def _extruded(geometry: XmlElement) -> Mesh:
    """Return the solid over the polylines of a shape; one in another is a hole."""
    import shapely  # noqa: PLC0415 - likewise
    from trimesh import creation  # noqa: PLC0415 - likewise

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
    triangles = shapely.constrained_delaunay_triangles(area)
    found: Floats = shapely.get_coordinates(shapely.get_parts(triangles))
    if not len(found):
        text = "<polyline>s without an area are left out"
        raise LeftOut(first, text, "with a wrong <polyline>")
    # Each triangle ends with its first corner.
    corners = found.reshape(-1, 4, 2)[:, :3]
    (ax, ay), (bx, by) = (corners[:, 1:] - corners[:, :1]).transpose(1, 2, 0)
    clockwise = ax * by < ay * bx
    corners[clockwise] = corners[clockwise, ::-1]
    vertices, faces = np.unique(corners.reshape(-1, 2), axis=0, return_inverse=True)
    solid = creation.extrude_triangulation(vertices, faces.reshape(-1, 3), 1.0)
    return solid.vertices * [1, 1, height], np.array(solid.faces, np.int32)
