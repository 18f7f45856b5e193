"""Figures 7 and 8: the Hokuyo is stopped by the bushes, the radar sees through them."""

from typing import Any, Final, NamedTuple

import numpy as np
from common import (
    BUSHES,
    FAR,
    ROOM,
    SEED,
    Drawn,
    bush_parts,
    draw_legend,
    draw_room,
    draw_title,
    far_side,
    hit_points,
    load_scene,
    name_hidden_objects,
    object_names,
    take_scans,
)
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

import radarsim
from radarsim.plotting.palette import LASER, RADAR
from radarsim.plotting.style import as_words
from radarsim.rng import generator_for
from radarsim.sensors.scan import Scan

HOKUYO: Final[dict[str, Any]] = {"max_range": FAR}
# N = 0: all three rays coincide, and the picture shows the centre one
PLAIN: Final[dict[str, Any]] = {"side_offset_uu": 0, "ray_weights": (0, 1, 0)}
PLACES: Final = [
    (x, y, 0.0) for x in np.arange(-9.5, -1.4, 1.0) for y in np.arange(-5.5, 5.6, 1.0)
]  # m, all over the near side


class Counts(NamedTuple):
    """Number of beams of a scan by their ends, and the objects read behind bushes."""

    beams: int
    behind: int
    inside: int  # in or at a bush
    objects: list[str]


def count_ends(scan: Scan) -> Counts:
    """Count where the beams of a scan truly ended."""
    behind = hit_points(scan)[:, 0] > far_side(load_scene(ROOM))
    echoes = scan.echoes
    inside, objects = 0, set()
    for part, target in echoes.targets.items():
        beams = echoes.beams[echoes.parts == part]
        inside += len(beams) if target.material == BUSHES else 0
        if behind[beams].any():
            objects.add(target.object)
    return Counts(len(behind), int(behind.sum()), inside, sorted(objects))


def count_over_grid(sensor: str, **settings: Any) -> tuple[int, int]:
    """Return the number of beams from all places, and of those that end behind."""
    scene, scanner = load_scene(ROOM), radarsim.load_sensor(sensor, **settings)
    rng = generator_for(SEED, sensor)
    counts = [count_ends(scanner.scan(scene, place, rng)) for place in PLACES]
    return sum(one.beams for one in counts), sum(one.behind for one in counts)


def draw_beams(scan: Scan, colour: str, at_bushes: str) -> Figure:
    """Draw the test map, and beams from their origins to their readings."""
    scene, drawing = load_scene(ROOM), Figure(figsize=(12, 8.2), dpi=120)
    axes = drawing.add_axes((0.01, 0.06, 0.98, 0.87))
    draw_room(axes)
    name_hidden_objects(axes)
    ends = hit_points(scan)[:, :2]
    behind = ends[:, 0] > far_side(scene)
    bushes = [part.object_name for part in bush_parts(scene)]
    inside = np.isin(object_names(scan), bushes)
    lines = np.stack([scan.cast.origins[:, :2], ends], axis=1)
    cross: Any = {"linewidths": 1.4}
    dot: Any = {"edgecolors": "white", "linewidths": 1.2}
    plain: Any = {}
    samples = {}
    # What sees through is drawn last and boldest. Width, opacity, marker, its area.
    for layer, (text, chosen, width, alpha, marker, area, edge) in enumerate(
        (
            (
                "is stopped by a wall on this side",
                ~behind & ~inside,
                0.5,
                0.35,
                "",
                0,
                plain,
            ),
            (at_bushes, inside, 0.7, 0.55, "x", 30, cross),
            ("sees through the bushes", behind, 2.4, 1.0, "o", 130, dot),
        )
    ):
        if not chosen.any():
            continue
        look: Any = {"colors": colour, "linewidths": width, "alpha": alpha}
        beams = LineCollection(list(lines[chosen]), label=text, **look)
        axes.add_collection(beams).set_zorder(2 + layer)
        if marker:
            points: Any = {"marker": marker, "color": colour, **edge}
            x, y = lines[chosen, 1].T
            axes.scatter(x, y, s=area, zorder=7, label=text, **points)
        sample: Any = {"marker": marker, "markersize": area**0.5, "linewidth": width}
        samples[text] = Line2D([], [], color=colour, **sample)
    draw_legend(drawing, dict(reversed(samples.items())), "large")
    return drawing


def draw_hokuyo() -> tuple[Figure, str]:
    """Draw figure 7: the Hokuyo sees nothing behind the bushes."""
    (scan,) = take_scans(ROOM, "hokuyo", **HOKUYO)
    beams, behind, inside, _ = count_ends(scan)
    own = radarsim.load_sensor("hokuyo").settings.max_range
    drawing = draw_beams(scan, LASER, "is stopped by the bushes")
    draw_title(
        drawing,
        f"To the Hokuyo the bushes are a wall: {behind} of {beams} beams see through",
        f"The Hokuyo's own range is {own:g} m; here it is given {FAR:g} m.",
    )
    beams, behind = count_over_grid("hokuyo", **HOKUYO)
    caption = (
        f"The Hokuyo, a laser: {inside} beams end at the near side of the bushes."
        f" From {len(PLACES)} places on this side, {behind} of {beams} beams end behind"
        " them."
    )
    return drawing, caption


def draw_radar() -> tuple[Figure, str]:
    """Draw figure 8: the radar sees through the bushes."""
    (scan,) = take_scans(ROOM, "radar", **PLAIN)
    beams, behind, inside, names = count_ends(scan)
    drawing = draw_beams(scan, RADAR, "is spent inside a bush")
    draw_title(
        drawing,
        f"The radar sees what is behind: {behind} of {beams} beams see through the"
        " bushes",
        "They go through the thin edges of the bushes and read what is behind:"
        f" {', '.join(map(as_words, names))}.",
    )
    beams, over = count_over_grid("radar", **PLAIN)
    caption = (
        f"The radar, without noise (N = 0): {behind} beams go through the bushes, and"
        f" {inside} are spent inside. From {len(PLACES)} places on this side, {over} of"
        f" {beams} beams end behind the bushes."
    )
    return drawing, caption


def draw() -> Drawn:
    """Draw figures 7 and 8."""
    return {"figure_07.png": draw_hokuyo(), "figure_08.png": draw_radar()}
