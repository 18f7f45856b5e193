"""What is found wrong with a map file, while it is read to its end."""

from collections.abc import Iterable, Iterator
from typing import Any, TypeAlias, TypeVar

from pydantic import ValidationError

from radarsim.geometry import Floats
from radarsim.presets.materials import AMOUNTS, library, library_entry, library_names
from radarsim.scene.map_schema import MAX_EXTENT, Entry
from radarsim.yaml_reader import KeyPath, YamlFile, shown

_AnyEntry = TypeVar("_AnyEntry", bound=Entry)
Problem: TypeAlias = tuple[KeyPath, str]


class MapProblems:
    """Looks at entries of a map file and collects what is wrong with them.

    Attributes:
        found: One text for each problem, with its place; what is wrong with the file
            as YAML comes first.
    """

    def __init__(self, file: YamlFile) -> None:
        self.found = list(file.problems)
        self._file = file

    def entry(
        self,
        model: type[_AnyEntry],
        item: Any,
        at: KeyPath,
        context: dict[str, Any] | None = None,
    ) -> _AnyEntry | None:
        """Look at an entry by itself; None if it is wrong."""
        try:
            return model.model_validate(item, context=context)
        except ValidationError as error:
            known = model.model_fields
            self.found += self._file.validation_problems(error, at, known=known)
            return None

    def take(
        self,
        at: KeyPath,
        names: Iterable[str],
        taken: dict[str, KeyPath],
        *,
        fold: bool = False,
    ) -> None:
        """Note that an entry has these names, or say which other entry has one.

        Args:
            at: Where the entry stands.
            names: Those of all its copies.
            taken: The names so far, with the places of their entries.
            fold: Whether names that differ in case alone are the same.
        """
        for name in names:
            other = taken.setdefault(name.casefold() if fold else name, at)
            if other != at:
                there = ".".join(str(key) for key in other)
                text = f"{shown(name)}, expected a name that {there} has not"
                self.report(at, [(("name",), text)])
                return

    def report(self, at: KeyPath, problems: Iterable[Problem]) -> bool:
        """Collect problems of an entry; tells whether there are none."""
        found = [self._file.problem((*at, *keys), text) for keys, text in problems]
        self.found += found
        return not found


# Section from scene.mapchecks.
# What several keys of a map's entry say together.
#
# These checks look at the raw data, so that a key which is wrong by itself does not
# hide
# what is wrong with the others.


_SHAPES = {"box", "cylinder", "mesh", "sphere"}
_FOR_MESHES = {"materials", "scale", "up_axis"}
_NOT_OPAQUE = (
    ("density", "sheet_loss"),
    ("density", "db_per_m"),
    ("laser_density", "laser_db_per_m"),
)
_EITHER = (
    ("material", "materials"),
    ("yaw_deg", "rotation_deg"),
    ("repeat", "scatter"),
)


def material_problems(item: Any) -> Iterator[Problem]:
    """Check a material: it says what a radar loses, in ways that go together."""
    if not isinstance(item, dict):
        return
    given = {key for key, value in item.items() if value is not None}
    if not given & {"density", "sheet_loss", "db_per_m", "based_on"}:
        yield ("density",), "missing, expected 'opaque' or a number"
    message = "expected a density that is a number, or none"
    for density, key in _NOT_OPAQUE:
        if item.get(density) == "opaque" and key in given:
            yield (key,), f"{shown(item[key])} with 'opaque', {message}"
    if {"sheet_loss", "db_per_m"} <= given:
        yield ("db_per_m",), "expected either 'sheet_loss' or 'db_per_m'"
    for key in sorted(given & set(AMOUNTS)):
        base = item.get("based_on")
        known = isinstance(base, str) and base in library_names()
        if not known or library_entry(base).amount != key:
            takers = [name for name, entry in library().items() if entry.amount == key]
            yield (key,), f"expected only with 'based_on' one of {takers}"


def object_problems(item: Any) -> Iterator[Problem]:
    """Check an object: one shape, one way to say what and where it is."""
    if not isinstance(item, dict):
        return
    given = {key for key, value in item.items() if value is not None}
    yield from _shape_problems(given)
    if not given & {"material", "materials"}:
        yield (), "no material, expected 'material' or, for a mesh, 'materials'"
    for one, other in _EITHER:
        if {one, other} <= given:
            yield (other,), f"expected either {one!r} or {other!r}"
    if "scatter" in given and _is_off_centre(item.get("position")):
        message = "expected 0 for x and y, since the area of 'scatter' says where"
        yield ("position",), f"{shown(item['position'])}, {message}"


def _shape_problems(given: set[str]) -> Iterator[Problem]:
    shapes = sorted(given & _SHAPES)
    if len(shapes) != 1:
        yield (), f"{shapes or 'no shape'}, expected one of {sorted(_SHAPES)}"
    if "mesh" not in given:
        for key in sorted(given & _FOR_MESHES):
            yield (key,), "expected only for a mesh"


def trial_problems(item: Any, starts: Iterable[Any]) -> Iterator[Problem]:
    """Check a trial: its start is one of those that the map has, right or wrong."""
    name = item.get("start") if isinstance(item, dict) else None
    if not isinstance(name, str):
        return
    entries = (start for start in starts if isinstance(start, dict))
    names = [named for start in entries if isinstance(named := start.get("name"), str)]
    if name.casefold() not in (named.casefold() for named in names):
        yield ("start",), f"{shown(name)}, expected one of {shown(names)}"


def extent_problems(bounds: Floats) -> Iterator[Problem]:
    """Check the extents of all objects together; bounds are (2, 3) m."""
    sizes = bounds[1] - bounds[0]
    if sizes.max() > MAX_EXTENT:
        extents = " x ".join(f"{size:.1f}" for size in sizes)
        yield (), f"{extents} m, expected at most {MAX_EXTENT:g} m each way"


def _is_off_centre(position: Any) -> bool:
    return isinstance(position, list) and any(position[:2])
