"""Summarise a scene as text."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Final

from radarsim.presets.sensor_settings import BANDS_GHZ
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene, StartPose, Trial

LEAST_GROUP: Final = 3  # objects of one material that are listed in one line


def summarise(scene: Scene) -> list[str]:
    """Return lines that list a scene's extents, materials, objects and starts."""
    objects = len({part.object_name for part in scene.parts})
    extents = zip("xyz", *scene.bounds, strict=True)
    triangles: Counter[str] = Counter()
    for part in scene.parts:
        triangles[part.material.name] += len(part.faces)
    return [
        f"map {scene.name}, level {scene.level}",
        f"{_count(objects, 'object')}, {_count(scene.triangles, 'triangle')}",
        *(f"  {axis} from {low:.3f} to {high:.3f} m" for axis, low, high in extents),
        *([f"air: {scene.air.name}"] if scene.air else []),
        f"{_count(len(scene.starts), 'start')}, x y z in m, yaw in degrees",
        *(f"  {_start(start)}" for start in scene.starts),
        *([_trial(scene.trial)] if scene.trial else []),
        _count(len(scene.materials), "material"),
        *(
            f"  {material.name}: {_properties(material)};"
            f" {_count(triangles[name], 'triangle')}"
            for name, material in scene.materials.items()
        ),
        "objects, with their materials and triangles",
        *_objects(scene),
    ]


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def _properties(material: Material) -> str:
    words = [
        _losses("density ", material.density, material.radar_db),
        "laser " + _losses("", material.laser_density, [material.laser_db]),
        "solid" if material.solid else "can be driven through",
    ]
    if material.sheet_loss is not None:
        words.append(f"loses {material.sheet_loss:g} at each surface")
    for wave, mirrors, absorbed in (
        ("radar", material.radar_mirror, material.absorption_db),
        ("laser", material.laser_mirror, material.laser_absorption_db),
    ):
        if mirrors:
            words.append(f"a mirror to {wave}")
        if absorbed:
            amount = f"{absorbed:g} dB" if math.isfinite(absorbed) else "all"
            words.append(f"keeps {amount} of {wave}")
    if material.rain:
        words.append(f"rain of {material.rain:g} mm/h")
    return ", ".join(words)


def _losses(title: str, density: float, decibels: Sequence[float]) -> str:
    """Return the losses per metre; dB only if there are any."""
    losses = []
    if density or not any(decibels):
        losses.append(
            title + (f"{density:g} per m" if math.isfinite(density) else "opaque")
        )
    if len(set(decibels)) > 1:
        numbers = ", ".join(f"{db:.3g}" for db in decibels)
        bands = ", ".join(str(band) for band in BANDS_GHZ)
        losses.append(f"{numbers} dB per m at {bands} GHz")
    elif any(decibels):
        losses.append(f"{decibels[0]:.3g} dB per m")
    return " and ".join(losses)


def _objects(scene: Scene) -> list[str]:
    """Return a line for each object, or for many that differ in their number only."""
    groups: dict[tuple[str, str], list[Part]] = {}
    for part in scene.parts:
        stem = part.object_name.rstrip("0123456789")
        groups.setdefault((stem, part.material.name), []).append(part)
    lines = []
    for (_, material), group in groups.items():
        names = list(dict.fromkeys(part.object_name for part in group))
        listed = [(part.object_name, [part]) for part in group]
        if len(names) >= LEAST_GROUP:
            listed = [(f"{names[0]} to {names[-1]} ({len(names)})", group)]
        for name, parts in listed:
            triangles = sum(len(part.faces) for part in parts)
            lines.append(f"  {name}: {material}, {triangles}")
    return lines


def _start(start: StartPose) -> str:
    pose = start.pose
    place = f"{pose.x:.3f} {pose.y:.3f} {pose.z:.3f}"
    return f"{start.name}: {place}, {math.degrees(pose.yaw):.1f}"


def _trial(trial: Trial) -> str:
    x, y = trial.goal
    away = f"{trial.safety_distance:.3f} m away from all that is seen"
    return f"trial: {trial.start} to {x:.3f} {y:.3f}, {away}"
