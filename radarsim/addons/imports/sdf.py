"""Worlds of Gazebo: the collision shapes of their models.

Source: the specification of SDFormat 1.11, and how it resolves poses.
"""

import itertools
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from scipy.spatial.transform import Rotation

from radarsim.addons.imports.commands import ImportOptions
from radarsim.addons.imports.imported_map import ImportedMap
from radarsim.addons.imports.mesh_copies import KNOWN, MeshCopies
from radarsim.addons.imports.source_file import find_in
from radarsim.errors import MissingPackage, install_command
from radarsim.geometry import Pose3
from radarsim.scene.mesh_files import MeshError
from radarsim.validation import short_repr
from radarsim.xml_reader import XmlElement, parse_numbers, read_xml, wrong

MAX_LEVELS: Final = 100  # of models and includes in each other
MAX_INCLUDES: Final = 20_000  # in all files
LEFT_OUT: Final = ("light", "road", "population", "actor", "state")  # of a world
HERE: Final = ("", "world", "__model__")
# Folders of resources that Gazebo searches, which --model-path names here.
SEARCHED: Final = ("model://", "package://", "file://")
# Worlds of Gazebo have them; there is always a floor here, and light.
ALWAYS_THERE: Final = ("model://sun", "model://ground_plane")


class _LeftOut(Exception):
    """Something is left out.

    Attributes:
        line: Where it is.
        reason: What is counted in the summary, in words that follow a number; empty
            for what is not missed.
    """

    def __init__(self, element: XmlElement, text: str, reason: str) -> None:
        super().__init__(text)
        self.line = element.line
        self.reason = reason


def import_sdf(path: Path, options: ImportOptions, meshes: str) -> ImportedMap:
    """Import a world.

    Args:
        path: The file.
        options: What it does not tell.
        meshes: Name of the folder beside the map that its meshes are copied into.

    Raises:
        ForeignFileError: If it cannot be read, or is no SDF.
    """
    imported = ImportedMap(path, options)
    root = read_xml(path)
    if root.tag != "sdf":
        text = f"<{short_repr(root.tag)[1:-1]}>, expected <sdf>"
        raise wrong(path, root.line, text)
    copies = MeshCopies(imported, meshes)
    importer = _SdfFile(path, imported, copies, (), itertools.count(1))
    for world in root.all("world"):
        importer.add_all(world, Pose3(0.0, 0.0, 0.0), "", 0)
    importer.add_all(root, Pose3(0.0, 0.0, 0.0), "", 0)
    return imported


class _SdfFile:
    """Adds the models of one file to a map."""

    def __init__(
        self,
        path: Path,
        imported: ImportedMap,
        copies: MeshCopies,
        included_by: tuple[Path, ...],
        includes: Iterator[int],
    ) -> None:
        self._path = path
        self._map = imported
        self._copies = copies
        # By resolved paths: two links to one file are the same file.
        self._files = (*included_by, path.resolve())
        self._includes = includes  # counts those of all files

    def add_all(self, parent: XmlElement, pose: Pose3, prefix: str, level: int) -> None:
        """Add the models of a world, a model or a file, whose pose is given."""
        if level > MAX_LEVELS:
            text = f"more than {MAX_LEVELS} models and includes in each other"
            raise wrong(self._path, parent.line, text)
        for child in parent.children:
            try:
                if child.tag == "model":
                    self._add_model(child, pose, prefix, level)
                elif child.tag == "include":
                    self._include(child, pose, prefix, level)
                elif child.tag in LEFT_OUT:
                    text = f"<{child.tag}> is left out"
                    self._map.note(self._path, child.line, text)
            except _LeftOut as error:
                self._map.note(self._path, error.line, str(error))
                if error.reason:
                    self._map.count_model([error.reason])

    def _add_model(
        self, model: XmlElement, outer: Pose3, prefix: str, level: int
    ) -> None:
        place = self._pose(model, outer)
        if model.text_of("static") not in ("true", "1") and not prefix:
            text = f"the model {model.name!r} stands still here"
            self._map.note(self._path, model.line, text)
        name = f"{prefix}{model.name}"
        reasons, added, has_ground = [], 0, False
        for link in model.all("link"):
            for collision in link.all("collision"):
                # Often all three are the same name, which is written once then.
                names = "_".join(dict.fromkeys((name, link.name, collision.name)))
                try:
                    placed = self._pose(collision, self._pose(link, place))
                    self._map.add(names, self._shape(collision), placed)
                    added += 1
                except _LeftOut as error:
                    text = f"{short_repr(names)}: {error}"
                    self._map.note(self._path, error.line, text)
                    has_ground |= not error.reason
                    reasons += [error.reason] * bool(error.reason)
        inner = [each for each in model.children if each.tag in ("model", "include")]
        if not (reasons or added or has_ground or inner):
            text = f"the model {name!r} is left out: it has no collision"
            self._map.note(self._path, model.line, text)
            reasons = ["without a collision"]
        if reasons or added:
            self._map.count_model(reasons, added)
        self.add_all(model, place, f"{name}_", level + 1)

    def _shape(self, collision: XmlElement) -> dict[str, object]:
        """Return the keys of a map file for the shape of a collision."""
        geometry = collision.first("geometry")
        if geometry is None or not geometry.children:
            text = "a collision without a shape is left out"
            raise _LeftOut(collision, text, "without a shape")
        element = geometry.children[0]

        def sizes(tag: str, count: int = 1) -> list[float]:
            found = element.first(tag)
            if found is None:
                raise wrong(self._path, element.line, f"expected <{tag}>")
            values = parse_numbers(self._path, found.line, found.text, count)
            if min(values) <= 0:
                text = f"<{tag}> {found.text.strip()[:80]}, expected more than 0"
                raise wrong(self._path, found.line, text)
            return values

        match element.tag:
            case "box":
                return {"box": sizes("size", 3)}
            case "sphere":
                return {"sphere": sizes("radius")[0]}
            case "cylinder":
                return {"cylinder": [*sizes("radius"), *sizes("length")]}
            case "mesh":
                return self._mesh(element)
            case "plane":
                text = "<plane> is left out: robots drive at z = 0 as well"
                raise _LeftOut(element, text, "")
            case other:
                text = f"<{other[:40]}> is left out"
                raise _LeftOut(element, text, f"with <{other[:40]}>")

    def _mesh(self, mesh: XmlElement) -> dict[str, object]:
        uri = mesh.text_of("uri")
        text = f"the mesh {uri!r} is left out"
        file, suffix = self._find(mesh, text), Path(uri).suffix.lower()
        if not file.is_file() or suffix not in KNOWN:
            told = f"{text}, expected {', '.join(KNOWN)}"
            raise _LeftOut(mesh, told, f"{suffix[:20] or 'files'} that are not read")
        given = mesh.text_of("scale") or "1 1 1"
        scale = parse_numbers(self._path, mesh.line, given, 3)
        if 0 in scale:
            raise _LeftOut(mesh, f"{text}: a scale of 0", "with a scale of 0")
        part = mesh.first("submesh")
        named = part.text_of("name") if part else ""
        centred = part is not None and part.text_of("center") in ("true", "1")
        try:
            return self._copies.add(file, scale, named, centred=centred)
        except MeshError as error:
            reason = f"{suffix} that cannot be used"
            raise _LeftOut(mesh, f"{text}: {error}", reason) from error
        except MissingPackage as error:
            cure = install_command("collada")
            reason = f"{suffix} without pycollada ({cure})"
            raise _LeftOut(
                mesh, f"{text}: pycollada is not installed", reason
            ) from error

    def _include(
        self, include: XmlElement, outer: Pose3, prefix: str, level: int
    ) -> None:
        uri, named = include.text_of("uri"), include.text_of("name")
        known = " of ".join(repr(each) for each in (named, uri) if each)
        file = self._find(include, f"the model {known} is left out")
        if file.is_dir():
            file = file / "model.sdf"
        if file.resolve() in self._files:
            raise wrong(self._path, include.line, f"{uri!r} includes itself")
        # Includes of includes could double at each level.
        if next(self._includes) > MAX_INCLUDES:
            text = f"more than {MAX_INCLUDES} includes, expected fewer"
            raise wrong(self._path, include.line, text)
        place = self._pose(include, outer)
        root = read_xml(file)
        # Its own folder is where its meshes are, not that of the world.
        other = _SdfFile(file, self._map, self._copies, self._files, self._includes)
        for model in root.all("model"):
            if named:
                model.attributes["name"] = named
            if include.first("pose") is not None:  # it replaces that of the model
                model.children = [each for each in model.children if each.tag != "pose"]
        other.add_all(root, place, prefix, level + 1)

    def _find(self, element: XmlElement, text: str) -> Path:
        """Return the file or folder that the URI of an element names."""
        uri = element.text_of("uri")
        scheme = next((each for each in SEARCHED if uri.startswith(each)), "")
        folders = self._map.options.model_path if scheme else (self._path.parent,)
        found = None
        if scheme or "://" not in uri:
            found = find_in(folders, uri.removeprefix(scheme))
        if found is None or (found.is_dir() and not (found / "model.sdf").is_file()):
            reason = "not found (see --model-path)" if scheme else "not found"
            missed = "" if uri in ALWAYS_THERE else reason
            raise _LeftOut(element, f"{text}: {reason}", missed)
        return found

    def _pose(self, element: XmlElement, outer: Pose3) -> Pose3:
        """Return the pose of an element."""
        found = element.first("pose")
        if found is None:
            return outer
        relative = found.attributes.get("relative_to", "")
        if relative not in HERE:
            told = f"its pose is relative to {relative!r}"
            text = f"<{element.tag}> {element.name!r} is left out: {told}"
            raise _LeftOut(found, text, "with a pose that is relative to something")
        text = found.text.strip()
        if not text:
            return outer.compose(Pose3(0.0, 0.0, 0.0))
        if found.attributes.get("rotation_format") == "quat_xyzw":
            x, y, z, *quaternion = parse_numbers(self._path, found.line, text, 7)
            if not any(quaternion):
                raise wrong(self._path, found.line, "a quaternion of length 0")
            yaw, pitch, roll = map(
                float, Rotation.from_quat(quaternion).as_euler("ZYX")
            )
        else:
            x, y, z, roll, pitch, yaw = parse_numbers(self._path, found.line, text, 6)
            if found.attributes.get("degrees") in ("true", "1"):
                roll, pitch, yaw = map(math.radians, (roll, pitch, yaw))
        return outer.compose(Pose3(x, y, z, roll, pitch, yaw))
