"""Load scenes from the data of one map file, and collect its problems.

All problems are found in one run: every entry is validated by itself, and an invalid
entry is skipped when the scene is built. A variant is a layer of further entries over
the map's entries; unchanged objects are built once for all variants.
"""

import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import islice
from typing import Any, Final, TypeAlias, TypeVar

from pydantic import ValidationError

from radarsim.errors import expected_one_of
from radarsim.scene.build import (
    Budget,
    BuildError,
    PartBuilder,
    copy_names,
    make_material,
    make_reflectors,
)
from radarsim.scene.map_checks import (
    ProblemList,
    air_problems,
    extent_problems,
    material_problems,
    object_problems,
    surface_problems,
    trial_problems,
    unknown_materials,
)
from radarsim.scene.map_schema import (
    LEVEL_NAME,
    MAX_BUILT,
    MAX_ENTRIES,
    MAX_MATERIALS,
    MAX_OBJECTS,
    MAX_STARTS,
    MAX_TAGS,
    MAX_VARIANTS,
    MAX_VICTIMS,
    CrateEntry,
    Entry,
    EntryContext,
    Header,
    MaterialEntry,
    ObjectEntry,
    PlacedEntry,
    StartEntry,
    TagEntry,
    TrialEntry,
    VariantEntry,
    VictimEntry,
    level_of,
    unknown_material,
)
from radarsim.scene.material import Material, library_material, library_names
from radarsim.scene.scene import (
    GPS_ORIGIN,
    MOST_CRATES,
    REFLECTOR,
    Part,
    Reflector,
    Scene,
    Trial,
)
from radarsim.validation import short_repr
from radarsim.yaml_reader import KeyPath, YamlFile

_AnyEntry = TypeVar("_AnyEntry", bound=Entry)
_Layer: TypeAlias = tuple[KeyPath, dict[str, object]]  # key path and raw entries
_Object: TypeAlias = tuple[ObjectEntry | None, bool]  # entry, passed `object_problems`


_BUILT: Final = "objects of the map and its variants"


def load_scene(file: YamlFile, variant: str | None = None) -> Scene:
    """Load a map, or one of its variants.

    Raises:
        MapError: If the map or the variant has problems; the error lists them.
    """
    loader = MapLoader(file)
    scene = loader.load(variant)
    loader.problems.raise_all()
    return scene


class MapLoader:
    """Loads the variants of one map file.

    Attributes:
        problems: The problems found so far; invalid entries are missing in the scene.
    """

    def __init__(self, file: YamlFile) -> None:
        self.problems = ProblemList(file)
        self._file = file
        self._folder = file.path.parent.resolve()
        self._builder = PartBuilder(self._folder)
        self._file_room = Budget({_BUILT: MAX_BUILT})
        self._is_too_much = False
        # Entries that variants share are validated, reported and built only once, since
        # a map may have 100 variants with thousands of equal objects.
        self._made: dict[KeyPath, tuple[Material, bool]] = {}
        self._validated: dict[tuple[KeyPath, frozenset[str]], _Object] = {}
        self._built: dict[
            tuple[KeyPath, tuple[Material, ...]], list[Part] | BuildError
        ] = {}

    def variants(self) -> Iterator[str]:
        """Yield the names of all variants; stop when the list of problems is full."""
        variants = _pairs(self._file.data, "variants")
        own = sum(_count(layer, "objects") for _, layer in variants)
        entries = own + (len(variants) + 1) * _count(self._file.data, "objects")
        if len(variants) > MAX_VARIANTS or entries > MAX_ENTRIES:
            text = f"{len(variants)} variants with {entries} objects in all"
            expected = f"expected at most {MAX_VARIANTS} with {MAX_ENTRIES}"
            self.problems.report(("variants",), [((), f"{text}, {expected}")])
            return
        for name, _ in variants:
            if not self.problems.full:
                yield name

    def load(self, variant: str | None = None) -> Scene:
        """Load the map, or one of its variants."""
        data = self._file.data
        if isinstance(data, dict):
            return self._scene(data, variant)
        if not self._file.problems:
            found = "nothing in the file" if data is None else short_repr(data)
            message = f"{found}, expected keys like 'version' and 'objects'"
            self.problems.report((), [((), message)])
        return Scene(self._file.path.stem, "")

    def _scene(self, data: dict[str, object], variant: str | None) -> Scene:
        stem = self._file.path.stem
        # All sections are read even if the header is wrong, so that the user sees all
        # problems in one run.
        level = stem if re.fullmatch(LEVEL_NAME, stem) else level_of(stem)
        header = self._validate(Header, {"level": level, **data}, ())
        layers = list(self._layers(data, variant))
        materials, invalid = self._materials(layers)
        air = self._air(layers, materials, invalid)
        entries = list(self._objects(layers, materials))
        starts = self._placed(data, "starts", StartEntry, MAX_STARTS)
        trial = self._trial(data)
        # If there are too many objects, the problem was reported above, and no object
        # is built.
        parts = () if self._is_too_much else tuple(self._parts(entries, materials))
        reflectors: list[Reflector] = []
        for _, entry in () if self._is_too_much else entries:
            with suppress(BuildError):  # `_parts` has already reported the error.
                reflectors += make_reflectors(entry)
        if reflectors:
            materials.setdefault(REFLECTOR.name, REFLECTOR)
        scene = Scene(
            stem if variant is None else f"{stem}@{variant}",
            header.level if header else level,
            parts,
            starts,
            materials,
            air,
            trial,
            header.gps_origin_deg if header else GPS_ORIGIN,
            tuple(reflectors),
            self._placed(data, "tags", TagEntry, MAX_TAGS),
            self._placed(data, "victims", VictimEntry, MAX_VICTIMS),
            self._placed(data, "crates", CrateEntry, MOST_CRATES),
        )
        self.problems.report(("objects",), extent_problems(scene.bounds))
        return scene

    def _layers(self, data: dict[str, object], variant: str | None) -> Iterator[_Layer]:
        """Yield the entries of the map, and then the entries of the variant."""
        yield (), data
        if variant is None:
            return
        variants = dict(_pairs(data, "variants"))
        if variant not in variants:
            text = expected_one_of(variant, list(variants))
            if not variants:
                text = f"{short_repr(variant)}, expected a map with variants"
            self.problems.report(("variants",), [((), text)])
            return
        at = ("variants", variant)
        layer = {} if variants[variant] is None else variants[variant]
        self._validate(VariantEntry, layer, at)
        yield at, layer if isinstance(layer, dict) else {}

    def _materials(self, layers: list[_Layer]) -> tuple[dict[str, Material], set[str]]:
        """Return all materials, and the names of invalid ones, which become opaque."""
        materials: dict[str, Material] = {}
        invalid: set[str] = set()
        for at, item in self._entries(layers, "materials", MAX_MATERIALS):
            name = str(at[-1])
            if at not in self._made:
                entry = self._validate(MaterialEntry, item, at)
                valid = self.problems.report(at, material_problems(item))
                material = Material(name)
                if entry is not None and valid:
                    material = make_material(name, entry)
                    valid = self.problems.report(at, surface_problems(entry, material))
                self._made[at] = material, valid and entry is not None
            # A variant may replace an invalid entry of the map by a valid one, or vice
            # versa.
            materials[name], valid = self._made[at]
            (invalid.discard if valid else invalid.add)(name)
        return materials, invalid

    def _air(
        self, layers: list[_Layer], materials: dict[str, Material], invalid: set[str]
    ) -> Material | None:
        """Return the material of the air, from the variant or else from the map."""
        given = [(at, layer["air"]) for at, layer in layers if "air" in layer]
        parent, name = given[-1] if given else ((), None)
        if not isinstance(name, str):  # None, or reported already
            return None
        at = (*parent, "air")
        if name not in materials and name not in library_names():
            self.problems.report(at, [((), unknown_material(name, materials))])
            return None
        material = self._material(name, materials)
        if name not in invalid:
            self.problems.report(at, air_problems(material))
        return material

    def _material(self, name: str, materials: dict[str, Material]) -> Material:
        """Return a material by name; a library material is added to ``materials``."""
        if name not in materials:
            materials[name] = library_material(name)
        return materials[name]

    def _objects(
        self, layers: list[_Layer], materials: dict[str, Material]
    ) -> Iterator[tuple[KeyPath, ObjectEntry]]:
        """Yield the valid object entries with their key paths."""
        taken: dict[str, KeyPath] = {}
        room = Budget()
        for at, item in self._entries(layers, "objects", MAX_OBJECTS):
            # All variants with the same unknown materials share the result of the
            # validation.
            key = at, frozenset(unknown_materials(item, materials))
            if key not in self._validated:
                context = EntryContext(materials=materials, folder=self._folder)
                found = self._validate(ObjectEntry, item, at, context)
                valid = self.problems.report(at, object_problems(item))
                self._validated[key] = found, valid
            entry, valid = self._validated[key]
            try:
                room.take((entry and entry.copies) or 1, "objects")
            except BuildError as error:
                self._is_too_much = True
                self.problems.report(at, error.problems)
                continue
            # Names of invalid entries are recorded too, to report their duplicates.
            name = item.get("name") if isinstance(item, dict) else None
            if entry is not None:
                self._claim(at, copy_names(entry.name, entry.copies), taken)
            elif isinstance(name, str):
                self._claim(at, [name], taken)
            if entry is not None and valid:
                yield at, entry

    def _parts(
        self,
        entries: Iterable[tuple[KeyPath, ObjectEntry]],
        materials: dict[str, Material],
    ) -> Iterator[Part]:
        """Build the parts of objects; stop when the list of problems is full."""
        room = Budget()
        for at, entry in entries:
            if self.problems.full:
                return
            used = {n: self._material(n, materials) for n in entry.material_names}
            try:
                yield from self._build(at, entry, used, room)
            except BuildError as error:
                self.problems.report(at, error.problems)

    def _build(
        self, at: KeyPath, entry: ObjectEntry, used: dict[str, Material], room: Budget
    ) -> list[Part]:
        """Build an object, or return its parts if another variant has built them."""
        # The key contains the materials, not their names, since a variant can redefine
        # a name.
        key = (at, tuple(used.values()))
        built = self._built.get(key)
        if built is None:
            try:
                self._file_room.take(entry.copies or 1, _BUILT)
                built = self._builder.build(entry, used, room)
            except BuildError as error:
                built = error
            self._built[key] = built
        elif not isinstance(built, BuildError):  # Cached objects count too.
            room.take(len(built), "parts")
            room.take(sum(len(part.faces) for part in built), "triangles")
        if isinstance(built, BuildError):
            raise built
        return built

    def _placed(
        self, data: dict[str, object], key: str, model: type[PlacedEntry], most: int
    ) -> tuple[Any, ...]:
        """Return the objects built from the valid entries of a section."""
        taken: dict[str, KeyPath] = {}
        found = []
        for at, item in self._entries([((), data)], key, most):
            entry = self._validate(model, item, at)
            if entry is not None:
                own = str(getattr(entry, entry.unique_key))
                self._claim(at, [own], taken, ignore_case=True)
                found.append(entry.build())
        return tuple(found)

    def _trial(self, data: dict[str, object]) -> Trial | None:
        item = data.get("trial")
        if item is None:
            return None
        entry = self._validate(TrialEntry, item, ("trial",))
        starts = [start for _, start in _entries([((), data)], "starts")]
        valid = self.problems.report(("trial",), trial_problems(item, starts))
        if entry is None or not valid:
            return None
        x, y = entry.goal
        return Trial(entry.start, (x, y), entry.safety_distance)

    def _validate(
        self,
        model: type[_AnyEntry],
        item: object,
        at: KeyPath,
        context: EntryContext | None = None,
    ) -> _AnyEntry | None:
        """Return the validated entry, or report its problems and return None."""
        try:
            return model.model_validate(item, context=context)
        except ValidationError as error:
            self.problems.report_invalid(error, at, model.model_fields)
            return None

    def _claim(
        self,
        at: KeyPath,
        names: Iterable[str],
        taken: dict[str, KeyPath],
        *,
        ignore_case: bool = False,
    ) -> None:
        """Record the names of an entry and its copies; report the first duplicate.

        Args:
            at: Key path of the entry.
            names: The names of all its copies.
            taken: The names used so far, with the key paths of their entries.
            ignore_case: Whether names that differ only in case are equal.
        """
        for name in names:
            other = taken.setdefault(name.casefold() if ignore_case else name, at)
            if other != at:
                entry = ".".join(str(key) for key in other)
                text = f"{short_repr(name)}, expected a name not used by {entry}"
                self.problems.report(at, [(("name",), text)])
                return

    def _entries(
        self, layers: list[_Layer], key: str, most: int
    ) -> Iterator[tuple[KeyPath, object]]:
        """Yield a section's raw entries, of map and variant, with their key paths."""
        count = sum(_count(layer, key) for _, layer in layers)
        if count > most:
            self._is_too_much = True
            text = f"{count} {key}, expected at most {most} in all"
            self.problems.report((key,), [((), text)])
        yield from islice(_entries(layers, key), most)


def _pairs(data: object, key: str) -> list[tuple[str, object]]:
    section = data.get(key) if isinstance(data, dict) else None
    return list(section.items()) if isinstance(section, dict) else []


def _count(layer: object, key: str) -> int:
    section = layer.get(key) if isinstance(layer, dict) else None
    return len(section) if isinstance(section, list | dict) else 0


def _entries(layers: Iterable[_Layer], key: str) -> Iterator[tuple[KeyPath, object]]:
    """Yield a section's raw entries, of map and variant, with their key paths."""
    for parent, layer in layers:
        section = layer.get(key)
        items: Iterable[tuple[str | int, object]] = []
        if key == "materials":
            items = _pairs(layer, key)
        elif isinstance(section, list):
            items = enumerate(section)
        for name, item in items:
            yield (*parent, key, name), item
