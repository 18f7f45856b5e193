"""Write scenes as map files with their meshes in a folder.

Reading a written map gives the same scene, since all numbers are written with full
precision. Primitives, copies and variants are written as the meshes built from them.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from radarsim.files import write_atomically
from radarsim.presets.sensor_settings import BANDS_GHZ
from radarsim.scene.material import PLAIN_KEYS, Losses, Material, library_material
from radarsim.scene.scene import REFLECTOR, Part, Scene


def material_keys(material: Material) -> dict[str, Any]:
    """Return the map file keys that describe a material, with their values.

    >>> material_keys(Material("leaf", density=0.5, solid=False))
    {'density': 0.5, 'laser_density': 'opaque', 'solid': False}
    """
    keys: dict[str, Any] = {}
    base = Material(material.name)
    if material.rain:  # Only library materials have rain.
        keys = {"based_on": "rain", "mm_per_h": material.rain}
        base = library_material("rain", mm_per_h=material.rain)
    for name in ("density", "laser_density"):
        density = getattr(material, name)
        keys[name] = density if math.isfinite(density) else "opaque"
    if math.isfinite(material.laser_density) and material.laser_db != 0:
        keys["laser_db_per_m"] = material.laser_db
    if material.sheet_loss is not None:
        keys["sheet_loss"] = material.sheet_loss
    # ``density`` resets the losses of the base material to 0, so the losses are written
    # too.
    if any(material.radar_db) or material.rain:
        keys["db_per_m"] = _by_band(material.radar_db)
    for key in PLAIN_KEYS:
        value = getattr(material, key)
        is_given = value != getattr(base, key)
        if key == "backscatter_db":  # The reader would subtract the absorption again.
            is_given |= material.absorption_db != 0
        if is_given and value != -math.inf:  # -inf follows from absorption_db: all.
            value = _by_band(value) if isinstance(value, tuple) else value
            keys[key] = "all" if value == math.inf else value
    if material.radar_mirror or material.laser_mirror:
        is_both = material.radar_mirror and material.laser_mirror
        one = "radar" if material.radar_mirror else "laser"
        keys["mirror"] = "both" if is_both else one
    return keys


def _by_band(losses: Losses) -> dict[str, float]:
    return dict(zip(map(str, BANDS_GHZ), losses, strict=True))


def write_map(scene: Scene, path: Path) -> None:
    """Write a map file, and its meshes into a folder next to it.

    Args:
        scene: The scene.
        path: The map file; the folder has its stem and ``_meshes`` as its name.

    Raises:
        OSError: If a file cannot be written.
    """
    folder = path.parent / f"{path.stem}_meshes"
    reflectors = {each.name: each for each in scene.reflectors}
    objects: list[dict[str, Any]] = []
    files: dict[Path, bytes] = {}
    for number, (name, parts) in enumerate(_objects(scene)):
        if name in reflectors:
            it = reflectors[name]
            kind = {"trihedral": it.trihedral, "rcs_dbsm": it.rcs_dbsm}
            given = {key: value for key, value in kind.items() if value is not None}
            position = list(it.position)
            objects.append({"name": name, "reflector": given, "position": position})
            continue
        mesh = folder / f"{number}.obj"
        files[mesh] = _obj(parts)
        materials = {f"m{k}": part.material.name for k, part in enumerate(parts)}
        relative = f"{folder.name}/{mesh.name}"
        objects.append({"name": name, "mesh": relative, "materials": materials})
    own = [each for each in scene.materials.values() if each != REFLECTOR]
    content: dict[str, Any] = {
        "version": 1,
        "level": scene.level,
        "gps_origin_deg": list(scene.gps_origin),
        "materials": {each.name: material_keys(each) for each in own},
        "air": scene.air and scene.air.name,
        "objects": objects,
        "starts": [
            _placed_keys(start.pose.numbers()[:3], start.pose.yaw, name=start.name)
            for start in scene.starts
        ],
        "tags": [_placed_keys(each.position, id=each.id) for each in scene.tags],
        "victims": [
            _placed_keys(
                each.position,
                each.yaw,
                name=each.name,
                moves=each.moves,
                sound_db=each.loudness,
                sound_s=each.duration,
                co2_percent=each.co2,
            )
            for each in scene.victims
        ],
        "crates": [
            _placed_keys(each.position, each.yaw, name=each.name, size=list(each.size))
            for each in scene.crates
        ],
        "trial": scene.trial and {**asdict(scene.trial), "goal": [*scene.trial.goal]},
    }
    content = {key: value for key, value in content.items() if value not in (None, [])}
    text = yaml.dump(
        content, Dumper=yaml.CSafeDumper, sort_keys=False, allow_unicode=True
    )
    if files:
        folder.mkdir(parents=True, exist_ok=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    # The map is written last, so it never refers to meshes that do not exist yet.
    write_atomically({**files, path: text.encode()})


def _objects(scene: Scene) -> Iterator[tuple[str, list[Part]]]:
    names = dict.fromkeys(part.object_name for part in scene.parts)
    for name in names:
        yield name, [part for part in scene.parts if part.object_name == name]


def _obj(parts: Sequence[Part]) -> bytes:
    """Return the bytes of an OBJ file with one material group for each part."""
    lines: list[str] = []
    first = 1
    # `read_obj` returns the groups in reverse order.
    for number, part in reversed(list(enumerate(parts))):
        lines.append(f"usemtl m{number}\n")
        lines += [f"v {x!r} {y!r} {z!r}\n" for x, y, z in part.vertices.tolist()]
        corners = np.asarray(part.faces) + first
        lines += [f"f {a} {b} {c}\n" for a, b, c in corners.tolist()]
        first += len(part.vertices)
    return "".join(lines).encode()


def _degrees(yaw: float) -> float:
    """Convert radians to degrees that ``math.radians`` converts back exactly."""
    degrees = math.degrees(yaw)
    near = (math.nextafter(degrees, -math.inf), math.nextafter(degrees, math.inf))
    candidates = (round(degrees, 9), degrees, *near)
    exact = (each for each in candidates if math.radians(each) == yaw)
    return next(exact, degrees)


def _placed_keys(
    position: Sequence[float], yaw: float | None = None, **others: Any
) -> dict[str, Any]:
    """Return the keys of an entry with a position; keys that are None are left out."""
    angle = None if yaw is None else _degrees(yaw)
    keys = {**others, "position": list(position), "yaw_deg": angle}
    return {key: value for key, value in keys.items() if value is not None}
