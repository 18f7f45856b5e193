"""Build materials and parts from the entries of a map file."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from radarsim.geometry import Floats, rotation_matrix
from radarsim.presets.materials import library_material
from radarsim.rng import generator_for
from radarsim.scene.map_checks import Problem
from radarsim.scene.map_schema import (
    MAX_EXTENT,
    MaterialEntry,
    ObjectEntry,
    ScatterEntry,
)
from radarsim.scene.material import Material
from radarsim.scene.mesh_files import MeshError, find_inside
from radarsim.scene.meshes import (
    Surface,
    join_surfaces,
    join_volume,
    read_surfaces,
)
from radarsim.scene.scene import Part
from radarsim.scene.shapes import Mesh, box, cylinder, sphere
from radarsim.suggestions import expected_one_of

MAX_ATTEMPTS = 200  # random positions for each copy, before the area counts as full

_Piece: TypeAlias = tuple[Material, Mesh]


class BuildError(Exception):
    """An object cannot be built.

    Attributes:
        problems: The keys inside of the object, each with what is wrong there.
    """

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__(problems)
        self.problems = problems


@dataclass(frozen=True, eq=False)
class Copy:
    """One copy of an object.

    Attributes:
        name: The object's name, with a number if there are several copies.
        position: (3,) m, of its origin.
        scale: Factor of its size.
    """

    name: str
    position: Floats
    scale: float = 1.0


def from_library(name: str) -> Material:
    """Return a material of the library, with its default amount."""
    return Material(name, **asdict(library_material(name)))


def make_material(name: str, entry: MaterialEntry) -> Material:
    """Create a material from an entry and the library material that it is based on.

    If an entry has any key of radar attenuation, these keys replace all radar
    attenuation of the base; the same holds for light. A material that beams enter has
    no mirror, and its surface absorbs nothing.
    """
    base = Material(name)
    if entry.based_on is not None:
        amounts = {"g_per_m3": entry.g_per_m3, "mm_per_h": entry.mm_per_h}
        base = Material(name, **asdict(library_material(entry.based_on, **amounts)))
    changes = {
        **_radar_properties(entry),
        **_light_properties(entry),
        **_surface_properties(entry),
    }
    return replace(base, **changes)


def _radar_properties(entry: MaterialEntry) -> dict[str, Any]:
    if all(x is None for x in (entry.density, entry.db_per_m, entry.sheet_loss)):
        return {}
    density = entry.density or 0.0
    properties: dict[str, Any] = {
        "density": density,
        "radar_db": entry.db_per_m or (0.0, 0.0, 0.0),
        "sheet_loss": entry.sheet_loss,
    }
    if math.isfinite(density):
        properties |= {"radar_mirror": False, "absorption_db": 0.0}
    return properties


def _light_properties(entry: MaterialEntry) -> dict[str, Any]:
    if entry.laser_density is None and entry.laser_db_per_m is None:
        return {}
    density = entry.laser_density or 0.0
    properties: dict[str, Any] = {
        "laser_density": density,
        "laser_db": entry.laser_db_per_m or 0.0,
    }
    if math.isfinite(density):
        properties |= {"laser_mirror": False, "laser_absorption_db": 0.0}
    return properties


def _surface_properties(entry: MaterialEntry) -> dict[str, Any]:
    given = {
        "solid": entry.solid,
        "absorption_db": entry.absorption_db,
        "laser_absorption_db": entry.laser_absorption_db,
    }
    if entry.mirror is not None:
        given["radar_mirror"] = entry.mirror in ("radar", "both")
        given["laser_mirror"] = entry.mirror in ("laser", "both")
    return {key: value for key, value in given.items() if value is not None}


def build_parts(
    entry: ObjectEntry,
    materials: Mapping[str, Material],
    folder: Path,
    max_triangles: int,
) -> list[Part]:
    """Build an object's parts, one for each copy and each of its materials.

    Args:
        entry: The object, with one shape.
        materials: The materials that it refers to, by name.
        folder: The map's own folder, links resolved.
        max_triangles: Largest number of triangles of all its parts.

    Raises:
        BuildError: If the mesh cannot be used, the copies do not fit into their area,
            or the object is too large.
    """
    pieces = _build_pieces(entry, materials, folder)
    copies = place_copies(entry)
    triangles = len(copies) * sum(len(faces) for _, (_, faces) in pieces)
    if triangles > max_triangles:
        text = f"{triangles} triangles, expected at most {max_triangles} more"
        raise BuildError([((), text)])
    rotation = rotation_matrix(*entry.angles()).T
    parts = [
        Part(
            copy.name, material, copy.scale * vertices @ rotation + copy.position, faces
        )
        for copy in copies
        for material, (vertices, faces) in pieces
    ]
    extent = max(np.abs(part.vertices).max(initial=0.0) for part in parts)
    if extent > MAX_EXTENT:
        text = f"{extent:.1f} m from the map's origin, expected at most {MAX_EXTENT:g}"
        raise BuildError([((), text)])
    return parts


def copy_names(name: str, count: int | None) -> Iterator[str]:
    """Yield the names of an object's copies, ``name_1``, ``name_2``; or just its own.

    Args:
        name: The object's own name.
        count: None for an object that is neither repeated nor scattered.
    """
    if count is None:
        yield name
    else:
        yield from (f"{name}_{number}" for number in range(1, count + 1))


def place_copies(entry: ObjectEntry) -> list[Copy]:
    """Place an object's copies.

    Scattered positions are drawn one after the other from a stream of the entry's own
    seed and name, so that a larger count does not move the first copies.

    Raises:
        BuildError: If the area is too small for so many copies so far apart.
    """
    origin = np.array(entry.position, dtype=np.float64)
    if entry.scatter is not None:
        return list(_scatter_copies(entry.name, origin, entry.scatter))
    step = np.array(entry.repeat.step) if entry.repeat else np.zeros(3)
    names = copy_names(entry.name, entry.copies)
    return [Copy(name, origin + i * step) for i, name in enumerate(names)]


def _scatter_copies(name: str, origin: Floats, scatter: ScatterEntry) -> Iterator[Copy]:
    rng = generator_for(scatter.seed, "scatter", name)
    low, high = np.array(scatter.area)
    smallest, largest = scatter.scale
    positions = np.full((scatter.count, 2), np.inf)
    for number, copy_name in enumerate(copy_names(name, scatter.count)):
        for _ in range(MAX_ATTEMPTS):
            position = rng.uniform(low, high)
            distances = np.linalg.norm(positions[:number] - position, axis=1)
            if distances.min(initial=np.inf) >= scatter.min_distance:
                break
        else:
            text = f"the area is full after {number} copies, expected {scatter.count}"
            raise BuildError([(("scatter",), text)])
        positions[number] = position
        scale = rng.uniform(smallest, largest)
        yield Copy(copy_name, origin + np.append(position, 0.0), scale)


def _build_pieces(
    entry: ObjectEntry, materials: Mapping[str, Material], folder: Path
) -> list[_Piece]:
    """Return the object's meshes in its own frame, m, not rotated."""
    if entry.mesh is not None:
        return _read_pieces(entry, entry.mesh, materials, folder)
    return [(materials[entry.material or ""], _build_primitive(entry))]


def _build_primitive(entry: ObjectEntry) -> Mesh:
    if entry.box is not None:
        length, width, height = entry.box
        return box(length, width, height)
    if entry.cylinder is not None:
        radius, height = entry.cylinder
        return cylinder(radius, height)
    return sphere(entry.sphere or 0.0)


def _read_pieces(
    entry: ObjectEntry, mesh: str, materials: Mapping[str, Material], folder: Path
) -> list[_Piece]:
    try:
        surfaces = read_surfaces(find_inside(folder, folder, mesh), folder)
    except MeshError as error:
        raise BuildError([(("mesh",), str(error))]) from error
    pieces: list[_Piece] = []
    problems: list[Problem] = []
    for name, members in _group_by_material(entry, surfaces).items():
        try:
            vertices, faces = _join(materials[name], members)
        except MeshError as error:
            problems.append((("mesh",), f"{mesh!r}: {error}"))
        else:
            pieces.append((materials[name], (_to_metres(entry, vertices), faces)))
    if problems:
        raise BuildError(problems)
    return pieces


def _join(material: Material, surfaces: list[Surface]) -> Mesh:
    """Join the surfaces of one material into one mesh."""
    may_be_open = not material.penetrable or material.sheet_loss is not None
    try:
        vertices, faces = (join_surfaces if may_be_open else join_volume)(surfaces)
    except MeshError as error:
        expected = "expected a closed volume with one outside"
        reason = f"since beams enter {material.name!r}, which has no sheet_loss"
        raise MeshError(f"{error}, {expected}, {reason}") from error
    if not len(faces):
        raise MeshError(f"no triangle of {material.name!r} has an area")
    return vertices, faces


def _group_by_material(
    entry: ObjectEntry, surfaces: list[Surface]
) -> dict[str, list[Surface]]:
    """Group surfaces by the map's material that each is made of."""
    if entry.material is not None:
        return {entry.material: surfaces}
    given = entry.materials or {}
    in_file = sorted({surface.material or "" for surface in surfaces})
    problems: list[Problem] = [
        (("materials",), f"missing {name!r} of the file")
        if name
        else (("materials",), "no names in parts of the file, expected 'material'")
        for name in in_file
        if name not in given
    ]
    problems += [
        (("materials", name), expected_one_of(name, [n for n in in_file if n]))
        for name in given
        if name not in in_file
    ]
    if problems:
        raise BuildError(problems)
    groups: dict[str, list[Surface]] = {}
    for surface in surfaces:
        groups.setdefault(given[surface.material or ""], []).append(surface)
    return groups


def _to_metres(entry: ObjectEntry, vertices: Floats) -> Floats:
    """Convert a mesh file's vertices to metres with z up."""
    scaled = vertices * entry.scale
    if entry.up_axis == "z":
        return scaled
    x, y, z = scaled.T
    return np.column_stack([x, -z, y])
