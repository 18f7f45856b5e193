"""Builds materials, and the parts of objects and their copies, from a map's entries.

The mesh readers are imported when the first mesh is read, since few maps have meshes.
"""

import math
from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np

from radarsim.errors import MAX_NAMES, expected_one_of
from radarsim.geometry import Floats, rotation_matrix
from radarsim.rng import generator_for
from radarsim.scene.map_checks import Problem
from radarsim.scene.map_schema import (
    MAX_EXTENT,
    MAX_OBJECTS,
    MAX_PARTS,
    MaterialKeys,
    ObjectEntry,
    ScatterEntry,
)
from radarsim.scene.material import PLAIN_KEYS, Material, library_material
from radarsim.scene.mesh_files import (
    MAX_TRIANGLES,
    MeshBudget,
    MeshError,
    find_inside,
)
from radarsim.scene.scene import POINT_EDGE, REFLECTOR, Part, Reflector
from radarsim.scene.shapes import (
    Faces,
    Mesh,
    Surface,
    box,
    cylinder,
    octahedron,
    sphere,
)
from radarsim.validation import short_repr

LIMITS: Final = {
    "objects": MAX_OBJECTS,
    "parts": MAX_PARTS,
    "triangles": MAX_TRIANGLES,
}

MAX_ATTEMPTS: Final = 200  # random positions for a copy, before the area counts as full
CELLS_ALONG: Final = 10_000  # largest number of grid cells along an area's longer side

_COLUMN: Final = 4 * CELLS_ALONG  # index stride between columns, above the cell count
_AROUND: Final = [i * _COLUMN + j for i in (-1, 0, 1) for j in (-1, 0, 1)]
_DRAWS: Final = 1000  # random numbers per call of the generator

_Position: TypeAlias = tuple[float, float]
_Copy: TypeAlias = tuple[str, Floats, float]
_Piece: TypeAlias = tuple[Material, Mesh]


class BuildError(Exception):
    """An object of a map cannot be built.

    Attributes:
        problems: Keys inside the object, each with a message about its value.
    """

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__(problems)
        self.problems = problems


def make_material(
    name: str, entry: MaterialKeys, base: Material | None = None
) -> Material:
    """Create a material from an entry and the library material that it is based on.

    Args:
        name: Name of the new material.
        entry: Validated keys of the material.
        base: Base material if the entry has no ``based_on``; None for the defaults.

    If an entry has any key of radar attenuation, these keys replace all radar
    attenuation of the base; the same holds for light. A material that beams enter has
    no mirror, and its surface absorbs nothing. A radar that computes in decibels keeps
    using the decibels of the base, unless the entry has its own.
    """
    base = base or Material(name)
    if entry.based_on is not None:
        library = library_material(
            entry.based_on, g_per_m3=entry.g_per_m3, mm_per_h=entry.mm_per_h
        )
        base = replace(library, name=name)
    given = entry.model_dump(exclude_none=True)
    changes: dict[str, Any] = {}
    if given.keys() & {"density", "db_per_m", "sheet_loss"}:
        changes["density"] = given.get("density", 0.0)
        changes["radar_db"] = given.get("db_per_m", (0.0, 0.0, 0.0))
        changes["sheet_loss"] = entry.sheet_loss
        if math.isfinite(changes["density"]):
            changes |= {"radar_mirror": False, "absorption_db": 0.0}
            changes["transmission_db"] = None
    if given.keys() & {"laser_density", "laser_db_per_m"}:
        changes["laser_density"] = given.get("laser_density", 0.0)
        changes["laser_db"] = given.get("laser_db_per_m", 0.0)
        if math.isfinite(changes["laser_density"]):
            changes |= {"laser_mirror": False, "laser_absorption_db": 0.0}
    if entry.mirror is not None:
        changes["radar_mirror"] = entry.mirror in ("radar", "both")
        changes["laser_mirror"] = entry.mirror in ("laser", "both")
        if not changes["radar_mirror"]:
            changes["transmission_db"] = None  # only mirrors can be panes
    # A density, which is specific to one experiment, cannot be converted to decibels.
    # If only a density is given, a radar that computes in decibels uses the losses of
    # the base material.
    has_density = math.isfinite(given.get("density", math.inf))
    if has_density and any(base.radar_db) and not (entry.db_per_m or entry.sheet_loss):
        changes["attenuation_db"] = base.radar_db
    if "absorption_db" in given:  # absorbed power is missing from the echo
        absorbed = given["absorption_db"]
        changes["backscatter_db"] = base.backscatter_db - absorbed
        if base.specular_db is not None:
            changes["specular_db"] = base.specular_db - absorbed
    changes |= {key: value for key, value in given.items() if key in PLAIN_KEYS}
    return replace(base, **changes)


class Budget:
    """Counters of objects, parts and triangles in a scene or a file, with limits."""

    def __init__(self, limits: Mapping[str, int] = LIMITS) -> None:
        """Start all counters at 0; ``limits`` maps each kind to its largest count."""
        self._limits = limits
        self._taken = dict.fromkeys(limits, 0)

    def take(self, count: int, what: str) -> None:
        """Count more objects, parts or triangles; the total must not exceed the limit.

        Raises:
            BuildError: If the new total exceeds the limit.
        """
        limit, taken = self._limits[what], self._taken[what]
        if taken + count > limit:
            expected = f"expected at most {limit} in all, {limit - taken} are left"
            raise BuildError([((), f"{count} {what}, {expected}")])
        self._taken[what] += count


class PartBuilder:
    """Builds the parts of a map's objects, and reads each mesh file once."""

    def __init__(self, folder: Path) -> None:
        """Create a builder that has read no mesh file yet.

        Args:
            folder: The map's own folder, links resolved.
        """
        self._folder = folder
        self._budget = MeshBudget()
        self._surfaces: dict[str, list[Surface] | MeshError] = {}
        self._joined: dict[tuple[object, ...], list[_Piece]] = {}

    def build(
        self, entry: ObjectEntry, materials: Mapping[str, Material], room: Budget
    ) -> list[Part]:
        """Build the parts of an object: one for each pair of a copy and a material.

        Args:
            entry: The object, with one shape.
            materials: The materials that the object refers to, by name.
            room: Counters of the scene; the object's parts and triangles are added.

        Raises:
            BuildError: If the mesh cannot be used, the copies do not fit into their
                area, or the object is too large.
        """
        pieces = self._pieces(entry, materials)
        # Parts and triangles are counted before any copy is placed, since an entry of
        # a few bytes can request millions of triangles.
        count = entry.copies or 1
        room.take(count * len(pieces), "parts")
        room.take(count * sum(len(faces) for _, (_, faces) in pieces), "triangles")
        copies = place_copies(entry)  # after the counts, since many copies take long
        rotation = rotation_matrix(*entry.angles()).T
        parts = [
            Part(
                name,
                material,
                # The order of these operations must not change, since it determines the
                # last digits of ranges.
                scale * vertices @ rotation + position,
                faces,
            )
            for name, position, scale in copies
            for material, (vertices, faces) in pieces
        ]
        extent = np.abs([part.bounds for part in parts]).max()
        if extent > MAX_EXTENT:
            expected = f"expected at most {MAX_EXTENT:g}"
            raise BuildError(
                [((), f"{extent:.1f} m from the map's origin, {expected} m")]
            )
        return parts

    def _pieces(
        self, entry: ObjectEntry, materials: Mapping[str, Material]
    ) -> list[_Piece]:
        """Return the unrotated meshes of an object, in m, each with its material."""
        if entry.reflector is not None:
            return [(REFLECTOR, octahedron(entry.reflector.trihedral or POINT_EDGE))]
        if entry.mesh is None:
            if entry.box is not None:
                mesh = box(*entry.box)
            elif entry.cylinder is not None:
                mesh = cylinder(*entry.cylinder)
            else:
                mesh = sphere(entry.sphere or 0.0)
            return [(materials[entry.material or ""], mesh)]
        pieces = []
        for material, (vertices, faces) in self._mesh(entry, entry.mesh, materials):
            scaled = vertices * entry.scale
            if entry.up_axis == "y":
                x, y, z = scaled.T
                scaled = np.column_stack([x, -z, y])
            pieces.append((material, (scaled, faces)))
        return pieces

    def _mesh(
        self, entry: ObjectEntry, mesh: str, materials: Mapping[str, Material]
    ) -> list[_Piece]:
        """Return a mesh for each material of a mesh file, in the frame of the file."""
        # Meshes are cached, since joining a large mesh takes seconds. The cache key
        # contains the materials, not only their names, because a variant of the map can
        # redefine a material and so require a closed volume.
        given = tuple((entry.materials or {}).items())
        key = (mesh, entry.material, given, *materials.values())
        if key not in self._joined:
            pieces: list[_Piece] = []
            problems: list[Problem] = []
            for name, members in _group_by_material(entry, self._read(mesh)).items():
                try:
                    pieces.append((materials[name], _join(materials[name], members)))
                except MeshError as error:
                    problems.append((("mesh",), f"{mesh!r}: {error}"))
            if problems:
                raise BuildError(problems)
            self._joined[key] = pieces
        return self._joined[key]

    def _read(self, mesh: str) -> list[Surface]:
        from radarsim.scene.meshes import read_surfaces  # noqa: PLC0415
        from radarsim.scene.topology import weld_vertices  # noqa: PLC0415 - see above

        if mesh not in self._surfaces:
            try:  # Errors are cached too: many objects may use the same broken file.
                path = find_inside(self._folder, self._folder, mesh)
                surfaces = read_surfaces(path, self._folder, self._budget)
                # Merging equal vertices reduces the vertices of an STL file to about a
                # sixth.
                self._surfaces[mesh] = [
                    Surface(material, *weld_vertices(vertices, faces))
                    for material, vertices, faces in surfaces
                ]
            except MeshError as error:
                self._surfaces[mesh] = error
        found = self._surfaces[mesh]
        if isinstance(found, MeshError):
            raise BuildError([(("mesh",), str(found))]) from found
        return found


def make_reflectors(entry: ObjectEntry) -> list[Reflector]:
    """Create the point reflectors of an object and its copies.

    The list is empty if the object is not a reflector.

    Raises:
        BuildError: If the copies do not fit into their area.
    """
    if entry.reflector is None:
        return []
    trihedral, rcs_dbsm = entry.reflector.trihedral, entry.reflector.rcs_dbsm
    reflectors = []
    for name, position, scale in place_copies(entry):
        x, y, z = position.tolist()
        edge = None if trihedral is None else scale * trihedral
        reflectors.append(Reflector(name, (x, y, z), edge, rcs_dbsm))
    return reflectors


def _join(material: Material, surfaces: list[Surface]) -> Mesh:
    """Join surfaces into one mesh, which must be closed if beams can enter it."""
    from radarsim.scene.meshes import join_surfaces, join_volume  # noqa: PLC0415

    may_be_open = not material.penetrable or material.sheet_loss is not None
    try:
        vertices, faces = (join_surfaces if may_be_open else join_volume)(surfaces)
    except MeshError as error:
        expected = "expected a closed volume"
        reason = f"since beams enter {material.name!r}, which has no sheet_loss"
        raise MeshError(f"{error}, {expected}, {reason}") from error
    if not len(faces):
        raise MeshError(f"all triangles of {material.name!r} have an area of 0")
    return vertices, faces


def orient_for(material: Material, vertices: Floats, faces: Faces) -> Mesh:
    """Return a mesh with outward faces if beams can enter its material.

    Raises:
        BuildError: If beams can enter the material and the mesh is not closed.
    """
    try:
        return _join(material, [Surface(None, vertices, faces)])
    except MeshError as error:
        raise BuildError([((), str(error))]) from error


def _group_by_material(
    entry: ObjectEntry, surfaces: list[Surface]
) -> dict[str, list[Surface]]:
    """Group the surfaces of a mesh file by the map's name of their material."""
    if entry.material is not None:
        return {entry.material: surfaces}
    given = entry.materials or {}
    in_file = {surface.material or "" for surface in surfaces}
    named = sorted(in_file - {""})
    problems: list[Problem] = [
        (("materials",), f"no material for {short_repr(name)} in the mesh file")
        for name in named
        if name not in given
    ]
    if "" in in_file - given.keys():
        text = "the mesh has parts without a material, expected 'material'"
        problems.insert(0, (("materials",), text))
    unknown = [name for name in given if name not in in_file]
    problems += [
        (("materials", name), expected_one_of(name, named))
        for name in unknown[:MAX_NAMES]  # since the search for similar names is slow
    ]
    if len(unknown) > MAX_NAMES:
        text = f"{len(unknown) - MAX_NAMES} more names that are not in the mesh file"
        problems.append((("materials",), text))
    if problems:
        raise BuildError(problems)
    groups: dict[str, list[Surface]] = {}
    for surface in surfaces:
        groups.setdefault(given[surface.material or ""], []).append(surface)
    return groups


def copy_names(name: str, count: int | None) -> Iterator[str]:
    """Yield ``name_1``, ``name_2`` and so on for copies, or just the object's name.

    Args:
        name: The object's own name.
        count: Number of copies; None for an object that is not repeated or scattered.
    """
    if count is None:
        yield name
    else:
        yield from (f"{name}_{number}" for number in range(1, count + 1))


def place_copies(entry: ObjectEntry) -> list[_Copy]:
    """Return name, position ((3,) m) and scale factor of each copy of an object.

    Scattered positions are drawn one after the other from a generator seeded with the
    entry's seed and name, so a larger count does not move the first copies.

    Raises:
        BuildError: If the area is too small for this number of copies at this distance.
    """
    origin = np.array(entry.position, dtype=np.float64)
    if entry.scatter is not None:
        return _scatter_copies(entry.name, origin, entry.scatter)
    step = np.array(entry.repeat.step) if entry.repeat else np.zeros(3)
    names = copy_names(entry.name, entry.copies)
    return [(name, origin + i * step, 1.0) for i, name in enumerate(names)]


def _scatter_copies(name: str, origin: Floats, scatter: ScatterEntry) -> list[_Copy]:
    # The generator depends on seed and name only, so adding an entry to the map does
    # not move the copies of other entries.
    draws = _draw_forever(generator_for(scatter.seed, "scatter", name))
    (left, lower), (right, upper) = scatter.area
    smallest, largest = scatter.scale
    width, height, spread = right - left, upper - lower, largest - smallest
    placed = _Neighbourhood(scatter.min_distance, max(width, height))
    offsets: list[tuple[float, float, float]] = []
    scales: list[float] = []
    for number in range(scatter.count):
        for _ in range(MAX_ATTEMPTS):
            x, y = left + width * next(draws), lower + height * next(draws)
            if placed.add(x, y, x - left, y - lower):
                break  # A scale is drawn only for a copy with an accepted position.
        else:
            text = f"the area is full after {number} copies, expected {scatter.count}"
            raise BuildError([(("scatter",), text)])
        offsets.append((x, y, 0.0))
        scales.append(smallest + spread * next(draws))
    names = copy_names(name, scatter.count)
    positions = origin + np.array(offsets)
    return list(zip(names, positions, scales, strict=True))


def _draw_forever(rng: np.random.Generator) -> Iterator[float]:
    """Yield random numbers without end, as repeated calls of ``rng.random()`` do."""
    while True:
        yield from rng.random(_DRAWS).tolist()


class _Neighbourhood:
    """A grid of positions that keep a minimum distance from each other.

    A cell is a little larger than the distance, so rounding cannot put a neighbour
    outside the 3 x 3 cells that are searched. The grid starts in the area's corner and
    scales with the area, so even a small area has few positions per cell.
    """

    def __init__(self, distance: float, side: float) -> None:
        """Create an empty grid.

        Args:
            distance: Minimum distance between positions, m; 0 accepts any.
            side: Length of the area's longer side, m.
        """
        self._distance = distance
        self._size = max(distance * 1.001, side / CELLS_ALONG)
        self._cells: defaultdict[int, list[_Position]] = defaultdict(list)

    def add(self, x: float, y: float, right: float, up: float) -> bool:
        """Add a position if no other is too near; return whether it was added.

        Args:
            x: East, m.
            y: North, m.
            right: Distance from the area's left side, m, at least 0.
            up: Distance from the area's lower side, m, at least 0.
        """
        least = self._distance
        if least == 0:
            return True
        cells = self._cells
        cell = int(right / self._size) * _COLUMN + int(up / self._size)
        for offset in _AROUND:
            for a, b in cells.get(cell + offset, ()):
                if math.sqrt((a - x) * (a - x) + (b - y) * (b - y)) < least:
                    return False
        cells[cell].append((x, y))
        return True
