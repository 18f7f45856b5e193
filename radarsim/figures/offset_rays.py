"""Figures 11 and 12: the offset rays of a radar on a P3AT, made visible."""

from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from radarsim.figures.figure import DrawnFigure
from radarsim.figures.scan_spec import ROBOT, ScanSpec
from radarsim.figures.scene_view import draw_robot
from radarsim.geometry import Floats
from radarsim.plotting.ray_segments import RAY_COLOURS, line_opacity, split_rays
from radarsim.presets.divergence import METRES_PER_UNIT
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.robots.obstacles import slice_parts
from radarsim.sensors.beams import LEFT, RIGHT
from radarsim.sensors.scan import Scan

MAP: Final = "foliage_room"
WEIGHTS: Final = {LEFT: (0, 0, 1), RIGHT: (1, 0, 0)}
STEP: Final = 0.2  # m; ranges that differ by more count as different
_AROUND: Final = 1.3  # m of the robot that are seen closer
_EDGE: Final = 0.4  # m around the room


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
    drawing = Figure(figsize=(13, 5.6), dpi=120, layout="constrained")
    room, close = drawing.subplots(1, 2, width_ratios=[1.62, 1])
    shot = shots[LEFT]
    for axes in (room, close):
        _draw_rays(axes, shot, scans)
        draw_robot(axes, ROBOT, shot.robot, zorder=3)
        axes.set_aspect("equal")
        axes.set_xlabel("x, m")
        axes.set_ylabel("y, m")
    low, high = shot.scene.bounds[:, :2] + np.array([[-_EDGE], [_EDGE]])
    room.set_xlim(low[0], high[0])
    room.set_ylim(low[1], high[1])
    place = shot.pose.position()
    close.set_xlim(place[0] - _AROUND, place[0] + _AROUND)
    close.set_ylim(place[1] - _AROUND, place[1] + _AROUND)
    room.set_title(f"all offset rays of one scan, N = {offset}", fontsize="medium")
    close.set_title(f"the same around the {ROBOT}", fontsize="medium")
    _legend(drawing)
    commands = tuple(shot.command for shot in shots.values())
    return DrawnFigure((drawing,), _caption(offset, scans), commands)


def _caption(offset: int, scans: dict[int, Scan]) -> str:
    left, right = scans[LEFT].ranges, scans[RIGHT].ranges
    differ = int((np.abs(left - right) > STEP).sum())
    return (
        f"The offset rays of all {len(left)} beams of the radar on a {ROBOT}: red those"
        f" left of the original beam, blue those right of it, N = {offset} units or"
        f" {offset * METRES_PER_UNIT:g} m off, so that both start"
        f" {start_distance(scans):.2f} m apart. Where they overlap they tell little; on"
        f" the robot's left red sticks out, on its right blue. In {differ} beams one of"
        f" the two reads more than {100 * STEP:g} cm farther than the other, and the"
        " beam gives now the one, now the other."
    )


def _draw_rays(axes: Axes, shot: ScanSpec, scans: dict[int, Scan]) -> None:
    """Draw the plan and the rays of all scans in a mixed order."""
    lines = slice_parts(shot.scene.parts, shot.pose.z)
    axes.add_collection(
        LineCollection(list(lines), colors="0.3", linewidths=1.0, zorder=1)
    )
    each = {
        side: split_rays(tracer_of(shot.scene), scan.cast)
        for side, scan in scans.items()
    }
    shades = [_shades(side, segments.shares) for side, segments in each.items()]
    count = sum(len(segments.rays) for segments in each.values())
    order = generator_for(shot.seed, "order of strokes").permutation(count)
    rays = LineCollection(
        list(np.concatenate([segments.lines for segments in each.values()])[order]),
        colors=np.concatenate(shades)[order],
        linewidths=0.6,
        capstyle="butt",
        zorder=2,
    )
    axes.add_collection(rays)


def _legend(drawing: Figure) -> None:
    names = {LEFT: "left of the original beam", RIGHT: "right of it"}
    samples = [
        Line2D([], [], color=RAY_COLOURS[side][0], label=name)
        for side, name in names.items()
    ]
    drawing.legend(
        handles=samples, loc="outside lower center", ncols=len(samples), frameon=False
    )


def _shades(side: int, shares: Floats) -> Floats:
    """Return the colours of ray segments of one side, (P, 4)."""
    shades = np.tile(to_rgba(RAY_COLOURS[side][0]), (len(shares), 1))
    shades[:, 3] = line_opacity(shares)
    return shades
