"""Copies of meshes, which a map has beside it: GLB files, whatever the originals."""

import re
from pathlib import Path
from typing import Any, Final

import numpy as np

from radarsim.addons.imports.collada import read_collada
from radarsim.addons.imports.imported_map import ImportedMap
from radarsim.addons.imports.source_file import place, read_bytes
from radarsim.errors import ForeignFileError
from radarsim.scene.mesh_files import (
    MAX_FILE_BYTES,
    MAX_SURFACES,
    MAX_TRIANGLES,
    MeshBudget,
    MeshError,
    check_vertices,
)
from radarsim.scene.shapes import Mesh, concatenate

KNOWN: Final = (".dae", ".glb", ".gltf", ".obj", ".ply", ".stl")


class MeshCopies:
    """Makes the mesh files of a map; each original is read once."""

    def __init__(self, imported: ImportedMap, folder: str) -> None:
        """Begin with nothing.

        Args:
            imported: The map, which gets the files.
            folder: Name of the folder that they are in, beside the map.
        """
        self._map = imported
        self._folder = folder
        self._budget = MeshBudget()  # of all copies
        self._originals: dict[Path, list[tuple[str, Mesh]]] = {}
        self._made: dict[tuple[object, ...], tuple[str, int] | MeshError] = {}
        self._triangles = 0

    def add(
        self, file: Path, scale: list[float], part: str = "", *, centred: bool = False
    ) -> dict[str, object]:
        """Return the keys of a map file for a mesh, whose copy is made if need be.

        Args:
            file: The original.
            scale: Factors along its axes; negative ones mirror it.
            part: Name of the node that is used alone; empty for all.
            centred: Whether the middle of the bounding box becomes the origin.

        Raises:
            MeshError: If it cannot be used.
            MissingPackage: If it is a COLLADA file and pycollada is not installed.
        """
        # Forests consist of one tree in many sizes.
        uniform = scale[0] if len(set(scale)) == 1 and scale[0] > 0 else 1.0
        own = tuple(each / uniform for each in scale)
        key = (file, own, part, centred)
        if key not in self._made:
            try:
                meshes = self._placed(file, own, part, centred=centred)
                self._made[key] = self._write(file.stem, meshes)
            except MeshError as error:
                self._made[key] = error
        shape = self._shape(key)
        return shape if uniform == 1 else {**shape, "scale": uniform}

    def add_mesh(self, name: str, mesh: Mesh) -> dict[str, object]:
        """Return the keys of a map file for a mesh that no file has.

        Raises:
            MeshError: If no map can have it.
        """
        key = (name, *(array.tobytes() for array in mesh))
        if key not in self._made:
            self._made[key] = self._write(name, [mesh])
        return self._shape(key)

    def _shape(self, key: tuple[object, ...]) -> dict[str, object]:
        """Return the keys of one more object with a mesh that has been made."""
        made = self._made[key]
        if isinstance(made, MeshError):
            raise made
        name, count = made
        if self._triangles + count > MAX_TRIANGLES:
            raise MeshError(f"{count} more triangles, expected {MAX_TRIANGLES} in all")
        self._triangles += count
        return {"mesh": name, "up_axis": "y"}

    def _placed(
        self, file: Path, scale: tuple[float, ...], part: str, *, centred: bool
    ) -> list[Mesh]:
        """Return the meshes of a file, scaled and moved."""
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
        """Make a GLB file; return its path from the map, and its number of triangles.

        Raises:
            MeshError: If no map can have it.
        """
        import trimesh  # noqa: PLC0415 - slow, and not every world has meshes

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
            raise MeshError("no triangle has an area")
        content: bytes = scene.export(file_type="glb")
        self._budget.take(len(content), "bytes")
        stem = re.sub(r"[^\w-]", "_", stem, flags=re.ASCII)[:80]
        name = f"{stem}_{len(self._map.meshes) + 1}.glb"
        self._map.meshes[name] = content
        return f"{self._folder}/{name}", sum(len(faces) for _, faces in meshes)

    def _read(self, file: Path) -> list[tuple[str, Mesh]]:
        if file.suffix.lower() != ".dae":
            from radarsim.scene.meshes import read_surfaces  # noqa: PLC0415 - likewise

            found = read_surfaces(file, file.parent)
            meshes = [("", (each.vertices, each.faces)) for each in found]
        else:
            try:
                content = read_bytes(file, MAX_FILE_BYTES)
            except ForeignFileError as error:
                raise MeshError(str(error)) from error
            meshes, problems = read_collada(content)
            for problem in problems:
                self._map.notes.append(place(file, 1, f"left out: {problem}"))
        self._budget.take(sum(len(faces) for _, (_, faces) in meshes), "triangles")
        return meshes
