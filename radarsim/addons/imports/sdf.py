"""Worlds of Gazebo: the collision shapes of their models.

Source: the specification of SDFormat 1.11, and how it resolves poses. XML is read as
trees whose elements know their lines. What a file declares of itself, such as entities,
is refused: a few lines of it could become gigabytes, or the content of other files.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final
from xml.parsers import expat

from scipy.spatial.transform import Rotation

from radarsim.addons.imports.commands import ImportOptions
from radarsim.addons.imports.imported_map import ImportedMap
from radarsim.addons.imports.source_file import (
    find_in,
    parse_numbers,
    read_bytes,
    wrong,
)
from radarsim.errors import ForeignFileError
from radarsim.geometry import Pose3
from radarsim.validation import short_repr

MAX_DEPTH: Final = 100
MAX_ELEMENTS: Final = 500_000


@dataclass(slots=True, eq=False)
class XmlElement:
    """An element.

    Attributes:
        tag: Its name.
        attributes: Its attributes.
        line: Where it begins.
        text: All text directly in it.
        children: The elements directly in it.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    text: str = ""
    children: list["XmlElement"] = field(default_factory=list)

    def all(self, tag: str) -> Iterator["XmlElement"]:
        """Yield the elements of a name directly in it."""
        return (child for child in self.children if child.tag == tag)

    def first(self, tag: str) -> "XmlElement | None":
        """Return the first element of a name directly in it, or None."""
        return next(self.all(tag), None)

    def text_of(self, tag: str) -> str:
        """Return the text of the first element of a name; empty if there is none."""
        found = self.first(tag)
        return found.text.strip() if found else ""

    @property
    def name(self) -> str:
        """Its attribute ``name``, or its tag."""
        return self.attributes.get("name") or self.tag


def is_xml(path: Path) -> bool:
    """Return whether a file begins as XML does, with a less-than sign.

    Raises:
        ForeignFileError: If it cannot be read, or is too large.
    """
    before = b"\xef\xbb\xbf\xff\xfe\0 \t\r\n"  # marks of encodings, and blanks
    return read_bytes(path).lstrip(before).startswith(b"<")


def read_xml(path: Path) -> XmlElement:
    """Read a file, and return its outermost element.

    Raises:
        ForeignFileError: If it cannot be read, is no XML, declares a document type, or
            is too large.
    """
    parser = expat.ParserCreate()
    root: XmlElement | None = None
    open_: list[XmlElement] = []
    count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal root, count
        element = XmlElement(tag, attributes, parser.CurrentLineNumber)
        count += 1
        if len(open_) >= MAX_DEPTH or count > MAX_ELEMENTS:
            text = f"more than {MAX_DEPTH} levels or {MAX_ELEMENTS} elements"
            raise wrong(path, element.line, text)
        if open_:
            open_[-1].children.append(element)
        else:
            root = element
        open_.append(element)

    def end(_: str) -> None:
        open_.pop()

    def add_text(text: str) -> None:
        open_[-1].text += text

    def refuse(*_: object) -> None:
        # Entities, which a document type declares, could become gigabytes.
        raise wrong(path, parser.CurrentLineNumber, "a document type, expected none")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = add_text
    parser.StartDoctypeDeclHandler = refuse
    # Else expat calls for each line of a text, which is added to slowly.
    parser.buffer_text = True
    try:
        parser.Parse(read_bytes(path), True)
    except expat.ExpatError as error:
        reason = expat.errors.messages[error.code]
        raise wrong(path, error.lineno, f"no XML: {reason}") from error
    except ValueError as error:  # an encoding that is not known
        raise wrong(path, 1, f"no XML: {error}") from error
    if root is None:
        raise ForeignFileError(f"{path}:1: no XML")
    return root


MAX_INCLUDES: Final = 10  # in each other
MESHES: Final = (".glb", ".gltf", ".obj", ".stl", ".ply")
LEFT_OUT: Final = ("light", "road", "population", "actor", "state")  # of a world
HERE: Final = ("", "world", "__model__")
_MODEL: Final = "model://"


def import_sdf(path: Path, options: ImportOptions, folder: Path) -> ImportedMap:
    """Import a world.

    Args:
        path: The file.
        options: What it does not tell.
        folder: Folder of the map, which has to contain all meshes.

    Raises:
        ForeignFileError: If it cannot be read, or is no SDF.
    """
    imported = ImportedMap(path, options)
    root = read_xml(path)
    if root.tag != "sdf":
        text = f"<{short_repr(root.tag)[1:-1]}>, expected <sdf>"
        raise wrong(path, root.line, text)
    importer = _SdfFile(path, imported, folder.resolve(), ())
    for world in root.all("world"):
        importer.add_all(world, Pose3(0.0, 0.0, 0.0), "")
    importer.add_all(root, Pose3(0.0, 0.0, 0.0), "")
    return imported


class _SdfFile:
    """Adds the models of one file to a map."""

    def __init__(
        self,
        path: Path,
        imported: ImportedMap,
        folder: Path,
        included_by: tuple[Path, ...],
    ) -> None:
        self._path = path
        self._map = imported
        self._folder = folder
        # By resolved paths: two links to one file are the same file.
        self._files = (*included_by, path.resolve())

    def add_all(self, parent: XmlElement, pose: Pose3, prefix: str) -> None:
        """Add the models of a world, a model or a file, whose pose is given."""
        for child in parent.children:
            if child.tag == "model":
                self._add_model(child, pose, prefix)
            elif child.tag == "include":
                self._include(child, pose, prefix)
            elif child.tag in LEFT_OUT:
                self._note(child, f"<{child.tag}> is left out")

    def _add_model(self, model: XmlElement, outer: Pose3, prefix: str) -> None:
        place = self._pose(model, outer)
        if place is None:
            return
        if model.text_of("static") not in ("true", "1") and not prefix:
            self._note(model, f"the model {model.name!r} stands still here")
        name = f"{prefix}{model.name}"
        for link in model.all("link"):
            pose = self._pose(link, place)
            if pose is None:
                continue
            for collision in link.all("collision"):
                placed = self._pose(collision, pose)
                geometry = collision.first("geometry")
                if placed is None:
                    continue
                if geometry is None or not geometry.children:
                    self._note(collision, "a collision without a shape is left out")
                    continue
                shape = self._shape(geometry.children[0])
                if shape is not None:
                    # Often all three are the same name, which is written once then.
                    names = dict.fromkeys((name, link.name, collision.name))
                    self._map.add("_".join(names), shape, placed)
        self.add_all(model, place, f"{name}_")

    def _shape(self, element: XmlElement) -> dict[str, object] | None:
        """Return the keys of a map file for a shape; None if it is left out."""

        def sizes(tag: str, count: int = 1) -> list[float]:
            found = element.first(tag)
            if found is None:
                raise wrong(self._path, element.line, f"expected <{tag}>")
            values = parse_numbers(self._path, found.line, found.text, count)
            if min(values) <= 0:
                text = f"<{tag}> {found.text.strip()[:80]}, expected more than 0"
                raise wrong(self._path, found.line, text)
            return values

        shapes: dict[str, Callable[[], dict[str, object] | None]] = {
            "box": lambda: {"box": sizes("size", 3)},
            "sphere": lambda: {"sphere": sizes("radius")[0]},
            "cylinder": lambda: {"cylinder": [*sizes("radius"), *sizes("length")]},
            "mesh": lambda: self._mesh(element),
        }
        if element.tag in shapes:
            return shapes[element.tag]()
        reason = ": robots drive at z = 0 as well" if element.tag == "plane" else ""
        self._note(element, f"<{element.tag}> is left out{reason}")
        return None

    def _mesh(self, mesh: XmlElement) -> dict[str, object] | None:
        uri = mesh.text_of("uri")
        if not uri.lower().endswith(MESHES):
            expected = ", ".join(MESHES)
            self._note(mesh, f"the mesh {uri!r} is left out, expected {expected}")
            return None
        scale = parse_numbers(
            self._path, mesh.line, mesh.text_of("scale") or "1 1 1", 3
        )
        if len(set(scale)) > 1 or scale[0] <= 0 or mesh.first("submesh"):
            self._note(mesh, f"the mesh {uri!r} is left out: scales differ, or a part")
            return None
        file = self._find(uri)
        # A map reads meshes from its own folder only, so that a map of others opens no
        # other files.
        if file is None or not file.is_relative_to(self._folder):
            reason = "is not there" if file is None else "is not below the map's folder"
            self._note(mesh, f"the mesh {uri!r} is left out: it {reason}")
            return None
        keys: dict[str, object] = {"mesh": file.relative_to(self._folder).as_posix()}
        return keys if scale[0] == 1 else {**keys, "scale": scale[0]}

    def _include(self, include: XmlElement, outer: Pose3, prefix: str) -> None:
        uri = include.text_of("uri")
        file = self._find(uri)
        if file is not None and file.is_dir():
            file = file / "model.sdf"
        if file is None or not file.is_file():
            cure = "see --model-path" if uri.startswith(_MODEL) else "no such file"
            self._note(include, f"the model {uri!r} is left out: {cure}")
            return
        place = self._pose(include, outer)
        if place is None:
            return
        if file.resolve() in self._files or len(self._files) > MAX_INCLUDES:
            raise wrong(self._path, include.line, f"{uri!r} includes itself")
        root = read_xml(file)
        named = include.text_of("name")
        # Its own folder is where its meshes are, not that of the world.
        other = _SdfFile(file, self._map, self._folder, self._files)
        for model in root.all("model"):
            if named:
                model.attributes["name"] = named
            if include.first("pose") is not None:  # it replaces that of the model
                model.children = [each for each in model.children if each.tag != "pose"]
        other.add_all(root, place, prefix)

    def _find(self, uri: str) -> Path | None:
        """Return the file or folder that a URI names; None if there is none."""
        if uri.startswith(_MODEL):
            reference = uri.removeprefix(_MODEL)
            folders = self._map.options.model_path
        elif "://" in uri:
            return None
        else:
            reference, folders = uri, (self._path.parent,)
        return find_in(folders, reference)

    def _pose(self, element: XmlElement, outer: Pose3) -> Pose3 | None:
        """Return the pose of an element; None if it is left out."""
        found = element.first("pose")
        if found is None:
            return outer
        relative = found.attributes.get("relative_to", "")
        if relative not in HERE:
            text = f"its pose is relative to {relative!r}"
            self._note(found, f"<{element.tag}> {element.name!r} is left out: {text}")
            return None
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

    def _note(self, element: XmlElement, text: str) -> None:
        self._map.note(self._path, element.line, text)
