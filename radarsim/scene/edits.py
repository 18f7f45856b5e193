"""Copies a scene with a changed material, an added object or a removed object."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from radarsim.errors import MapError, expected_one_of
from radarsim.scene.build import BuildError, make_material, orient_for
from radarsim.scene.map_checks import (
    Problem,
    air_problems,
    material_problems,
    surface_problems,
)
from radarsim.scene.map_loader import load_scene
from radarsim.scene.map_schema import MaterialEntry
from radarsim.scene.map_writer import material_keys
from radarsim.scene.material import Material, library_material, library_names
from radarsim.scene.scene import REFLECTOR, Part, Scene
from radarsim.validation import describe_settings
from radarsim.yaml_reader import parse_yaml


def with_material(scene: Scene, name: str, keys: Mapping[str, Any]) -> Scene:
    """Return a scene with a material changed; see ``Scene.with_material``."""
    try:
        entry = MaterialEntry.model_validate(dict(keys))
    except ValidationError as error:
        problems = describe_settings(error, MaterialEntry)
        raise MapError([f"material {name!r}: {each}" for each in problems]) from None
    base = scene.materials.get(name)
    if base is None and name in library_names():
        base = library_material(name)
    found: list[Problem] = []
    if entry.based_on is not None or base is None:
        base = None
        found += material_problems(dict(keys))
    _raise(f"material {name!r}", found)  # make_material needs a valid entry
    material = make_material(name, entry, base)
    found += surface_problems(entry, material)
    air = scene.air
    if air is not None and air.name == name:
        air = material
        found += air_problems(material)
    _raise(f"material {name!r}", found)
    return replace(
        scene,
        parts=tuple(
            _made_of(part, material) if part.material.name == name else part
            for part in scene.parts
        ),
        materials={**scene.materials, name: material},
        air=air,
    )


def _made_of(part: Part, material: Material) -> Part:
    """Return a copy of a part with another material."""
    mesh = part.vertices, part.faces
    if _has_inside(material) and not _has_inside(part.material):
        try:
            mesh = orient_for(material, *mesh)
        except BuildError as error:
            _raise(f"object {part.object_name!r}", error.problems)
    return Part(part.object_name, material, *mesh)


def _has_inside(material: Material) -> bool:
    return material.penetrable and material.sheet_loss is None


def with_object(scene: Scene, name: str, keys: Mapping[str, Any]) -> Scene:
    """Return a scene with an object added; see ``Scene.with_object``."""
    own = [each for each in scene.materials.values() if each != REFLECTOR]
    data = {
        "version": 1,
        "materials": {each.name: material_keys(each) for each in own},
        "objects": [{"name": name, **keys}],
    }
    # The object is loaded as a separate map, so all checks of maps apply to it.
    path = Path("scene.yaml").absolute()
    text = yaml.safe_dump(data, sort_keys=False, allow_unicode=True)
    try:
        added = load_scene(parse_yaml(path, text))
    except MapError as error:
        texts = [each.partition(": objects.0")[2] for each in error.problems]
        raise MapError([f"object {name!r}{each}" for each in texts]) from None
    taken = {part.object_name for part in scene.parts}
    for part in added.parts:
        if part.object_name in taken:
            text = f"object {part.object_name!r}, expected a new name"
            raise MapError([text])
    return replace(
        scene,
        parts=(*scene.parts, *added.parts),
        materials={**added.materials, **scene.materials},
        reflectors=(*scene.reflectors, *added.reflectors),
    )


def without(scene: Scene, name: str) -> Scene:
    """Return a scene without an object; see ``Scene.without``."""
    names = dict.fromkeys(part.object_name for part in scene.parts)
    copy = re.compile(rf"{re.escape(str(name))}_[0-9]+")
    gone = {name} & names.keys() or {each for each in names if copy.fullmatch(each)}
    if not gone:
        raise MapError([f"object {expected_one_of(name, names)}"])
    return replace(
        scene,
        parts=tuple(part for part in scene.parts if part.object_name not in gone),
        reflectors=tuple(each for each in scene.reflectors if each.name not in gone),
    )


def _raise(what: str, problems: list[Problem]) -> None:
    """Raise one error for all problems, if there are any.

    Raises:
        MapError: If the list of problems is not empty.
    """
    if problems:
        texts = [f"{'.'.join(map(str, keys))}: {text}" for keys, text in problems]
        raise MapError([f"{what}: {text}" for text in texts])
