"""Figures 11 and 12: the offset rays of a radar on a P3AT, made visible."""

from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from radarsim.geometry import Floats
from radarsim.lab.figures.figure import ROBOT, DrawnFigure, ScanSpec, draw_title
from radarsim.lab.figures.foliage_wall import draw_room
from radarsim.plotting.annotations import draw_scale_bar
from radarsim.plotting.palette import LEFT_RAY, MARKER, RIGHT_RAY
from radarsim.plotting.plan import draw_robot
from radarsim.plotting.ray_segments import line_opacity, split_rays
from radarsim.presets.robots import load_robot
from radarsim.presets.sensor_settings import METRES_PER_UNIT
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.sensors.beams import LEFT, RIGHT
from radarsim.sensors.scan import Scan

MAP: Final = "foliage_room"
WEIGHTS: Final = {LEFT: (0, 0, 1), RIGHT: (1, 0, 0)}
RAY_COLOURS: Final = {LEFT: LEFT_RAY, RIGHT: RIGHT_RAY}
STEP: Final = 0.2  # m; ranges that differ by more count as different
_ASIDE: Final = 0.18  # m between the robot and what is measured beside it
_THIN: Final[Any] = {"color": MARKER, "linewidth": 0.8, "linestyle": (0, (5, 3))}
_AROUND: Final = 1.3  # m of the robot that are seen closer
SPARSE: Final = 3  # of so many beams the main panel draws one


def scan_spec_for(seed: int, offset: int, side: int) -> ScanSpec:
    """Return a scan with all rays on one side, at an offset in Unreal units."""
    settings = (
        ("side_mode", "lateral"),
        ("side_offset_uu", offset),
        ("ray_weights", WEIGHTS[side]),
    )
    return ScanSpec(MAP, "radar", seed, settings)


def start_distance(scans: dict[int, Scan]) -> float:
    """Return the distance between the origins of left and right rays, m."""
    between = scans[LEFT].cast.origins - scans[RIGHT].cast.origins
    return float(np.linalg.norm(between, axis=1).max())


def draw_offset_rays(seed: int, *, offset: int) -> DrawnFigure:
    """Draw figure 11 or 12: left rays red and right rays blue, over the robot too."""
    shots = {side: scan_spec_for(seed, offset, side) for side in (LEFT, RIGHT)}
    scans = {side: shot.take()[0] for side, shot in shots.items()}
    drawing = Figure(figsize=(12.7, 6.3), dpi=120)
    room = drawing.add_axes((0.005, 0.09, 0.575, 0.76), anchor="W")
    close = drawing.add_axes((0.6, 0.09, 0.39, 0.76), anchor="E")
    shot = shots[LEFT]
    _draw_rays(room, shot, scans, every=SPARSE)
    draw_room(room, shot)
    room.set_title(f"every {SPARSE}rd beam", fontsize="medium", loc="left")
    _draw_rays(close, shot, scans, every=1)
    _draw_close(close, shot)
    apart = start_distance(scans)
    _draw_dimension(close, shot, apart)
    draw_title(
        drawing,
        f"N = {offset}: left and right rays start {apart:.1f} m apart",
    )
    _legend(drawing)
    commands = tuple(shot.command for shot in shots.values())
    wide = load_robot(ROBOT).width
    caption = (
        "A scan draws one ray of each beam by chance: the left one (red), the right one"
        f" (blue) or one between them. With N = {offset} they start {apart:.1f} m"
        f" apart, {_compare(apart, wide)}, and in {_count_different(scans)} of"
        f" {len(scans[LEFT].ranges)} beams their ranges differ by more than"
        f" {100 * STEP:g} cm."
    )
    return DrawnFigure((drawing,), caption, commands, _details(offset, scans))


def _compare(apart: float, wide: float) -> str:
    """Compare a distance with the width of the robot, m."""
    less_or_more = "less" if apart < wide else "more"
    return f"{less_or_more} than the {wide:.2g} m of the robot's width"


def _count_different(scans: dict[int, Scan]) -> int:
    """Return the number of beams whose left and right ranges differ."""
    left, right = scans[LEFT].ranges, scans[RIGHT].ranges
    return int((np.abs(left - right) > STEP).sum())


def _draw_dimension(axes: Axes, shot: ScanSpec, apart: float) -> None:
    """Draw how far apart the rays start, with arrows behind the robot."""
    x, y = shot.pose.x, shot.pose.y
    behind = shot.robot.x - load_robot(ROBOT).length / 2 - _ASIDE
    for side in (-1, 1):
        place = y + side * apart / 2
        axes.plot([behind - _ASIDE / 3, x], [place] * 2, **_THIN, zorder=5)
    axes.annotate(
        "",
        (behind, y - apart / 2),
        (behind, y + apart / 2),
        arrowprops={"arrowstyle": "<|-|>", "shrinkA": 0, "shrinkB": 0, "color": MARKER},
        zorder=6,
    )
    axes.annotate(
        f"{apart:.1f} m",
        (behind, y),
        xytext=(-6, 0),
        textcoords="offset points",
        ha="right",
        va="center",
        fontsize="x-large",
        fontweight="bold",
    )


def _draw_close(axes: Axes, shot: ScanSpec) -> None:
    """Draw the robot, and limit the axes to what is around it."""
    draw_robot(axes, ROBOT, shot.robot, zorder=3)
    axes.set_aspect("equal")
    place = shot.pose.position()
    axes.set_xlim(place[0] - _AROUND, place[0] + _AROUND)
    axes.set_ylim(place[1] - _AROUND, place[1] + _AROUND)
    axes.set_xticks([])
    axes.set_yticks([])
    draw_scale_bar(axes)
    axes.set_title(f"around the {ROBOT}, every beam", fontsize="medium", loc="left")


def _details(offset: int, scans: dict[int, Scan]) -> str:
    differ, beams = _count_different(scans), len(scans[LEFT].ranges)
    return (
        f"The offset rays of all {beams} beams of the radar on a {ROBOT}: red those"
        f" left of the original beam, blue those right of it, N = {offset} units or"
        f" {offset * METRES_PER_UNIT:g} m off, so that both start"
        f" {start_distance(scans):.2f} m apart. Where they overlap they tell little; on"
        f" the robot's left red sticks out, on its right blue. In {differ} beams one of"
        f" the two reads more than {100 * STEP:g} cm farther than the other, and the"
        " beam gives now the one, now the other."
    )


def _draw_rays(
    axes: Axes, shot: ScanSpec, scans: dict[int, Scan], *, every: int
) -> None:
    """Draw the rays of all scans in a mixed order, of every so many beams."""
    each = {
        side: split_rays(
            tracer_of(shot.scene),
            scan.cast.take(np.arange(0, len(scan.ranges), every)),
        )
        for side, scan in scans.items()
    }
    shades = [_shades(side, segments.shares) for side, segments in each.items()]
    count = sum(len(segments.rays) for segments in each.values())
    order = generator_for(shot.seed, "order of strokes").permutation(count)
    rays = LineCollection(
        list(np.concatenate([segments.lines for segments in each.values()])[order]),
        colors=np.concatenate(shades)[order],
        linewidths=0.6 if every == 1 else 1.0,
        capstyle="butt",
        zorder=2,
    )
    axes.add_collection(rays)


def _legend(drawing: Figure) -> None:
    names = {LEFT: "left of the original beam", RIGHT: "right of it"}
    samples = [
        Line2D([], [], color=RAY_COLOURS[side], label=name)
        for side, name in names.items()
    ]
    drawing.legend(
        handles=samples, loc="lower center", ncols=len(samples), frameon=False
    )


def _shades(side: int, shares: Floats) -> Floats:
    """Return the colours of ray segments of one side, (P, 4)."""
    shades = np.tile(to_rgba(RAY_COLOURS[side]), (len(shares), 1))
    shades[:, 3] = line_opacity(shares)
    return shades
