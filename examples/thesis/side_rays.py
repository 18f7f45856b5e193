"""Figures 11 and 12: the rays to the left and right of a radar's beams on a P3AT."""

from typing import Any, Final

import numpy as np
from common import (
    ROBOT,
    ROOM,
    SEED,
    STEP,
    Drawn,
    draw_legend,
    draw_room,
    draw_title,
    load_scene,
    robot_pose,
    sensor_pose,
    shades,
    take_scans,
)
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from radarsim.plotting.marks import line_opacity, split_rays
from radarsim.plotting.palette import LEFT_RAY, MARKER, RIGHT_RAY
from radarsim.plotting.plan import draw_robot
from radarsim.plotting.style import draw_scale_bar, write_at
from radarsim.presets.robots import load_robot
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.sensors.beams import LEFT, RIGHT
from radarsim.sensors.scan import Scan

COLOURS: Final = {LEFT: LEFT_RAY, RIGHT: RIGHT_RAY}
WEIGHTS: Final = {LEFT: (0, 0, 1), RIGHT: (1, 0, 0)}  # all rays on one side
THIN: Final[Any] = {"color": MARKER, "linewidth": 0.8, "linestyle": (0, (5, 3))}
ASIDE: Final = 0.18  # m between the robot and its measure
AROUND: Final = 1.3  # m of the robot in the close view
SPARSE: Final = 3  # the view of the room has one beam of so many


def side_scans(offset: int) -> dict[int, Scan]:
    """Scan with all rays on the left and with all on the right, N = ``offset``."""
    settings: Any = {"side_mode": "lateral", "side_offset_uu": offset}
    return {
        side: take_scans(ROOM, "radar", ray_weights=weights, **settings)[0]
        for side, weights in WEIGHTS.items()
    }


def start_distance(scans: dict[int, Scan]) -> float:
    """Return the distance between the origins of left and right rays, m."""
    between = scans[LEFT].cast.origins - scans[RIGHT].cast.origins
    return float(np.linalg.norm(between, axis=1).max())


def draw_offset_rays(offset: int) -> tuple[Figure, str]:
    """Draw left rays red and right rays blue, in the room and around the robot."""
    scans = side_scans(offset)
    drawing = Figure(figsize=(12.7, 6.3), dpi=120)
    room = drawing.add_axes((0.005, 0.09, 0.575, 0.76), anchor="W")
    close = drawing.add_axes((0.6, 0.09, 0.39, 0.76), anchor="E")
    draw_rays(room, scans, every=SPARSE)
    draw_room(room)
    room.set_title(f"every {SPARSE}rd beam", fontsize="medium", loc="left")
    draw_rays(close, scans, every=1)
    apart = start_distance(scans)
    draw_close(close, apart)
    draw_title(drawing, f"N = {offset}: left and right rays start {apart:.1f} m apart")
    names = {"left of the original beam": LEFT, "right of it": RIGHT}
    samples = {
        name: Line2D([], [], color=COLOURS[side]) for name, side in names.items()
    }
    draw_legend(drawing, samples)
    far = np.abs(scans[LEFT].ranges - scans[RIGHT].ranges) > STEP
    caption = (
        "A scan draws one ray of each beam by chance: the left one (red), the right one"
        f" (blue) or one between them. With N = {offset} they start {apart:.2f} m"
        f" apart, and in {far.sum()} of {len(far)} beams their ranges differ by more"
        f" than {100 * STEP:g} cm."
    )
    return drawing, caption


def draw_rays(axes: Axes, scans: dict[int, Scan], *, every: int) -> None:
    """Draw the rays of all scans in a mixed order, of every so many beams."""
    tracer = tracer_of(load_scene(ROOM))
    lines, colours = [], []
    for side, scan in scans.items():
        beams = np.arange(0, len(scan.ranges), every)
        segments = split_rays(tracer, scan.cast.take(beams))
        lines.append(segments.lines)
        colours.append(shades(COLOURS[side], line_opacity(segments.shares)))
    every_line = np.concatenate(lines)
    # or one colour would lie over the other wherever the two meet
    order = generator_for(SEED, "order of strokes").permutation(len(every_line))
    rays = LineCollection(
        list(every_line[order]),
        colors=np.concatenate(colours)[order],
        linewidths=0.6 if every == 1 else 1.0,
        capstyle="butt",
        zorder=2,
    )
    axes.add_collection(rays)


def draw_close(axes: Axes, apart: float) -> None:
    """Draw the robot, its surroundings, and how far apart the rays start, m."""
    scene = load_scene(ROOM)
    sensor, robot = sensor_pose(scene), robot_pose(scene)
    draw_robot(axes, ROBOT, robot, zorder=3)
    x, y = sensor.x, sensor.y
    axes.set_aspect("equal")
    axes.set_xlim(x - AROUND, x + AROUND)
    axes.set_ylim(y - AROUND, y + AROUND)
    axes.set_xticks([])
    axes.set_yticks([])
    draw_scale_bar(axes)
    axes.set_title(f"around the {ROBOT}, every beam", fontsize="medium", loc="left")
    behind = robot.x - load_robot(ROBOT).length / 2 - ASIDE
    for side in (-1, 1):
        place = y + side * apart / 2
        axes.plot([behind - ASIDE / 3, x], [place] * 2, **THIN, zorder=5)
    axes.annotate(
        "",
        (behind, y - apart / 2),
        (behind, y + apart / 2),
        arrowprops={"arrowstyle": "<|-|>", "shrinkA": 0, "shrinkB": 0, "color": MARKER},
        zorder=6,
    )
    write_at(
        axes,
        f"{apart:.1f} m",
        (behind, y),
        offset=(-6, 0),
        ha="right",
        va="center",
        fontsize="x-large",
        fontweight="bold",
        path_effects=None,
    )


def draw() -> Drawn:
    """Draw figures 11 and 12."""
    return {
        "figure_11.png": draw_offset_rays(50),
        "figure_12.png": draw_offset_rays(100),
    }
