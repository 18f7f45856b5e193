"""What figures 7 to 10 count: where beams of Hokuyo and radar end in the test map.

The plan of that map is the background of figures 6 to 12.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from radarsim.lab.figures.figure import ROBOT, ScanSpec, hit_points, object_names
from radarsim.plotting.plan import draw_plan, draw_robot
from radarsim.plotting.style import as_words, draw_scale_bar, write_at
from radarsim.rng import generator_for
from radarsim.scene.scene import Part, Scene
from radarsim.sensors.scan import Scan

MAP: Final = "foliage_room"
BUSHES: Final = "foliage"  # the material
FAR: Final = 80.0  # m; the Hokuyo's maximum range in these figures
COUNT: Final = 20  # scans of figures 9 and 10
STEP: Final = 0.2  # m; ranges that differ by more count as different
_PLACES: Final = (np.arange(-9.5, -1.4, 1.0), np.arange(-5.5, 5.6, 1.0))  # x, y in m
_EDGE: Final = 0.45  # m around the room
_BELOW: Final = 0.6  # m more below it, for the scale bar


@dataclass(frozen=True, slots=True)
class Counts:
    """Number of beams of a scan by where they end.

    Attributes:
        beams: Number of beams.
        behind: Number of beams that end behind the bushes.
        inside: Number of beams that end in or at a bush.
        objects: Names of the objects behind the bushes that are read.
    """

    beams: int
    behind: int
    inside: int
    objects: tuple[str, ...]


class Changes(NamedTuple):
    """Number of beams whose range changes from scan to scan, by the cause.

    Attributes:
        jumping: Number of beams that read different objects.
        slanting: Number of beams that read the same solid object at a slant.
        deep: Number of beams that always end in bushes.
    """

    jumping: int
    slanting: int
    deep: int


def bush_parts(scene: Scene) -> list[Part]:
    """Return the parts that are bushes."""
    return [part for part in scene.parts if part.material.name == BUSHES]


def far_side(scene: Scene) -> float:
    """Return the largest x of the bushes, m; the hidden part of the room is beyond."""
    return max(float(bush.vertices[:, 0].max()) for bush in bush_parts(scene))


def hidden_parts(scene: Scene) -> list[Part]:
    """Return one part of each object behind the bushes, without walls."""
    side = far_side(scene)
    hidden = (part for part in scene.parts if part.vertices[:, 0].min() > side)
    parts = {part.object_name: part for part in hidden}
    return [part for name, part in parts.items() if "wall" not in name]


def count_ends(scene: Scene, scan: Scan) -> Counts:
    """Count where the beams of a scan truly ended."""
    behind = hit_points(scan)[:, 0] > far_side(scene)
    echoes = scan.echoes
    inside, objects = 0, set()
    for part, target in echoes.targets.items():
        beams = echoes.beams[echoes.parts == part]
        inside += len(beams) if target.material == BUSHES else 0
        if behind[beams].any():
            objects.add(target.object)
    return Counts(len(behind), int(behind.sum()), inside, tuple(sorted(objects)))


def count_over_grid(shot: ScanSpec) -> tuple[int, int, int]:
    """Scan from a grid of places on the near side of the bushes.

    Returns:
        Number of places, of beams, and of beams that end behind the bushes.
    """
    scene, scanner = shot.scene, shot.scanner
    rng = generator_for(shot.seed, shot.sensor)
    poses = [(x, y, 0.0) for x in _PLACES[0] for y in _PLACES[1]]
    scans = [scanner.scan(scene, pose, rng) for pose in poses]
    counts = [count_ends(scene, scan) for scan in scans]
    return (
        len(poses),
        sum(count.beams for count in counts),
        sum(count.behind for count in counts),
    )


def hokuyo(seed: int) -> ScanSpec:
    """Return the specification of the scan of figure 7."""
    return ScanSpec(MAP, "hokuyo", seed, (("max_range", FAR),))


def radar(seed: int, offset: int) -> ScanSpec:
    """Return the scan of figures 8 to 10 for an offset of side rays, Unreal units."""
    if offset:
        return ScanSpec(MAP, "radar", seed, (("side_offset_uu", offset),))
    # all three rays coincide, and the pictures show the centre one
    settings = (("side_offset_uu", 0), ("ray_weights", (0, 1, 0)))
    return ScanSpec(MAP, "radar", seed, settings)


def count_moved(scan: Scan, seed: int) -> int:
    """Return the number of beams whose range differs from the one without side rays."""
    (reference,) = radar(seed, 0).take()
    return int((np.abs(scan.ranges - reference.ranges) > STEP).sum())


def count_changes(scene: Scene, scans: Sequence[Scan]) -> Changes:
    """Count the beams whose range changes from scan to scan, by the cause."""
    ranges = np.array([scan.ranges for scan in scans])
    changed = np.ptp(ranges, axis=0) > STEP
    answers = np.array([object_names(scan) for scan in scans])
    # Bushes overlap: from one to its neighbour a beam does not jump to another thing.
    answers[np.isin(answers, [bush.object_name for bush in bush_parts(scene)])] = BUSHES
    same = (answers == answers[0]).all(axis=0)
    bushes = answers[0] == BUSHES
    return Changes(
        int((changed & ~same).sum()),
        int((changed & same & ~bushes).sum()),
        int((changed & same & bushes).sum()),
    )


def new_sheet() -> tuple[Figure, Axes]:
    """Return a figure for the test map, and its axes."""
    drawing = Figure(figsize=(12, 8.2), dpi=120)
    return drawing, drawing.add_axes((0.01, 0.06, 0.98, 0.87))


def draw_room(axes: Axes, shot: ScanSpec) -> None:
    """Draw the test map with the robot of a scan, without axes and with a scale bar."""
    draw_plan(axes, shot.scene, shot.pose.z)
    draw_robot(axes, ROBOT, shot.robot, zorder=6)
    show_room(axes, shot.scene)


def show_room(axes: Axes, scene: Scene) -> None:
    """Set the limits, the same in all figures, and replace axes by a scale bar."""
    low, high = scene.bounds[:, :2] + np.array([[-_EDGE], [_EDGE]])
    low[1] -= _BELOW
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_axis_off()
    draw_scale_bar(axes)


def name_hidden_objects(axes: Axes, scene: Scene) -> None:
    """Write the names of the objects behind the bushes to their right."""
    for part in hidden_parts(scene):
        low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
        text, place = as_words(part.object_name), (high[0], (low[1] + high[1]) / 2)
        style: Any = {"va": "center", "fontsize": "large", "zorder": 8}
        write_at(axes, text, place, offset=(5, 0), **style)
