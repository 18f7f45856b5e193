"""What is in a scene, in words."""

import math
from collections import Counter

from radarsim.scene.material import Material
from radarsim.scene.scene import Scene, StartPose


def summarise(scene: Scene) -> list[str]:
    """Describe a scene in lines: objects, triangles, materials, extents, starts."""
    objects = len({part.object_name for part in scene.parts})
    return [
        f"map {scene.name}, level {scene.level}",
        f"{_count(objects, 'object')}, {_count(scene.triangles, 'triangle')}",
        *_extents(scene),
        _count(len(scene.materials), "material"),
        *_materials(scene),
        "objects, with their materials and triangles",
        *_objects(scene),
        f"{_count(len(scene.starts), 'start')}, x y z in m, yaw in degrees",
        *(f"  {_start(start)}" for start in scene.starts),
    ]


def _count(number: int, thing: str) -> str:
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def _extents(scene: Scene) -> list[str]:
    low, high = scene.bounds
    axes = zip("xyz", low, high, strict=True)
    return [f"  {axis} from {a:.3f} to {b:.3f} m" for axis, a, b in axes]


def _materials(scene: Scene) -> list[str]:
    triangles: Counter[str] = Counter()
    for part in scene.parts:
        triangles[part.material.name] += len(part.faces)
    return [
        f"  {material.name}: {_properties(material)};"
        f" {_count(triangles[name], 'triangle')}"
        for name, material in scene.materials.items()
    ]


def _properties(material: Material) -> str:
    words = [
        f"density {_density(material.density)}",
        f"laser {_density(material.laser_density)}",
        "solid" if material.solid else "can be driven through",
    ]
    if material.sheet_loss is not None:
        words.append(f"loses {material.sheet_loss:g} at each surface")
    return ", ".join(words)


def _density(density: float) -> str:
    return f"{density:g} per m" if math.isfinite(density) else "opaque"


def _objects(scene: Scene) -> list[str]:
    return [
        f"  {part.object_name}: {part.material.name}, {len(part.faces)}"
        for part in scene.parts
    ]


def _start(start: StartPose) -> str:
    pose = start.pose
    place = f"{pose.x:.3f} {pose.y:.3f} {pose.z:.3f}"
    return f"{start.name}: {place}, {math.degrees(pose.yaw):.1f}"
