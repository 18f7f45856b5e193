"""From a map file to a scene; the only reader of map files.

A map is a YAML file with its meshes beside it, see mapmodel.py for what it may say.
All that is wrong with it is found in one run: every entry is looked at by itself, and
one that is wrong only leaves out what would be built from it.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

from pydantic import ValidationError

from radarsim.errors import MapError
from radarsim.geometry import Pose3
from radarsim.scene.build import BuildError, build_parts
from radarsim.scene.mapchecks import extent_problems, material_problems, object_problems
from radarsim.scene.mapmodel import (
    Entry,
    Header,
    MaterialEntry,
    ObjectEntry,
    StartEntry,
)
from radarsim.scene.material import Material
from radarsim.scene.placing import copy_names
from radarsim.scene.scene import Part, Scene, StartPose
from radarsim.yamlfile import YamlFile, read_yaml, shown
from radarsim.yamlnodes import KeyPath

MAX_TRIANGLES = 20_000_000

_AnyEntry = TypeVar("_AnyEntry", bound=Entry)


def load_map(path_or_name: str | Path) -> Scene:
    """Load a map.

    Args:
        path_or_name: The path of a map file, or the name of a shipped map.

    Raises:
        MapError: With every problem that the map has.
    """
    path = find_map(path_or_name)
    try:
        file = read_yaml(path)
    except OSError as error:
        reason = error.strerror or str(error)
        raise MapError([f"{path}: {reason.lower()}, expected a map file"]) from error
    return _Reader(file).scene()


def find_map(path_or_name: str | Path) -> Path:
    """Find the file of a map; a file at a path comes before a shipped map's name.

    Raises:
        MapError: If there is neither.
    """
    path, name = Path(path_or_name), str(path_or_name)
    with suppress(OSError, ValueError):  # endless names, NUL
        if path.is_file():
            return path
    shipped = shipped_maps()
    if name in shipped:
        return shipped[name]
    plain = name.isprintable() and len(name) <= 80
    expected = f"expected a map file or one of {sorted(shipped)}"
    raise MapError([f"{name if plain else shown(name)}: no such file, {expected}"])


def shipped_maps() -> dict[str, Path]:
    """Give the maps that come with radarsim, by name."""
    package = Path(__file__).resolve().parents[1]
    folder = package / "maps"  # in an installed wheel
    if not folder.is_dir():
        folder = package.parent / "maps"  # in a checkout
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


class _Reader:
    """Reads one map file, collecting problems on the way."""

    def __init__(self, file: YamlFile) -> None:
        self._file = file
        self._problems = list(file.problems)
        self._folder = file.path.parent.resolve()

    def scene(self) -> Scene:
        """Read it all.

        Raises:
            MapError: If anything is wrong.
        """
        data = self._file.data
        if isinstance(data, dict):
            scene = self._scene(data)
            if not self._problems:
                return scene
        elif not self._problems:
            message = f"{shown(data)}, expected keys like 'version' and 'objects'"
            self._report((), [((), message)])
        raise MapError(self._problems)

    def _scene(self, data: dict[str, Any]) -> Scene:
        name = self._file.path.stem
        header = self._entry(Header, {"level": name, **data}, ())
        materials = dict(self._materials(data))
        parts = tuple(self._objects(data, materials))
        starts = tuple(self._starts(data))
        level = header.level if header else name
        scene = Scene(name, level, parts, starts, materials)
        self._report(("objects",), extent_problems(scene.bounds))
        return scene

    def _materials(self, data: dict[str, Any]) -> Iterator[tuple[str, Material]]:
        """Read the materials; one that is wrong is opaque, to go on with."""
        for name, item in _pairs(data, "materials"):
            at = ("materials", name)
            entry = self._entry(MaterialEntry, item, at)
            self._report(at, material_problems(item))
            yield name, _material(name, entry) if entry else Material(name)

    def _objects(
        self, data: dict[str, Any], materials: Mapping[str, Material]
    ) -> Iterator[Part]:
        context = {"materials": list(materials), "folder": self._folder}
        taken: dict[str, int] = {}
        room = MAX_TRIANGLES
        for number, item in enumerate(_items(data, "objects")):
            at = ("objects", number)
            entry = self._entry(ObjectEntry, item, at, context)
            sound = self._report(at, object_problems(item))
            self._take((*at, "name"), _object_names(entry, item), taken)
            if entry is None or not sound:
                continue
            try:
                parts = build_parts(entry, materials, self._folder, room)
            except BuildError as error:
                self._report(at, error.problems)
                continue
            room -= sum(len(part.faces) for part in parts)
            yield from parts

    def _starts(self, data: dict[str, Any]) -> Iterator[StartPose]:
        taken: dict[str, int] = {}
        for number, item in enumerate(_items(data, "starts")):
            at = ("starts", number)
            entry = self._entry(StartEntry, item, at)
            if entry is not None:
                self._take((*at, "name"), [entry.name], taken, fold=True)
                x, y, z = entry.position
                pose = Pose3(x, y, z, yaw=math.radians(entry.yaw_deg))
                yield StartPose(entry.name, pose)

    def _entry(
        self,
        model: type[_AnyEntry],
        item: Any,
        at: KeyPath,
        context: dict[str, Any] | None = None,
    ) -> _AnyEntry | None:
        try:
            return model.model_validate(item, context=context)
        except ValidationError as error:
            known = model.model_fields
            self._problems += self._file.refusals(error, at, known=known)
            return None

    def _take(
        self,
        at: KeyPath,
        names: Iterable[str],
        taken: dict[str, int],
        *,
        fold: bool = False,
    ) -> None:
        """Note that an entry has these names, or say which other entry has one.

        Args:
            at: Where the entry's name stands.
            names: Those of all its copies.
            taken: The names so far, with the numbers of their entries.
            fold: Whether names that differ in case alone are the same.
        """
        section, number = at[0], int(at[1])
        for name in names:
            other = taken.setdefault(name.casefold() if fold else name, number)
            if other != number:
                text = f"{shown(name)}, expected a name that {section}.{other} has not"
                self._report(at, [((), text)])
                return

    def _report(self, at: KeyPath, problems: Iterable[tuple[KeyPath, str]]) -> bool:
        """Collect problems of an entry; tells whether there are none."""
        found = [self._file.problem((*at, *keys), text) for keys, text in problems]
        self._problems += found
        return not found


def _material(name: str, entry: MaterialEntry) -> Material:
    density = 0.0 if entry.density is None else entry.density  # a sheet
    return Material(
        name,
        density=density,
        laser_density=entry.laser_density,
        solid=entry.solid,
        sheet_loss=entry.sheet_loss,
    )


def _object_names(entry: ObjectEntry | None, item: Any) -> Iterable[str]:
    if entry is not None:
        return copy_names(entry.name, entry.copies)
    name = item.get("name") if isinstance(item, dict) else None
    return [name] if isinstance(name, str) else []


def _pairs(data: dict[str, Any], key: str) -> list[tuple[str, Any]]:
    section = data.get(key)
    return list(section.items()) if isinstance(section, dict) else []


def _items(data: dict[str, Any], key: str) -> list[Any]:
    section = data.get(key)
    return section if isinstance(section, list) else []
