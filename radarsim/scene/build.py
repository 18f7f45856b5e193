"""From what a map says of a material to the material."""

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
from radarsim.scene.meshes import (
    MeshError,
    Surface,
    find_inside,
    join_surfaces,
    join_volume,
    read_surfaces,
)
from radarsim.scene.scene import Part
from radarsim.scene.shapes import Faces, box, cylinder, sphere
from radarsim.yaml_reader import shown


def from_library(name: str) -> Material:
    """Take a material from the library, with the amounts that it has there."""
    return Material(name, **asdict(library_material(name)))


def make_material(name: str, entry: MaterialEntry) -> Material:
    """Make a material of what an entry says and of what that is based on.

    All that is said of what a radar loses replaces all that the base has of that, and
    so it is with light. What beams enter is no mirror, and its surface keeps nothing.
    """
    base = Material(name)
    if entry.based_on is not None:
        amounts = {"g_per_m3": entry.g_per_m3, "mm_per_h": entry.mm_per_h}
        base = Material(name, **asdict(library_material(entry.based_on, **amounts)))
    changes = {**_of_radar(entry), **_of_light(entry), **_of_surface(entry)}
    return replace(base, **changes)


def _of_radar(entry: MaterialEntry) -> dict[str, Any]:
    said = (entry.density, entry.db_per_m, entry.sheet_loss)
    if all(value is None for value in said):
        return {}
    density = entry.density or 0.0
    changes: dict[str, Any] = {
        "density": density,
        "radar_db": entry.db_per_m or (0.0, 0.0, 0.0),
        "sheet_loss": entry.sheet_loss,
    }
    if math.isfinite(density):
        changes |= {"radar_mirror": False, "absorption_db": 0.0}
    return changes


def _of_light(entry: MaterialEntry) -> dict[str, Any]:
    if entry.laser_density is None and entry.laser_db_per_m is None:
        return {}
    density = entry.laser_density or 0.0
    changes: dict[str, Any] = {
        "laser_density": density,
        "laser_db": entry.laser_db_per_m or 0.0,
    }
    if math.isfinite(density):
        changes |= {"laser_mirror": False, "laser_absorption_db": 0.0}
    return changes


def _of_surface(entry: MaterialEntry) -> dict[str, Any]:
    said = {
        "solid": entry.solid,
        "absorption_db": entry.absorption_db,
        "laser_absorption_db": entry.laser_absorption_db,
    }
    if entry.mirror is not None:
        said["radar_mirror"] = entry.mirror in ("radar", "both")
        said["laser_mirror"] = entry.mirror in ("laser", "both")
    return {key: value for key, value in said.items() if value is not None}


def surface_problems(entry: MaterialEntry, material: Material) -> Iterator[Problem]:
    """Check that what an entry says of a surface is said of what ends beams there."""
    for wave, key, density in (
        ("radar", "absorption_db", material.density),
        ("laser", "laser_absorption_db", material.laser_density),
    ):
        expected = f"expected only of what is opaque to a {wave}"
        if math.isinf(density):
            continue
        if getattr(entry, key):
            yield (key,), f"{getattr(entry, key):g}, {expected}"
        if entry.mirror in (wave, "both"):
            yield ("mirror",), f"{shown(entry.mirror)}, {expected}"


def air_problems(material: Material) -> Iterator[Problem]:
    """Check that beams and robots can be in a material everywhere."""
    wrong = [
        text
        for text, so in (
            ("opaque to a radar", math.isinf(material.density)),
            ("opaque to a laser", math.isinf(material.laser_density)),
            ("a sheet", material.sheet_loss is not None),
            ("solid", material.solid),
        )
        if so
    ]
    if wrong:
        expected = "expected what beams and robots can be in"
        yield (), f"{shown(material.name)} is {' and '.join(wrong)}, {expected}"


# Section from scene.placing.
# Where the copies of a repeated or scattered object stand.

_TRIES = 200  # darts thrown for each copy, before the area counts as full


@dataclass(frozen=True, eq=False)
class Copy:
    """One of an object's copies: its name, its origin, (3,) m, and its size factor."""

    name: str
    position: Floats
    scale: float = 1.0


class NoRoom(Exception):
    """The area is too small for so many copies so far apart."""


def copy_names(name: str, count: int | None) -> Iterator[str]:
    """Give the names of an object's copies: ``name_1``, ``name_2``; one is just itself.

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

    Scattered places come from the entry's own seed and name, one after the other, so
    that a larger count leaves the first ones where they are.

    Raises:
        NoRoom: If scattered copies do not find room.
    """
    origin = np.array(entry.position, dtype=np.float64)
    if entry.scatter is not None:
        return list(_scattered(entry.name, origin, entry.scatter))
    step = np.array(entry.repeat.step) if entry.repeat else np.zeros(3)
    names = copy_names(entry.name, entry.copies)
    return [Copy(name, origin + i * step) for i, name in enumerate(names)]


def _scattered(name: str, origin: Floats, scatter: ScatterEntry) -> Iterator[Copy]:
    rng = generator_for(scatter.seed, "scatter", name)
    low, high = np.array(scatter.area)
    smallest, largest = scatter.scale
    places = np.full((scatter.count, 2), np.inf)
    for number, copy_name in enumerate(copy_names(name, scatter.count)):
        for _ in range(_TRIES):
            place = rng.uniform(low, high)
            gaps = np.linalg.norm(places[:number] - place, axis=1)
            if gaps.min(initial=np.inf) >= scatter.min_distance:
                break
        else:
            raise NoRoom(f"room for {number} copies, expected {scatter.count}")
        places[number] = place
        scale = rng.uniform(smallest, largest)
        yield Copy(copy_name, origin + np.append(place, 0.0), scale)


# Section from scene.build.
# From a map's object to its parts, in the map frame.

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
