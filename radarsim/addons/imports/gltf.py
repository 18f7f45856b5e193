"""Imports a glTF file as one object, with materials from the extras of the file.

Source: the specification of glTF 2.0, 3.9 and 5.19. Any material may have ``extras``,
and Blender writes custom properties there.
"""

from pathlib import Path

from radarsim.addons.imports.cli import ImportOptions
from radarsim.addons.imports.imported_map import ImportedMap
from radarsim.addons.imports.source_file import read_bytes, wrong
from radarsim.errors import ForeignFileError
from radarsim.geometry import Pose3
from radarsim.scene.gltf import GltfFile, Material
from radarsim.scene.map_schema import MaterialEntry
from radarsim.scene.material import library_names
from radarsim.scene.mesh_files import MAX_FILE_BYTES, MeshBudget, MeshError, MeshFiles
from radarsim.scene.meshes import read_surfaces
from radarsim.validation import short_repr


def import_gltf(path: Path, options: ImportOptions, meshes: Path) -> ImportedMap:
    """Import a glTF file with materials from its extras or from the library.

    Args:
        path: The file, GLB or glTF.
        options: Options of the import.
        meshes: Folder for meshes next to the map; its parent has to contain the file.

    Raises:
        ForeignFileError: If the file cannot be read, is not below the folder of the
            map, or describes two materials of one name.
    """
    content = read_bytes(path, MAX_FILE_BYTES)
    folder = meshes.parent
    file, inside = path.resolve(), folder.resolve()
    if not file.is_relative_to(inside):
        raise wrong(path, 1, f"expected a file inside the map's folder {str(folder)!r}")
    try:
        names = sorted({each.material or "" for each in read_surfaces(file, inside)})
        files = MeshFiles(inside, inside, MeshBudget())
        # Surfaces contain the names of their materials but not the extras, so the file
        # is parsed a second time.
        described = GltfFile(content, file.suffix.lower(), files).materials
    except MeshError as error:
        reason = str(error).removeprefix(f"{file.name!r}: ")
        raise ForeignFileError(f"{path}:1: {reason}") from error
    imported = ImportedMap(path, options)
    own = imported.materials
    for material in described:
        if not material.name or material.name not in names:
            if material.extras:
                text = "the extras of a material that is unnamed or unused are ignored"
                imported.note(path, 1, text)
            continue
        keys = _known_keys(path, imported, material)
        # Material names of a map file are unique, so two materials with the same name
        # need the same extras.
        if keys and own.setdefault(material.name, keys) != keys:
            text = f"two materials are named {short_repr(material.name)}"
            raise wrong(path, 1, f"{text}, expected the same extras in both")
    materials = {}
    for name in names:  # patterns of the user have priority
        used = name or path.stem
        known = used if used in own or used in library_names() else None
        materials[name] = imported.material_of(used, known)
    mesh = file.relative_to(inside).as_posix()
    shape = {"mesh": mesh, "up_axis": "y", "materials": materials}
    imported.add(path.stem, shape, Pose3(0.0, 0.0, 0.0))
    return imported


def _known_keys(
    path: Path, imported: ImportedMap, material: Material
) -> dict[str, object]:
    """Return the extras that are keys of map materials, without checking the values."""
    extras = material.extras if isinstance(material.extras, dict) else {}
    name = short_repr(material.name)
    if material.extras is not None and material.extras is not extras:
        imported.note(path, 1, f"the extras of {name} are ignored: not a JSON object")
    known = MaterialEntry.model_fields.keys()
    for key in extras:
        if key not in known:
            text = f"{short_repr(key)} in the extras of {name} is ignored"
            imported.note(path, 1, text)
    return {key: value for key, value in extras.items() if key in known}
