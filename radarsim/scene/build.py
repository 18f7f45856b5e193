"""From a map's object to its parts, in the map frame."""

from collections.abc import Mapping
from pathlib import Path
from typing import TypeAlias

import numpy as np

from radarsim.geometry import Floats, rotation_matrix
from radarsim.scene.mapchecks import Problem
from radarsim.scene.mapmodel import MAX_EXTENT, ObjectEntry
from radarsim.scene.material import Material
from radarsim.scene.meshes import (
    MeshError,
    Surface,
    find_inside,
    join_surfaces,
    join_volume,
    read_surfaces,
)
from radarsim.scene.placing import NoRoom, place_copies
from radarsim.scene.scene import Part
from radarsim.scene.shapes import Faces, box, cylinder, sphere

_Piece: TypeAlias = tuple[Material, Floats, Faces]


class BuildError(Exception):
    """An object cannot be built.

    Attributes:
        problems: The keys inside of the object, and what is wrong there.
    """

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__(problems)
        self.problems = problems


def build_parts(
    entry: ObjectEntry,
    materials: Mapping[str, Material],
    folder: Path,
    most_triangles: int,
) -> list[Part]:
    """Build an object's parts: one for each copy and each of its materials.

    Args:
        entry: The object, with one shape.
        materials: Those that it names.
        folder: The map's own folder, links resolved.
        most_triangles: How many there may be.

    Raises:
        BuildError: If the mesh cannot be used, or it does not fit.
    """
    pieces = _pieces(entry, materials, folder)
    try:
        copies = place_copies(entry)
    except NoRoom as error:
        raise BuildError([(("scatter",), str(error))]) from error
    triangles = len(copies) * sum(len(faces) for _, _, faces in pieces)
    if triangles > most_triangles:
        text = f"{triangles} triangles, expected at most {most_triangles} more"
        raise BuildError([((), text)])
    turn = rotation_matrix(*entry.angles()).T
    parts = [
        Part(copy.name, material, copy.scale * vertices @ turn + copy.position, faces)
        for copy in copies
        for material, vertices, faces in pieces
    ]
    reach = max(np.abs(part.vertices).max(initial=0.0) for part in parts)
    if reach > MAX_EXTENT:
        text = f"{reach:.1f} m from the map's origin, expected at most {MAX_EXTENT:g}"
        raise BuildError([((), text)])
    return parts


def _pieces(
    entry: ObjectEntry, materials: Mapping[str, Material], folder: Path
) -> list[_Piece]:
    """Make the object's meshes in its own frame, m, not turned."""
    if entry.mesh is not None:
        return _mesh_pieces(entry, entry.mesh, materials, folder)
    vertices, faces = _primitive(entry)
    return [(materials[entry.material or ""], vertices, faces)]


def _primitive(entry: ObjectEntry) -> tuple[Floats, Faces]:
    if entry.box is not None:
        length, width, height = entry.box
        return box(length, width, height)
    if entry.cylinder is not None:
        radius, height = entry.cylinder
        return cylinder(radius, height)
    return sphere(entry.sphere or 0.0)


def _mesh_pieces(
    entry: ObjectEntry, mesh: str, materials: Mapping[str, Material], folder: Path
) -> list[_Piece]:
    try:
        surfaces = read_surfaces(find_inside(folder, folder, mesh), folder)
    except MeshError as error:
        raise BuildError([(("mesh",), str(error))]) from error
    pieces: list[_Piece] = []
    problems: list[Problem] = []
    for name, members in _by_material(entry, surfaces).items():
        material = materials[name]
        try:
            vertices, faces = _join(material, members)
        except MeshError as error:
            problems.append((("mesh",), f"{mesh!r}: {error}"))
        else:
            pieces.append((material, _upright(entry, vertices), faces))
    if problems:
        raise BuildError(problems)
    return pieces


def _join(material: Material, surfaces: list[Surface]) -> tuple[Floats, Faces]:
    """Make one mesh of what is of one material."""
    may_be_open = not material.penetrable or material.sheet_loss is not None
    try:
        vertices, faces = (join_surfaces if may_be_open else join_volume)(surfaces)
    except MeshError as error:
        expected = "expected a closed volume with one outside"
        known = f"since beams enter {material.name!r}, which has no sheet_loss"
        raise MeshError(f"{error}, {expected}, {known}") from error
    if not len(faces):
        raise MeshError(f"no triangle of {material.name!r} has an area")
    return vertices, faces


def _by_material(
    entry: ObjectEntry, surfaces: list[Surface]
) -> dict[str, list[Surface]]:
    """Group surfaces by the map's material that each is made of."""
    if entry.material is not None:
        return {entry.material: surfaces}
    given = entry.materials or {}
    in_file = sorted({surface.material or "" for surface in surfaces})
    problems: list[Problem] = [
        (("materials",), f"nothing for {name!r} of the file")
        if name
        else (("materials",), "no names in parts of the file, expected 'material'")
        for name in in_file
        if name not in given
    ]
    problems += [
        (("materials", name), f"{name!r}, expected one of {[n for n in in_file if n]}")
        for name in given
        if name not in in_file
    ]
    if problems:
        raise BuildError(problems)
    grouped: dict[str, list[Surface]] = {}
    for surface in surfaces:
        grouped.setdefault(given[surface.material or ""], []).append(surface)
    return grouped


def _upright(entry: ObjectEntry, vertices: Floats) -> Floats:
    """Bring a mesh file's vertices to metres with z up."""
    scaled = vertices * entry.scale
    if entry.up_axis == "z":
        return scaled
    x, y, z = scaled.T
    return np.column_stack([x, -z, y])
