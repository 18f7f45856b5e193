"""Find map files and load scenes from them; nothing else reads map files.

A map is a YAML file with its meshes beside it; `map_schema` defines its keys. All
problems are found in one run: every entry is validated by itself, and an invalid one
only leaves out what would be built from it. A variant is a layer of further entries
over those of the map.
"""

import math
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from pydantic import ValidationError

from radarsim.errors import MapError
from radarsim.geometry import Pose3
from radarsim.os_errors import describe_os_error
from radarsim.presets.materials import library_names
from radarsim.scene.build import (
    BuildError,
    build_parts,
    copy_names,
    from_library,
    make_material,
)
from radarsim.scene.map_checks import (
    Problem,
    air_problems,
    extent_problems,
    material_problems,
    object_problems,
    surface_problems,
    trial_problems,
)
from radarsim.scene.map_schema import (
    Entry,
    Header,
    MaterialEntry,
    ObjectEntry,
    StartEntry,
    TrialEntry,
    VariantEntry,
    unknown_material,
)
from radarsim.scene.material import Material
from radarsim.scene.scene import GPS_ORIGIN, Part, Scene, StartPose, Trial
from radarsim.suggestions import did_you_mean, expected_one_of
from radarsim.validation import short_repr
from radarsim.yaml_reader import KeyPath, YamlFile, read_yaml

MAX_TRIANGLES = 20_000_000

_AnyEntry = TypeVar("_AnyEntry", bound=Entry)
_Layer: TypeAlias = tuple[KeyPath, dict[str, Any]]  # key path and raw entries


def find_map(path_or_name: str | Path) -> tuple[Path, str | None]:
    """Return the path of a map file and the name of the selected variant.

    A variant's name follows the map after an ``@``, unless a file has the whole name.
    A file takes precedence over a shipped map of the same name.

    Raises:
        MapError: If there is neither.
    """
    name = str(path_or_name)
    if path := _find(name):
        return path, None
    stem, separator, variant = name.rpartition("@")
    if separator and (path := _find(stem)):
        return path, variant
    raise MapError([_not_found(name)])


def _not_found(name: str) -> str:
    """Return why there is no map of a name, and which one may be meant."""
    plain = name.isprintable() and len(name) <= 80
    shipped = sorted(shipped_maps())
    expected = f"expected a map file or one of {shipped}"
    reason, stem = "no such file", name.rpartition("@")[0]
    others: list[str] = []
    try:
        others = [str(path) for path in Path(name).parent.glob("*.yaml")]
        reason = "a folder" if Path(name).is_dir() else reason
        Path(name).stat()
    except (OSError, ValueError) as error:  # too long, or with NUL
        if isinstance(error, PermissionError):
            reason = describe_os_error(error)
    meant = did_you_mean(name, [*others, *shipped]) or did_you_mean(stem, shipped)
    return f"{name if plain else short_repr(name)}: {reason}, {expected}{meant}"


def _find(name: str) -> Path | None:
    with suppress(OSError, ValueError):  # too long, or with NUL
        if Path(name).is_file():
            return Path(name)
    return shipped_maps().get(name)


def shipped_maps() -> dict[str, Path]:
    """Return the paths of the maps that come with radarsim, by name."""
    package = Path(__file__).resolve().parents[1]
    folder = package / "maps"  # in an installed wheel
    if not folder.is_dir():
        folder = package.parent / "maps"  # in a checkout
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


def load_map(path_or_name: str | Path) -> Scene:
    """Load a map.

    Args:
        path_or_name: The path of a map file, or the name of a shipped map; ``@`` and a
            name after it select a variant of the map.

    Raises:
        MapError: If the map or the selected variant has problems; it lists all.
    """
    path, variant = find_map(path_or_name)
    return _MapLoader(_read(path), variant).load()


def load_variants(path_or_name: str | Path) -> list[Scene]:
    """Load a map and then all its variants, or only the selected one.

    Raises:
        MapError: If any of them has problems; it lists all.
    """
    path, selected = find_map(path_or_name)
    file = _read(path)
    others = [] if selected is not None else _pairs(file.data, "variants")
    scenes: list[Scene] = []
    problems: dict[str, None] = {}  # without repetitions, in order
    for variant in (selected, *(name for name, _ in others)):
        try:
            scenes.append(_MapLoader(file, variant).load())
        except MapError as error:
            problems |= dict.fromkeys(error.problems)
    if problems:
        raise MapError(list(problems))
    return scenes


def _read(path: Path) -> YamlFile:
    try:
        return read_yaml(path)
    except OSError as error:
        reason = describe_os_error(error)
        raise MapError([f"{path}: {reason}, expected a map file"]) from error


class _MapLoader:
    """Loads one map file, or one variant of it, and collects all problems.

    Problems of the file as YAML come first.
    """

    def __init__(self, file: YamlFile, variant: str | None) -> None:
        self._file = file
        self._variant = variant
        self._folder = file.path.parent.resolve()
        self._problems = list(file.problems)

    def load(self) -> Scene:
        """Load the scene.

        Raises:
            MapError: If there is any problem.
        """
        data = self._file.data
        if isinstance(data, dict):
            scene = self._scene(data)
            if not self._problems:
                return scene
        elif not self._problems:
            message = f"{short_repr(data)}, expected keys like 'version' and 'objects'"
            self._report((), [((), message)])
        raise MapError(self._problems)

    def _scene(self, data: dict[str, Any]) -> Scene:
        stem = self._file.path.stem
        header = self._validate(Header, {"level": stem, **data}, ())
        layers = list(self._layers(data))
        materials, invalid = self._materials(layers)
        air = self._air(layers, materials, invalid)
        parts = tuple(self._objects(layers, materials))
        starts = tuple(self._starts(data))
        trial = self._trial(data)
        level = header.level if header else stem
        name = stem if self._variant is None else f"{stem}@{self._variant}"
        origin = header.gps_origin_deg if header else GPS_ORIGIN
        scene = Scene(name, level, parts, starts, materials, air, trial, origin)
        self._report(("objects",), extent_problems(scene.bounds))
        return scene

    def _layers(self, data: dict[str, Any]) -> Iterator[_Layer]:
        """Yield the map's own entries, and then those of the variant."""
        yield (), data
        if self._variant is None:
            return
        variants = dict(_pairs(data, "variants"))
        if self._variant not in variants:
            text = expected_one_of(self._variant, list(variants))
            self._report(("variants",), [((), text)])
            return
        at = ("variants", self._variant)
        layer = {} if variants[self._variant] is None else variants[self._variant]
        self._validate(VariantEntry, layer, at)
        yield at, layer if isinstance(layer, dict) else {}

    def _materials(self, layers: list[_Layer]) -> tuple[dict[str, Material], set[str]]:
        """Return the materials and the names of invalid ones, which become opaque."""
        materials: dict[str, Material] = {}
        invalid: set[str] = set()
        for parent, layer in layers:
            for name, item in _pairs(layer, "materials"):
                at = (*parent, "materials", name)
                entry = self._validate(MaterialEntry, item, at)
                valid = self._report(at, material_problems(item))
                materials[name] = Material(name)
                if entry and valid:
                    materials[name] = make_material(name, entry)
                    valid = self._report(at, surface_problems(entry, materials[name]))
                (invalid.discard if entry and valid else invalid.add)(name)
        return materials, invalid

    def _air(
        self, layers: list[_Layer], materials: dict[str, Material], invalid: set[str]
    ) -> Material | None:
        """Return the material of the air; the last layer that has the key counts."""
        given = [(at, layer["air"]) for at, layer in layers if "air" in layer]
        parent, name = given[-1] if given else ((), None)
        if not isinstance(name, str):  # None, or reported already
            return None
        at = (*parent, "air")
        if name not in materials and name not in library_names():
            self._report(at, [((), unknown_material(name, materials))])
            return None
        material = self._material(name, materials)
        if name not in invalid:
            self._report(at, air_problems(material))
        return material

    def _material(self, name: str, materials: dict[str, Material]) -> Material:
        """Return a material by its name; one of the library is added to the map's."""
        if name not in materials:
            materials[name] = from_library(name)
        return materials[name]

    def _objects(
        self, layers: list[_Layer], materials: dict[str, Material]
    ) -> Iterator[Part]:
        context = {"materials": list(materials), "folder": self._folder}
        taken: dict[str, KeyPath] = {}
        triangles_left = MAX_TRIANGLES
        for at, item in _entries(layers, "objects"):
            entry = self._validate(ObjectEntry, item, at, context)
            valid = self._report(at, object_problems(item))
            self._claim(at, _object_names(entry, item), taken)
            if entry is None or not valid:
                continue
            used = {n: self._material(n, materials) for n in entry.material_names}
            try:
                parts = build_parts(entry, used, self._folder, triangles_left)
            except BuildError as error:
                self._report(at, error.problems)
                continue
            triangles_left -= sum(len(part.faces) for part in parts)
            yield from parts

    def _starts(self, data: dict[str, Any]) -> Iterator[StartPose]:
        taken: dict[str, KeyPath] = {}
        for at, item in _entries([((), data)], "starts"):
            entry = self._validate(StartEntry, item, at)
            if entry is not None:
                self._claim(at, [entry.name], taken, ignore_case=True)
                x, y, z = entry.position
                pose = Pose3(x, y, z, yaw=math.radians(entry.yaw_deg))
                yield StartPose(entry.name, pose)

    def _trial(self, data: dict[str, Any]) -> Trial | None:
        item = data.get("trial")
        if item is None:
            return None
        entry = self._validate(TrialEntry, item, ("trial",))
        starts = [start for _, start in _entries([((), data)], "starts")]
        valid = self._report(("trial",), trial_problems(item, starts))
        if entry is None or not valid:
            return None
        x, y = entry.goal
        return Trial(entry.start, (x, y), entry.safety_distance)

    def _validate(
        self,
        model: type[_AnyEntry],
        item: Any,
        at: KeyPath,
        context: dict[str, Any] | None = None,
    ) -> _AnyEntry | None:
        """Validate an entry by itself; report its problems and return None if any."""
        try:
            return model.model_validate(item, context=context)
        except ValidationError as error:
            self._problems += self._file.validation_problems(
                error, at, known=model.model_fields
            )
            return None

    def _claim(
        self,
        at: KeyPath,
        names: Iterable[str],
        taken: dict[str, KeyPath],
        *,
        ignore_case: bool = False,
    ) -> None:
        """Record the names of an entry and its copies; report the first that is taken.

        Args:
            at: Key path of the entry.
            names: The names of all its copies.
            taken: The names so far, with the key paths of their entries.
            ignore_case: Whether names that differ only in case are equal.
        """
        for name in names:
            other = taken.setdefault(name.casefold() if ignore_case else name, at)
            if other != at:
                entry = ".".join(str(key) for key in other)
                text = f"{short_repr(name)}, expected a name not used by {entry}"
                self._report(at, [(("name",), text)])
                return

    def _report(self, at: KeyPath, problems: Iterable[Problem]) -> bool:
        """Record problems of an entry; return whether there are none."""
        found = [self._file.problem((*at, *keys), text) for keys, text in problems]
        self._problems += found
        return not found


def _object_names(entry: ObjectEntry | None, item: Any) -> Iterable[str]:
    if entry is not None:
        return copy_names(entry.name, entry.copies)
    name = item.get("name") if isinstance(item, dict) else None
    return [name] if isinstance(name, str) else []


def _pairs(data: Any, key: str) -> list[tuple[str, Any]]:
    section = data.get(key) if isinstance(data, dict) else None
    return list(section.items()) if isinstance(section, dict) else []


def _entries(layers: Iterable[_Layer], key: str) -> Iterator[tuple[KeyPath, Any]]:
    """Yield the raw entries of a list in all layers, each with its key path."""
    for parent, layer in layers:
        section = layer.get(key)
        for index, item in enumerate(section if isinstance(section, list) else []):
            yield (*parent, key, index), item
