"""``radarsim check``: print the contents of a map, or its errors."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from radarsim.cli.fields import MapName
from radarsim.cli.output import check_picture, print_lines, write_picture
from radarsim.errors import MapError

if TYPE_CHECKING:
    from radarsim.scene.material import Material
    from radarsim.scene.scene import Part, Scene, StartPose, Trial

LEAST_GROUP: Final = 3  # least number of numbered objects that share a line


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
        *_crates(scene),
        _count(len(scene.materials), "material"),
        *(
            f"  {material.name}: {_properties(material)};"
            f" {_count(triangles[name], 'triangle')}"
            for name, material in scene.materials.items()
        ),
        "objects, with their materials and triangles",
        *_objects(scene),
        *_mirrors(scene),
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
    words += (f"a mirror to {wave}" for wave in _mirrored(material))
    for wave, absorbed in (
        ("radar", material.absorption_db),
        ("laser", material.laser_absorption_db),
    ):
        if absorbed:
            amount = f"{absorbed:g} dB" if math.isfinite(absorbed) else "all"
            words.append(f"keeps {amount} of {wave}")
    if material.rain:
        words.append(f"rain of {material.rain:g} mm/h")
    return ", ".join(words)


def _losses(title: str, density: float, decibels: Sequence[float]) -> str:
    """Return the losses of a material per metre as text; 0 dB per m is left out."""
    from radarsim.presets.sensor_settings import BANDS_GHZ

    losses = []
    # A material without any loss is listed with a density of 0.
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
    """Return a line for each object, or for each group of numbered objects."""
    lines = []
    for name, parts in _listed(scene.parts):
        triangles = sum(len(part.faces) for part in parts)
        lines.append(f"  {name}: {parts[0].material.name}, {triangles}")
    return lines


def _listed(every: Iterable[Part]) -> Iterator[tuple[str, list[Part]]]:
    """Yield the name and parts of each object; numbered objects form a group."""
    groups: dict[tuple[str, str], list[Part]] = {}
    for part in every:
        stem = part.object_name.rstrip("0123456789")
        groups.setdefault((stem, part.material.name), []).append(part)
    for group in groups.values():
        names = list(dict.fromkeys(part.object_name for part in group))
        if len(names) >= LEAST_GROUP:
            yield f"{names[0]} to {names[-1]} ({len(names)})", group
        else:
            yield from ((part.object_name, [part]) for part in group)


def _mirrors(scene: Scene) -> list[str]:
    """Return a title and a line for each mirror; an empty list if there is none."""
    lines = []
    for name, (part, *_) in _listed(scene.parts):
        waves = _mirrored(part.material)
        if waves:
            lines.append(f"  {name}: to {' and '.join(waves)}")
    title = "mirrors, in which sensors see what stands elsewhere"
    return [title, *dict.fromkeys(lines)] if lines else []


def _mirrored(material: Material) -> list[str]:
    """Return the sensor types, radar or laser, that a material reflects as a mirror."""
    waves = {"radar": material.radar_mirror, "laser": material.laser_mirror}
    return [wave for wave, mirrors in waves.items() if mirrors]


def _crates(scene: Scene) -> list[str]:
    """Return a title and a line for each crate; an empty list if there is none."""
    lines = []
    for crate in scene.crates:
        x, y, z = crate.position
        size = " x ".join(f"{side:g}" for side in crate.size)
        yaw = math.degrees(crate.yaw)
        lines.append(f"  {crate.name}: {x:.3f} {y:.3f} {z:.3f}, {yaw:.1f}, {size}")
    title = f"{_count(len(lines), 'crate')}, x y z in m, yaw in degrees, size in m"
    return [title, *lines] if lines else []


def _start(start: StartPose) -> str:
    pose = start.pose
    place = f"{pose.x:.3f} {pose.y:.3f} {pose.z:.3f}"
    return f"{start.name}: {place}, {math.degrees(pose.yaw):.1f}"


def _trial(trial: Trial) -> str:
    x, y = trial.goal
    distance = f"safety distance {trial.safety_distance:.3f} m"
    return f"trial: {trial.start} to {x:.3f} {y:.3f}, {distance}"


def check(map_: MapName, *, plot: Path | None = None, strict: bool = False) -> int:
    """Read a map and print its contents, or all its errors.

    Args:
        map_: A map file or the name of a shipped map; MAP@VARIANT selects a variant.
        plot: Draw a plan of the map with names as a .png, .svg or .pdf file.
        strict: Exit with 1 if a start is occupied or the trial's goal is unreachable.

    Returns:
        The exit code.
    """
    # The file name is checked first, since reading and drawing a map may take long.
    form = check_picture(plot)
    from radarsim.scene.map_file import load_variants
    from radarsim.simulation.map_warnings import occupied_starts, trial_warnings

    try:
        scene, *variants = load_variants(map_)
        summary = summarise(scene)
        doubts = {
            "starts that are not free": occupied_starts(scene),
            "problems of the trial": trial_warnings(scene),
        }
    except MapError as error:
        # Errors of the map are the result of this command, so they go to stdout.
        print_lines(error.problems)
        return 1
    print_lines(summary)
    names = [variant.name for variant in variants]
    for title, lines in {"variants": names, **doubts}.items():
        if lines:
            print_lines((title, *(f"  {line}" for line in lines)))
    if plot is not None:
        from radarsim.plotting.plan import plot_scene
        from radarsim.plotting.style import figure_of, render

        write_picture(plot, render(figure_of(plot_scene(scene)), form))
    return int(strict and any(doubts.values()))
