"""Imports Gazebo worlds: the collision shapes of their models, or the visuals.

Sources: the specification of SDFormat 1.11, and the behaviour of Gazebo when it finds
models and restores the state of a world that was saved from its window.
"""

import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final
from urllib.parse import unquote

import numpy as np

from radarsim.addons.imports.cli import ImportOptions
from radarsim.addons.imports.imported_map import ImportedMap
from radarsim.addons.imports.sdf_frames import ORIGIN, Frames, LeftOut, parse_pose
from radarsim.addons.imports.sdf_shapes import MeshCopies, read_mesh, read_shape
from radarsim.addons.imports.source_file import XmlElement, find_in, read_xml
from radarsim.errors import ForeignFileError
from radarsim.geometry import Pose3
from radarsim.validation import short_repr

MAX_LEVELS: Final = 100  # depth of nested models and includes
MAX_INCLUDED: Final = 2_000_000  # number of elements in all includes
NEWEST: Final = (1, 12)  # SDFormat version; newer files are used if there are no others
LEFT_OUT: Final = ("road", "population", "actor")  # elements that are not imported
# URI schemes of files in Gazebo's resource folders; --model-path names these folders.
SEARCHED: Final = ("model://", "package://", "file://")
# Suns and ground planes are not imported: scanners need no light, and robots drive at z
# = 0.
_NOT_NEEDED: Final = re.compile(r".*/(sun|ground[ _]plane)(/[0-9]+|/tip)?")
_FUEL: Final = re.compile(
    r"https?://([^/]+)/(?:1\.0/)?([^/]+)/models/([^/]+)(?:/(\d+|tip))?(?:/files/(.*))?"
    r"/?"
)


@np.errstate(all="ignore")  # numbers that are not finite raise errors later
def import_sdf(path: Path, options: ImportOptions, meshes: Path) -> ImportedMap:
    """Import a Gazebo world as a map.

    Args:
        path: The file.
        options: Options of the import.
        meshes: Folder next to the map into which meshes are copied.

    Raises:
        ForeignFileError: If the file cannot be read, or is no SDF.
    """
    imported = ImportedMap(path, options)
    root = read_xml(path)
    if root.tag != "sdf":
        text = f"<{short_repr(root.tag)[1:-1]}>, expected <sdf>"
        raise root.wrong(text)
    importer = _Importer(imported, MeshCopies(imported, meshes.name))
    # Paths are resolved, so that two links to one file count as the same file.
    for scope in (*root.all("world"), root):
        state = scope.first("state")
        importer.add_all(scope, ORIGIN, "", (path.resolve(),), state)
        for each in state.children if state else ():
            if each.tag in ("insertions", "deletions") and each.children:
                imported.note(path, each.line, f"<{each.tag}> is left out")
                imported.others[f"<{each.tag}>"] += 1
    return imported


class _Importer:
    """Adds the models of a file, and of the files that it includes, to a map."""

    def __init__(self, imported: ImportedMap, copies: MeshCopies) -> None:
        self._map = imported
        self._copies = copies
        self._shapes = "visual" if imported.options.visuals else "collision"
        self._files: dict[Path, tuple[XmlElement | None, int]] = {}
        self._included = 0  # number of elements in all includes

    def add_all(
        self,
        scope: XmlElement,
        pose: Pose3,
        prefix: str,
        files: tuple[Path, ...],
        state: XmlElement | None,
        level: int = 0,
    ) -> None:
        """Add the models in a world, a model or a file to the map.

        Args:
            scope: Element of the world, the model or the file.
            pose: Pose of the scope.
            prefix: Prefix for the names of models in the scope.
            files: Chain of included files, of which the last contains the scope.
            state: The saved state of the scope, if there is one.
            level: Number of models around the scope.
        """
        if level > MAX_LEVELS:
            text = f"more than {MAX_LEVELS} levels of nested models and includes"
            raise scope.wrong(text)
        frames = Frames(scope, self._model_of)
        states = {each.name: each for each in state.all("model")} if state else {}
        for child in scope.children:
            try:
                if child.tag in ("model", "include"):
                    model, inside = child, files
                    if child.tag == "include":
                        model = self._model_of(child)
                        if model.path in files:
                            uri = child.text_of("uri")
                            raise child.wrong(f"{uri!r} includes itself")
                        inside = (*files, model.path)
                    saved = states.get(model.name)
                    place = pose.compose(frames.pose(model))
                    self._add_model(model, place, prefix, inside, saved, level)
                elif child.tag == "light":
                    text = "<light> is not needed: scanners see without it"
                    self._note(LeftOut(child, text, ""))
                elif child.tag in LEFT_OUT:
                    self._note(LeftOut(child, f"<{child.tag}> is left out", ""))
                    self._map.others[f"<{child.tag}>"] += 1
            except LeftOut as error:
                self._note(error)
                if error.reason:
                    self._map.count_model([error.reason])

    def _note(self, error: LeftOut, name: str = "") -> None:
        text = f"{short_repr(name)}: {error}" if name else str(error)
        self._map.note(error.element.path, error.element.line, text)

    def _add_model(
        self,
        model: XmlElement,
        place: Pose3,
        prefix: str,
        files: tuple[Path, ...],
        state: XmlElement | None,
        level: int,
    ) -> None:
        if model.text_of("static") not in ("true", "1") and not prefix:
            text = f"the model {model.name!r} becomes a static object"
            self._map.note(model.path, model.line, text)
        name = f"{prefix}{model.name}"
        place, scale, saved = _restored(state, place)
        frames = Frames(model, self._model_of)
        reasons, added, is_not_missed = [], 0, False
        for link in model.all("link"):
            for shape in link.all(self._shapes):
                # Model, link and shape often have the same name, which is written only
                # once.
                names = "_".join(dict.fromkeys((name, link.name, shape.name)))
                try:
                    if link.name in saved:
                        base = place.inverse().compose(saved[link.name])
                    else:
                        base = frames.pose(link)
                    placed = place.compose(frames.pose(shape, base))
                    self._map.add(names, self._shape(shape, scale), placed)
                    added += 1
                except LeftOut as error:
                    self._note(error, names)
                    is_not_missed |= not error.reason
                    reasons += [error.reason] * bool(error.reason)
        inner = [each for each in model.children if each.tag in ("model", "include")]
        if not (reasons or added or is_not_missed or inner):
            text = f"the model {name!r} is left out: it has no {self._shapes}"
            if any(link.first("visual") for link in model.all("link")):
                text += " (see --visuals)"
            self._map.note(model.path, model.line, text)
            reasons = [f"without a {self._shapes}"]
        if reasons or added:
            self._map.count_model(reasons, added)
        self.add_all(model, place, f"{name}_", files, state, level + 1)

    def _shape(self, holder: XmlElement, scale: Sequence[float]) -> dict[str, object]:
        """Return the keys of a map file for the shape of a collision or a visual."""
        geometry = holder.first("geometry")
        if geometry is None or not geometry.children:
            text = f"a {holder.tag} without a shape is left out"
            raise LeftOut(holder, text, "without a shape")
        mesh = geometry.children[0]
        if mesh.tag != "mesh":
            return read_shape(geometry, scale, self._copies)
        file = self._find(mesh, f"the mesh {mesh.text_of('uri')!r} is left out")
        return read_mesh(mesh, file, scale, self._copies)

    def _model_of(self, include: XmlElement) -> XmlElement:
        """Return the model that ``include`` names, with the changes in ``include``."""
        uri, named = include.text_of("uri"), include.text_of("name")
        if _NOT_NEEDED.fullmatch(unquote(uri).lower()):
            reason = "robots drive at z = 0, and scanners need no light"
            raise LeftOut(include, f"{uri!r} is not needed: {reason}", "")
        known = " of ".join(repr(each) for each in (named, uri) if each)
        text = f"the model {known} is left out"
        file = self._find(include, text)
        if file not in self._files:
            models = [*read_xml(file).all("model")]
            self._files[file] = next(iter(models), None), sum(m.size() for m in models)
            for other in models[1:]:
                note = f"the model {other.name!r} is left out: only the first is read"
                self._map.note(file, other.line, note)
                self._map.count_model(["not the first in an included file"])
        model, size = self._files[file]
        # The count is limited, since nested includes could double at each level.
        self._included += size + 1
        if self._included > MAX_INCLUDED:
            too_many = f"more than {MAX_INCLUDED} elements in includes"
            raise include.wrong(f"{too_many}, expected fewer")
        if model is None:
            raise LeftOut(include, f"{text}: no <model> in it", "without a <model>")
        changed = [each for each in include.children if each.tag in ("pose", "static")]
        tags = [each.tag for each in changed]
        kept = (each for each in model.children if each.tag not in tags)
        attributes = dict(model.attributes)
        if named:
            attributes["name"] = named
        if include.first("placement_frame"):
            attributes["placement_frame"] = include.text_of("placement_frame")
        return XmlElement("model", attributes, file, model.line, "", [*changed, *kept])

    def _find(self, element: XmlElement, text: str) -> Path:
        """Return the path of the file that the URI of an element names."""
        uri = element.text_of("uri")
        scheme = next((each for each in SEARCHED if uri.startswith(each)), "")
        folders, references = self._map.options.model_path, [uri.removeprefix(scheme)]
        if fuel := _FUEL.fullmatch(unquote(uri)):
            references = [*_fuel_references(fuel, folders)]
        elif not scheme:
            folders = (element.path.parent, *folders)
            references *= "://" not in uri
        for reference in references:
            for folder in folders:
                found = find_in((folder,), reference)
                if found and found.is_dir():
                    found = _model_file(found)
                if found:
                    return found
        reason = "not found (see --model-path)"
        raise LeftOut(element, f"{text}: {reason}", reason)


def _restored(
    state: XmlElement | None, place: Pose3
) -> tuple[Pose3, list[float], dict[str, Pose3]]:
    """Return the pose, scale and link poses of a model in a saved state of a world."""
    if state is None:
        return place, [1.0, 1.0, 1.0], {}
    pose, scale = state.first("pose"), state.first("scale")
    factors = [1.0, 1.0, 1.0]
    if scale:
        factors = scale.numbers(3)
        if min(factors) <= 0:
            raise scale.wrong(f"a scale of {min(factors):g}, expected more than 0")
    links = {
        link.name: parse_pose(found)
        for link in state.all("link")
        if (found := link.first("pose"))
    }
    return parse_pose(pose) if pose else place, factors, links


def _model_file(folder: Path) -> Path | None:
    """Return the newest SDF file that the model.config in a folder lists."""
    name = "model.sdf"
    with suppress(ForeignFileError):  # model.config is missing or malformed
        files = [
            (_version(each.attributes.get("version", "")), each.text.strip())
            for each in read_xml(folder / "model.config").all("sdf")
        ]
        known = [each for each in files if each[0] <= NEWEST] or files
        if known:
            name = max(known, key=lambda each: each[0])[1]
    found = find_in((folder,), name)
    return found if found and found.is_file() else None


def _version(text: str) -> tuple[int, ...]:
    return tuple(int(number) for number in re.findall("[0-9]{1,9}", text))


def _fuel_references(uri: re.Match[str], folders: Sequence[Path]) -> Iterator[str]:
    """Yield paths at which users or Fuel's tools may have stored a model of Fuel."""
    host, owner, name, version, file = uri.groups(default="")
    for base in (name, f"{host}/{owner}/models/{name}".lower(), name.lower()):
        yield f"{base}/{file}"
        if version.isdecimal():
            yield f"{base}/{version}/{file}"
            continue
        for folder in filter(None, (find_in((each,), base) for each in folders)):
            versions = [
                int(p.name) for p in folder.glob("[0-9]*") if p.name.isdecimal()
            ]
            if versions:
                yield f"{base}/{max(versions)}/{file}"
