"""Checks of a map file that concern several keys, or several entries.

Checks of raw data do not need a valid entry, so one invalid key does not hide the
problems of other keys.

`ProblemList` collects the problems: it lists the first and counts the others.
"""

import math
import re
from collections.abc import Collection, Iterable, Iterator
from typing import Final, TypeAlias

from pydantic import ValidationError

from radarsim.errors import MapError, did_you_mean
from radarsim.geometry import Floats
from radarsim.scene.map_schema import MAX_EXTENT, START_NAME, MaterialKeys
from radarsim.scene.material import (
    AMOUNTS,
    Material,
    library,
    library_entry,
    library_names,
)
from radarsim.validation import short_repr
from radarsim.yaml_reader import KeyPath, YamlFile

Problem: TypeAlias = tuple[KeyPath, str]  # keys inside of the entry, and the message

_SHAPES = {"box", "cylinder", "mesh", "reflector", "sphere"}
_NOT_OF_REFLECTORS = {"material", "materials", "rotation_deg", "yaw_deg"}
_MESH_KEYS = {"materials", "scale", "up_axis"}
_EXCLUDED_BY_OPAQUE = (
    ("density", "sheet_loss"),
    ("density", "db_per_m"),
    ("laser_density", "laser_db_per_m"),
    ("density", "attenuation_db"),
    ("density", "sheet_attenuation_db"),
)
_EITHER_SHEET_OR_INSIDE = (
    ("sheet_loss", "db_per_m"),
    ("sheet_attenuation_db", "attenuation_db"),
)
_EXCLUSIVE = (
    ("material", "materials"),
    ("yaw_deg", "rotation_deg"),
    ("repeat", "scatter"),
)


def material_problems(item: object) -> Iterator[Problem]:
    """Check a raw material: it must have radar losses, and its keys must be compatible.

    Keys of amounts, such as ``mm_per_h``, must fit the library material.
    """
    if not isinstance(item, dict):
        return
    given = {key for key, value in item.items() if value is not None}
    if not given & {"density", "sheet_loss", "db_per_m", "based_on"}:
        yield ("density",), "missing, expected 'opaque' or a number"
    hint = "expected a number or no value for"
    for density, key in _EXCLUDED_BY_OPAQUE:
        if item.get(density) == "opaque" and key in given:
            yield (key,), f"{short_repr(item[key])} with 'opaque', {hint} {density!r}"
    for sheet, key in _EITHER_SHEET_OR_INSIDE:
        if {sheet, key} <= given:
            yield (key,), f"expected either {sheet!r} or {key!r}"
    for key in sorted(given & set(AMOUNTS)):
        base = item.get("based_on")
        known = isinstance(base, str) and base in library_names()
        if not known or library_entry(base).amount != key:
            bases = [name for name, entry in library().items() if entry.amount == key]
            yield (key,), f"expected only where 'based_on' is one of {bases}"


def surface_problems(entry: MaterialKeys, material: Material) -> Iterator[Problem]:
    """Check that a material absorbs or mirrors at its surface only if it is opaque.

    ``sheet_attenuation_db`` needs a sheet, and ``attenuation_db`` needs a volume.
    """
    given = entry.model_dump(exclude_none=True)
    is_sheet = material.sheet_loss is not None
    for key, fits, of in (
        ("attenuation_db", not is_sheet, "has an inside"),
        ("sheet_attenuation_db", is_sheet, "has a 'sheet_loss'"),
    ):
        if given.get(key) and not (fits and math.isfinite(material.density)):
            yield (key,), f"expected only if a radar can enter the material and it {of}"
    if "transmission_db" in given and not material.radar_mirror:
        yield ("transmission_db",), "expected only for a material that mirrors radar"
    for wave, key, density in (
        ("radar", "absorption_db", material.density),
        ("laser", "laser_absorption_db", material.laser_density),
    ):
        if math.isinf(density):
            continue
        expected = f"expected only for a material that is opaque to a {wave}"
        if given.get(key):
            yield (key,), f"{given[key]:g}, {expected}"
        if entry.mirror in (wave, "both"):
            yield ("mirror",), f"{short_repr(entry.mirror)}, {expected}"


def air_problems(material: Material) -> Iterator[Problem]:
    """Check the material of the air: beams and robots must be able to enter it."""
    obstacles = {
        "opaque to a radar": math.isinf(material.density),
        "opaque to a laser": math.isinf(material.laser_density),
        "a sheet": material.sheet_loss is not None,
        "solid": material.solid,
    }
    wrong = " and ".join(text for text, applies in obstacles.items() if applies)
    if wrong:
        expected = "expected a material that beams and robots can enter"
        yield (), f"{short_repr(material.name)} is {wrong}, {expected}"


def object_problems(item: object) -> Iterator[Problem]:
    """Check that a raw object has exactly one shape, and keys that are compatible."""
    if not isinstance(item, dict):
        return
    given = {key for key, value in item.items() if value is not None}
    shapes = sorted(given & _SHAPES)
    if len(shapes) != 1:
        yield (), f"{shapes or 'no shape'}, expected one of {sorted(_SHAPES)}"
    if "mesh" not in given:
        for key in sorted(given & _MESH_KEYS):
            yield (key,), "expected only for a mesh"
    if "reflector" in given:
        for key in sorted(given & _NOT_OF_REFLECTORS):
            yield (key,), "not allowed for a reflector"
    elif not given & {"material", "materials"}:
        yield (), "no material, expected 'material' or, for a mesh, 'materials'"
    for first, second in _EXCLUSIVE:
        if {first, second} <= given:
            yield (second,), f"expected either {first!r} or {second!r}"
    position = item.get("position")
    if "scatter" in given and isinstance(position, list) and any(position[:2]):
        message = "expected 0 for x and y, since 'scatter' has an area"
        yield ("position",), f"{short_repr(position)}, {message}"


def unknown_materials(item: object, own: Collection[str]) -> Iterator[str]:
    """Yield the materials of a raw object that neither the map nor the library has."""
    if isinstance(item, dict):
        several = item.get("materials")
        names = several.values() if isinstance(several, dict) else ()
        for name in (item.get("material"), *names):
            if (
                isinstance(name, str)
                and name not in own
                and name not in library_names()
            ):
                yield name


def trial_problems(item: object, starts: Iterable[object]) -> Iterator[Problem]:
    """Check that a raw trial names a start of the map; the start may be invalid.

    The message suggests only names that are valid for a start.
    """
    name = item.get("start") if isinstance(item, dict) else None
    if not isinstance(name, str):
        return
    entries = (start for start in starts if isinstance(start, dict))
    names = [n for start in entries if isinstance(n := start.get("name"), str)]
    if name.casefold() not in (n.casefold() for n in names):
        valid = [each for each in names if re.fullmatch(START_NAME, each)]
        expected = "expected the name of a start"
        if valid or not names:
            expected = f"expected one of {short_repr(valid)}"
        meant = did_you_mean(name, valid)
        yield ("start",), f"{short_repr(name)}{meant}, {expected}"


def extent_problems(bounds: Floats) -> Iterator[Problem]:
    """Check the extent of a scene, given the bounds of all objects, (2, 3) m."""
    sizes = bounds[1] - bounds[0]
    if sizes.max() > MAX_EXTENT:
        extents = " x ".join(f"{size:.1f}" for size in sizes)
        yield (), f"{extents} m, expected at most {MAX_EXTENT:g} m in each direction"


MAX_REPORTED: Final = 100


class ProblemList:
    """Collects the problems of a map file; problems of its YAML syntax come first.

    A problem that occurs in several variants is reported once.
    """

    def __init__(self, file: YamlFile) -> None:
        self._file = file
        self._texts: dict[str, None] = {}
        self._reported: set[Problem] = set()  # without problems of the YAML syntax
        self._unreported = 0
        self._add(file.problems)

    @property
    def full(self) -> bool:
        """Whether the list is full; further problems are counted but not listed."""
        return len(self._texts) >= MAX_REPORTED

    def report(self, at: KeyPath, problems: Iterable[Problem]) -> bool:
        """Add the problems of an entry, and return whether the entry has none."""
        valid = True
        for keys, text in problems:
            valid = False
            problem = (*at, *keys), text
            if problem in self._reported:
                continue  # Another variant has reported the problem.
            if self.full:  # Finding the line in the file is slow, so only count.
                self._unreported += 1
            else:
                self._reported.add(problem)
                self._add([self._file.problem(*problem)])
        return valid

    def report_invalid(
        self, error: ValidationError, at: KeyPath, known: Iterable[str]
    ) -> None:
        """Add the pydantic errors of an entry; ``known`` are the allowed keys."""
        most = 0 if self.full else MAX_REPORTED
        if most:
            self._add(self._file.validation_problems(error, at, known=known, most=most))
        self._unreported += max(error.error_count() - most, 0)

    def raise_all(self) -> None:
        """Raise one error for all collected problems, if there are any.

        Raises:
            MapError: If there are problems; its last line counts those that are not
                listed.
        """
        if self._unreported:
            more = f"{self._file.path}: {self._unreported} more problems"
            raise MapError([*self._texts, more])
        if self._texts:
            raise MapError(list(self._texts))

    def _add(self, problems: Iterable[str]) -> None:
        for problem in problems:
            if self.full and problem not in self._texts:
                self._unreported += 1
            else:
                self._texts[problem] = None
