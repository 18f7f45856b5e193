"""From what a map says of a material to the material."""

import math
from collections.abc import Iterator
from dataclasses import asdict, replace
from typing import Any

from radarsim.presets.materials import library_material
from radarsim.scene.mapchecks import Problem
from radarsim.scene.material import Material
from radarsim.scene.materialmodel import MaterialEntry
from radarsim.yamlfile import shown


def from_library(name: str) -> Material:
    """Take a material from the library, with the amounts that it has there."""
    return Material(name, **asdict(library_material(name)))


def make_material(name: str, entry: MaterialEntry) -> Material:
    """Make a material of what an entry says and of what that is based on.

    All that is said of what a radar loses replaces all that the base has of that, and
    so it is with light. What beams enter is no mirror, and its surface keeps nothing.
    """
    base = Material(name)
    if entry.based_on is not None:
        amounts = {"g_per_m3": entry.g_per_m3, "mm_per_h": entry.mm_per_h}
        base = Material(name, **asdict(library_material(entry.based_on, **amounts)))
    changes = {**_of_radar(entry), **_of_light(entry), **_of_surface(entry)}
    return replace(base, **changes)


def _of_radar(entry: MaterialEntry) -> dict[str, Any]:
    said = (entry.density, entry.db_per_m, entry.sheet_loss)
    if all(value is None for value in said):
        return {}
    density = entry.density or 0.0
    changes: dict[str, Any] = {
        "density": density,
        "radar_db": entry.db_per_m or (0.0, 0.0, 0.0),
        "sheet_loss": entry.sheet_loss,
    }
    if math.isfinite(density):
        changes |= {"radar_mirror": False, "absorption_db": 0.0}
    return changes


def _of_light(entry: MaterialEntry) -> dict[str, Any]:
    if entry.laser_density is None and entry.laser_db_per_m is None:
        return {}
    density = entry.laser_density or 0.0
    changes: dict[str, Any] = {
        "laser_density": density,
        "laser_db": entry.laser_db_per_m or 0.0,
    }
    if math.isfinite(density):
        changes |= {"laser_mirror": False, "laser_absorption_db": 0.0}
    return changes


def _of_surface(entry: MaterialEntry) -> dict[str, Any]:
    said = {
        "solid": entry.solid,
        "absorption_db": entry.absorption_db,
        "laser_absorption_db": entry.laser_absorption_db,
    }
    if entry.mirror is not None:
        said["radar_mirror"] = entry.mirror in ("radar", "both")
        said["laser_mirror"] = entry.mirror in ("laser", "both")
    return {key: value for key, value in said.items() if value is not None}


def surface_problems(entry: MaterialEntry, material: Material) -> Iterator[Problem]:
    """Check that what an entry says of a surface is said of what ends beams there."""
    for wave, key, density in (
        ("radar", "absorption_db", material.density),
        ("laser", "laser_absorption_db", material.laser_density),
    ):
        expected = f"expected only of what is opaque to a {wave}"
        if math.isinf(density):
            continue
        if getattr(entry, key):
            yield (key,), f"{getattr(entry, key):g}, {expected}"
        if entry.mirror in (wave, "both"):
            yield ("mirror",), f"{shown(entry.mirror)}, {expected}"


def air_problems(material: Material) -> Iterator[Problem]:
    """Check that beams and robots can be in a material everywhere."""
    wrong = [
        text
        for text, so in (
            ("opaque to a radar", math.isinf(material.density)),
            ("opaque to a laser", math.isinf(material.laser_density)),
            ("a sheet", material.sheet_loss is not None),
            ("solid", material.solid),
        )
        if so
    ]
    if wrong:
        expected = "expected what beams and robots can be in"
        yield (), f"{shown(material.name)} is {' and '.join(wrong)}, {expected}"
