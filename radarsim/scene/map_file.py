"""Where maps are: at a path, or shipped; and which variant of one is meant."""

import math
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeAlias

from radarsim.errors import MapError
from radarsim.geometry import Pose3
from radarsim.presets.materials import library_names
from radarsim.scene.build import (
    BuildError,
    air_problems,
    build_parts,
    copy_names,
    from_library,
    make_material,
    surface_problems,
)
from radarsim.scene.map_checks import (
    MapProblems,
    extent_problems,
    material_problems,
    object_problems,
    trial_problems,
)
from radarsim.scene.map_schema import (
    Header,
    MaterialEntry,
    ObjectEntry,
    StartEntry,
    TrialEntry,
    VariantEntry,
    unknown_material,
)
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene, StartPose, Trial
from radarsim.yaml_reader import KeyPath, YamlFile, read_yaml, shown


def find_map(path_or_name: str | Path) -> tuple[Path, str | None]:
    """Find the file of a map, and the name of the variant that is asked for.

    The name of a variant follows the map after an ``@``, unless there is a file that is
    called so as a whole. A file at a path comes before a shipped map's name.

    Raises:
        MapError: If there is neither.
    """
    name = str(path_or_name)
    if path := _find(name):
        return path, None
    stem, at, variant = name.rpartition("@")
    if at and (path := _find(stem)):
        return path, variant
    plain = name.isprintable() and len(name) <= 80
    expected = f"expected a map file or one of {sorted(shipped_maps())}"
    raise MapError([f"{name if plain else shown(name)}: no such file, {expected}"])


def _find(name: str) -> Path | None:
    with suppress(OSError, ValueError):  # endless names, NUL
        if Path(name).is_file():
            return Path(name)
    return shipped_maps().get(name)


def shipped_maps() -> dict[str, Path]:
    """Give the maps that come with radarsim, by name."""
    package = Path(__file__).resolve().parents[1]
    folder = package / "maps"  # in an installed wheel
    if not folder.is_dir():
        folder = package.parent / "maps"  # in a checkout
    return {path.stem: path for path in sorted(folder.glob("*.yaml"))}


# Section from scene.mapfile.
# From a map file to a scene; the only reader of map files.
#
# A map is a YAML file with its meshes beside it, see mapmodel.py for what it may say.
# All that is wrong with it is found in one run: every entry is looked at by itself,
# and
# one that is wrong only leaves out what would be built from it. A variant is a layer
# of
# further entries over those of the map.

MAX_TRIANGLES = 20_000_000

_Layer: TypeAlias = tuple[KeyPath, dict[str, Any]]  # entries, and where they stand


def load_map(path_or_name: str | Path) -> Scene:
    """Load a map.

    Args:
        path_or_name: The path of a map file, or the name of a shipped map; ``@`` and a
            name after it choose a variant of the map.

    Raises:
        MapError: With every problem that the map has, other variants left aside.
    """
    path, variant = find_map(path_or_name)
    return _Reader(_read(path), variant).scene()


def load_variants(path_or_name: str | Path) -> list[Scene]:
    """Load a map and then all its variants, or only the one that is chosen.

    Raises:
        MapError: With every problem that any of them has.
    """
    path, chosen = find_map(path_or_name)
    file = _read(path)
    others = [] if chosen is not None else _pairs(file.data, "variants")
    scenes: list[Scene] = []
    problems: dict[str, None] = {}  # each of them once, in order
    for variant in (chosen, *(name for name, _ in others)):
        try:
            scenes.append(_Reader(file, variant).scene())
        except MapError as error:
            problems |= dict.fromkeys(error.problems)
    if problems:
        raise MapError(list(problems))
    return scenes


def _read(path: Path) -> YamlFile:
    try:
        return read_yaml(path)
    except OSError as error:
        reason = error.strerror or str(error)
        raise MapError([f"{path}: {reason.lower()}, expected a map file"]) from error


class _Reader:
    """Reads one map file, or one variant of it."""

    def __init__(self, file: YamlFile, variant: str | None) -> None:
        self._file = file
        self._variant = variant
        self._problems = MapProblems(file)
        self._folder = file.path.parent.resolve()

    def scene(self) -> Scene:
        """Read it all.

        Raises:
            MapError: If anything is wrong.
        """
        data = self._file.data
        if isinstance(data, dict):
            scene = self._scene(data)
            if not self._problems.found:
                return scene
        elif not self._problems.found:
            message = f"{shown(data)}, expected keys like 'version' and 'objects'"
            self._problems.report((), [((), message)])
        raise MapError(self._problems.found)

    def _scene(self, data: dict[str, Any]) -> Scene:
        stem = self._file.path.stem
        header = self._problems.entry(Header, {"level": stem, **data}, ())
        layers = list(self._layers(data))
        materials, wrong = self._materials(layers)
        air = self._air(layers, materials, wrong)
        parts = tuple(self._objects(layers, materials))
        starts = tuple(self._starts(data))
        trial = self._trial(data)
        level = header.level if header else stem
        name = stem if self._variant is None else f"{stem}@{self._variant}"
        scene = Scene(name, level, parts, starts, materials, air, trial)
        self._problems.report(("objects",), extent_problems(scene.bounds))
        return scene

    def _layers(self, data: dict[str, Any]) -> Iterator[_Layer]:
        """Give the map's own entries, and then those of the variant."""
        yield (), data
        if self._variant is None:
            return
        variants = dict(_pairs(data, "variants"))
        if self._variant not in variants:
            text = f"{shown(self._variant)}, expected one of {list(variants)}"
            self._problems.report(("variants",), [((), text)])
            return
        at = ("variants", self._variant)
        layer = {} if variants[self._variant] is None else variants[self._variant]
        self._problems.entry(VariantEntry, layer, at)
        yield at, layer if isinstance(layer, dict) else {}

    def _materials(self, layers: list[_Layer]) -> tuple[dict[str, Material], set[str]]:
        """Read the materials, and name those that are wrong: they are opaque."""
        materials: dict[str, Material] = {}
        wrong: set[str] = set()
        for where, layer in layers:
            for name, item in _pairs(layer, "materials"):
                at = (*where, "materials", name)
                entry = self._problems.entry(MaterialEntry, item, at)
                sound = self._problems.report(at, material_problems(item))
                materials[name] = Material(name)
                if entry and sound:
                    materials[name] = make_material(name, entry)
                    found = surface_problems(entry, materials[name])
                    sound = self._problems.report(at, found)
                (wrong.discard if entry and sound else wrong.add)(name)
        return materials, wrong

    def _air(
        self, layers: list[_Layer], materials: dict[str, Material], wrong: set[str]
    ) -> Material | None:
        """Find what fills the scene; the last layer that speaks of it counts."""
        said = [(at, layer["air"]) for at, layer in layers if "air" in layer]
        where, name = said[-1] if said else ((), None)
        if not isinstance(name, str):  # None, or refused before
            return None
        at = (*where, "air")
        if name not in materials and name not in library_names():
            self._problems.report(at, [((), unknown_material(name, materials))])
            return None
        material = self._material(name, materials)
        if name not in wrong:
            self._problems.report(at, air_problems(material))
        return material

    def _material(self, name: str, materials: dict[str, Material]) -> Material:
        """Give a material by its name; one of the library joins the map's own."""
        if name not in materials:
            materials[name] = from_library(name)
        return materials[name]

    def _objects(
        self, layers: list[_Layer], materials: dict[str, Material]
    ) -> Iterator[Part]:
        context = {"materials": list(materials), "folder": self._folder}
        taken: dict[str, KeyPath] = {}
        room = MAX_TRIANGLES
        for at, item in _entries(layers, "objects"):
            entry = self._problems.entry(ObjectEntry, item, at, context)
            sound = self._problems.report(at, object_problems(item))
            self._problems.take(at, _object_names(entry, item), taken)
            if entry is None or not sound:
                continue
            made_of = {n: self._material(n, materials) for n in entry.material_names}
            try:
                parts = build_parts(entry, made_of, self._folder, room)
            except BuildError as error:
                self._problems.report(at, error.problems)
                continue
            room -= sum(len(part.faces) for part in parts)
            yield from parts

    def _starts(self, data: dict[str, Any]) -> Iterator[StartPose]:
        taken: dict[str, KeyPath] = {}
        for at, item in _entries([((), data)], "starts"):
            entry = self._problems.entry(StartEntry, item, at)
            if entry is not None:
                self._problems.take(at, [entry.name], taken, fold=True)
                x, y, z = entry.position
                pose = Pose3(x, y, z, yaw=math.radians(entry.yaw_deg))
                yield StartPose(entry.name, pose)

    def _trial(self, data: dict[str, Any]) -> Trial | None:
        item = data.get("trial")
        if item is None:
            return None
        entry = self._problems.entry(TrialEntry, item, ("trial",))
        said = [start for _, start in _entries([((), data)], "starts")]
        sound = self._problems.report(("trial",), trial_problems(item, said))
        if entry is None or not sound:
            return None
        x, y = entry.goal
        return Trial(entry.start, (x, y), entry.safety_distance)


def _object_names(entry: ObjectEntry | None, item: Any) -> Iterable[str]:
    if entry is not None:
        return copy_names(entry.name, entry.copies)
    name = item.get("name") if isinstance(item, dict) else None
    return [name] if isinstance(name, str) else []


def _pairs(data: Any, key: str) -> list[tuple[str, Any]]:
    section = data.get(key) if isinstance(data, dict) else None
    return list(section.items()) if isinstance(section, dict) else []


def _entries(layers: Iterable[_Layer], key: str) -> Iterator[tuple[KeyPath, Any]]:
    """Give the entries of a list, and where each of them stands."""
    for where, layer in layers:
        section = layer.get(key)
        for number, item in enumerate(section if isinstance(section, list) else []):
            yield (*where, key, number), item
