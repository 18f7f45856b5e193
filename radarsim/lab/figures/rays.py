"""Figures of single rays: 5b, a beam that is scattered, 11 and 12, rays beside it.

Figure 5b shows one beam that goes out, is scattered, and in part comes back. Figures
11 and 12 make the offset rays of a radar on a P3AT visible.
"""

import math
import re
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Arc, FancyArrowPatch

from radarsim.geometry import Floats, Pose2
from radarsim.lab.figures.figure import (
    ROBOT,
    DrawnFigure,
    ScanSpec,
    draw_legend,
    draw_title,
)
from radarsim.lab.figures.foliage_wall import MAP, STEP, draw_room
from radarsim.plotting.palette import LEFT_RAY, MARKER, RADAR, RETURNED, RIGHT_RAY
from radarsim.plotting.plan import draw_plan, draw_robot
from radarsim.plotting.ray_segments import line_opacity, split_rays
from radarsim.plotting.style import as_words, draw_scale_bar, write_at
from radarsim.presets.robots import load_robot
from radarsim.presets.sensor_settings import METRES_PER_UNIT
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.sensors.beams import LEFT, RIGHT
from radarsim.sensors.scan import Scan

BEAM: Final = 99  # past a pole, and into the hedge behind it
RAYS: Final = 60
WIDTH: Final = 2  # degrees, of the beam
LIGHT: Final = 299_792_458.0  # m/s
_BEND: Final = 1.1  # m; twice as far as the ways back are off the beam
RAY_COLOURS: Final = {LEFT: LEFT_RAY, RIGHT: RIGHT_RAY}
_WEIGHTS: Final = {LEFT: (0, 0, 1), RIGHT: (1, 0, 0)}
_ASIDE: Final = 0.18  # m between the robot and what is measured beside it
_THIN: Final[Any] = {"color": MARKER, "linewidth": 0.8, "linestyle": (0, (5, 3))}
_AROUND: Final = 1.3  # m of the robot that are seen closer
_SPARSE: Final = 3  # of so many beams the main panel draws one


class Return(NamedTuple):
    """Power that one object sends back.

    Attributes:
        name: Name of the object.
        range: Range of its strongest echo, m.
        strength: Strength of all its echoes, as a share of the beam.
    """

    name: str
    range: float
    strength: float


def scatter_spec(seed: int) -> ScanSpec:
    """Return the specification of the scan that holds the beam of figure 5b."""
    settings = (
        ("side_mode", "cone"),
        ("beamwidth_az_deg", WIDTH),
        ("cone_rays", RAYS),
        ("cone_sampling", "random"),
        ("return_mode", "all"),
    )
    return ScanSpec("marulan_trial", "radar", seed, settings)


def take_beam(shot: ScanSpec) -> tuple[Scan, Rays]:
    """Take the scan; return it and all rays of the beam."""
    tracer, scanner = tracer_of(shot.scene), shot.scanner
    plan = scanner.plan(tracer, shot.pose, generator_for(shot.seed, shot.sensor))
    builder = scanner.builder
    traces = tracer.trace(
        plan.rays, events=plan.draws.events, incidence=builder.needs_incidence
    )
    rays = plan.rays.take(np.arange(BEAM * RAYS, (BEAM + 1) * RAYS))
    return builder.build(plan, traces), rays


def returns_of(scan: Scan) -> list[Return]:
    """Return what each object sends back of the beam, the nearest object first."""
    echoes = scan.echoes
    mine = echoes.beams == BEAM
    found: dict[str, list[tuple[float, float]]] = {}
    for part, target in echoes.targets.items():
        chosen = mine & (echoes.parts == part)
        pairs = zip(echoes.strength[chosen], -echoes.ranges[chosen], strict=True)
        found.setdefault(target.object, []).extend(pairs)
    returns = [
        # of equally strong echoes the nearest: their ranges are negative
        Return(name, -max(pairs)[1], sum(strength for strength, _ in pairs))
        for name, pairs in found.items()
        if pairs
    ]
    return sorted(returns, key=lambda one: one.range)


def draw_scatter(seed: int) -> DrawnFigure:
    """Draw figure 5b: the beam from above, and the power received over the range."""
    shot = scatter_spec(seed)
    scan, rays = take_beam(shot)
    returns = returns_of(scan)
    drawing = Figure(figsize=(13, 5.6), dpi=120)
    plan = drawing.add_axes((0.055, 0.58, 0.935, 0.3))
    bars = drawing.add_axes((0.055, 0.1, 0.935, 0.36))
    near, far = -1.0, returns[-1].range + 1.6
    _draw_beam(plan, shot, scan, rays)
    # a metre is as long across the beam as along it
    box = plan.get_window_extent()
    half = (far - near) * box.height / box.width / 2
    plan.set_ylim(-half, half)
    plan.set_xticks([])
    for number, one in enumerate(returns):
        # To either side in turns, and by the range, so that all arrows are as far off
        # the beam and none covers another.
        _draw_return(plan, one, bend=(-1) ** number * _BEND / one.range)
    _draw_strengths(bars, returns)
    for axes in (plan, bars):
        axes.set_xlim(near, far)
    names = [re.sub(r" \d+$", "", as_words(one.name)) for one in returns]
    told = ", and behind it ".join(f"a {name}" for name in names)
    draw_title(drawing, f"One beam, several echoes: {told}")
    echoes = "; ".join(
        f"{one.name}, {one.range:.2f} m away, gives back {100 * one.strength:.0f} % of"
        f" the beam {2e9 * one.range / LIGHT:.0f} ns after it was sent"
        for one in returns
    )
    return DrawnFigure(
        drawing,
        "A radar beam that is wider than the pole goes out (thin lines); the pole sends"
        " back a part of it, and the hedge behind it another (arrows). The time that"
        " each takes tells its range.",
        (shot.command,),
        f"One beam of a radar, {WIDTH}° wide, here {RAYS} rays, goes out and is"
        " scattered where it meets something (arcs). Some of the scattered waves come"
        f" back (arrows, the thicker the more): {echoes}. A thing that is narrower than"
        f" the beam lets the rest pass, so that this one direction has {len(returns)}"
        f" objects at {len(returns)} ranges."
        f" What goes on to the right has got through the {returns[-1].name}'s leaves.",
    )


def _draw_beam(axes: Axes, shot: ScanSpec, scan: Scan, rays: Rays) -> None:
    """Draw the objects, the robot and the rays, with the beam pointing to the right."""
    place, angle = scan.pose.position()[:2], float(scan.angles[BEAM])
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s], [s, c]])  # of rows, by minus the angle
    parts = []
    for part in shot.scene.parts:
        level = (part.vertices[:, :2] - place) @ turn
        turned = np.column_stack([level, part.vertices[:, 2]])
        parts.append(replace(part, vertices=turned))
    draw_plan(axes, replace(shot.scene, parts=tuple(parts)), shot.pose.z)
    segments = split_rays(tracer_of(shot.scene), rays)
    lines = LineCollection(
        list((segments.lines - place) @ turn),
        colors=_shades(RADAR, 0.6 * line_opacity(segments.shares)),
        linewidths=0.7,
        zorder=2,
    )
    axes.add_collection(lines)
    x, y = (np.array([shot.robot.x, shot.robot.y]) - place) @ turn
    draw_robot(axes, ROBOT, Pose2(float(x), float(y), shot.robot.yaw - angle))
    axes.set_ylabel("across, m")


def _shades(colour: str, opacity: Floats) -> Floats:
    """Return a colour in each opacity, (P, 4)."""
    shades = np.tile(to_rgba(colour), (len(opacity), 1))
    shades[:, 3] = opacity
    return shades


def _draw_return(axes: Axes, one: Return, *, bend: float) -> None:
    """Draw the waves scattered by an object, and the arrow of those that come back."""
    for size in np.arange(0.5, 1.6, 0.25):
        wave = Arc(
            (one.range, 0.0),
            2 * size,
            2 * size,
            theta1=100,
            theta2=260,
            color=RETURNED,
            alpha=min(1.0, 0.2 + one.strength) * (1.7 - size) / 1.3,
            linewidth=1.2,
            zorder=4,
        )
        axes.add_patch(wave)
    arrow = FancyArrowPatch(
        (one.range, 0.0),
        (0.0, 0.0),
        connectionstyle=f"arc3,rad={bend}",  # bent to one side of the beam
        arrowstyle="-|>,head_length=8,head_width=4",
        mutation_scale=1.2,
        color=RETURNED,
        linewidth=1.2 + 5 * one.strength,
        shrinkA=0,
        shrinkB=0,
        zorder=4.5,
    )
    axes.add_patch(arrow)
    write_at(
        axes,
        f"{100 * one.strength:.0f} % comes back",
        (one.range / 2, bend * one.range / 2),
        offset=(0, 9 if bend > 0 else -9),
        ha="center",
        va="bottom" if bend > 0 else "top",
        color=RETURNED,
        zorder=6,
    )


def _draw_strengths(axes: Axes, returns: list[Return]) -> None:
    """Draw the received power over the range, and over the time there and back."""
    for one in returns:
        percent = 100 * one.strength
        axes.vlines(one.range, 0, percent, color=RETURNED, linewidth=5)
        text = f"{as_words(one.name)}: {one.range:.2f} m, {percent:.0f} %"
        place = (one.range, percent)
        beside: dict[str, Any] = {"offset": (-8, -4), "ha": "right", "va": "top"}
        write_at(axes, text, place, path_effects=None, **beside)
    axes.set_ylim(0, 130 * max(one.strength for one in returns))
    axes.set_xlabel("range, m")
    axes.set_ylabel("comes back, %")
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    per_metre = 2e9 / LIGHT  # ns
    times = axes.secondary_xaxis(
        "top",
        functions=(
            lambda ranges: np.asarray(ranges) * per_metre,
            lambda times: np.asarray(times) * (LIGHT / 2e9),
        ),
    )
    times.set_xlabel("time there and back, ns", fontsize="small")


def offset_spec(seed: int, offset: int, side: int) -> ScanSpec:
    """Return a scan with all rays on one side, at an offset in Unreal units."""
    settings = (
        ("side_mode", "lateral"),
        ("side_offset_uu", offset),
        ("ray_weights", _WEIGHTS[side]),
    )
    return ScanSpec(MAP, "radar", seed, settings)


def start_distance(scans: dict[int, Scan]) -> float:
    """Return the distance between the origins of left and right rays, m."""
    between = scans[LEFT].cast.origins - scans[RIGHT].cast.origins
    return float(np.linalg.norm(between, axis=1).max())


def draw_offset_rays(seed: int, *, offset: int) -> DrawnFigure:
    """Draw figure 11 or 12: left rays red and right rays blue, over the robot too."""
    shots = {side: offset_spec(seed, offset, side) for side in (LEFT, RIGHT)}
    scans = {side: shot.take()[0] for side, shot in shots.items()}
    drawing = Figure(figsize=(12.7, 6.3), dpi=120)
    room = drawing.add_axes((0.005, 0.09, 0.575, 0.76), anchor="W")
    close = drawing.add_axes((0.6, 0.09, 0.39, 0.76), anchor="E")
    shot = shots[LEFT]
    _draw_rays(room, shot, scans, every=_SPARSE)
    draw_room(room, shot)
    room.set_title(f"every {_SPARSE}rd beam", fontsize="medium", loc="left")
    _draw_rays(close, shot, scans, every=1)
    apart = start_distance(scans)
    _draw_close(close, shot, apart)
    draw_title(drawing, f"N = {offset}: left and right rays start {apart:.1f} m apart")
    names = {"left of the original beam": LEFT, "right of it": RIGHT}
    samples = {
        name: Line2D([], [], color=RAY_COLOURS[side]) for name, side in names.items()
    }
    draw_legend(drawing, samples)
    wide, beams = load_robot(ROBOT).width, len(scans[LEFT].ranges)
    differences = np.abs(scans[LEFT].ranges - scans[RIGHT].ranges)
    differ = int((differences > STEP).sum())
    return DrawnFigure(
        drawing,
        "A scan draws one ray of each beam by chance: the left one (red), the right one"
        f" (blue) or one between them. With N = {offset} they start {apart:.1f} m"
        f" apart, {'less' if apart < wide else 'more'} than the {wide:.2g} m of the"
        f" robot's width, and in {differ} of {beams} beams their ranges differ by more"
        f" than {100 * STEP:g} cm.",
        tuple(shot.command for shot in shots.values()),
        f"The offset rays of all {beams} beams of the radar on a {ROBOT}: red those"
        f" left of the original beam, blue those right of it, N = {offset} units or"
        f" {offset * METRES_PER_UNIT:g} m off, so that both start"
        f" {apart:.2f} m apart. Where they overlap they tell little; on"
        f" the robot's left red sticks out, on its right blue. In {differ} beams one of"
        f" the two reads more than {100 * STEP:g} cm farther than the other, and the"
        " beam gives now the one, now the other.",
    )


def _draw_rays(
    axes: Axes, shot: ScanSpec, scans: dict[int, Scan], *, every: int
) -> None:
    """Draw the rays of all scans in a mixed order, of every so many beams."""
    tracer = tracer_of(shot.scene)
    lines, shades = [], []
    for side, scan in scans.items():
        beams = np.arange(0, len(scan.ranges), every)
        segments = split_rays(tracer, scan.cast.take(beams))
        lines.append(segments.lines)
        shades.append(_shades(RAY_COLOURS[side], line_opacity(segments.shares)))
    every_line = np.concatenate(lines)
    # or one colour would lie over the other wherever the two meet
    order = generator_for(shot.seed, "order of strokes").permutation(len(every_line))
    rays = LineCollection(
        list(every_line[order]),
        colors=np.concatenate(shades)[order],
        linewidths=0.6 if every == 1 else 1.0,
        capstyle="butt",
        zorder=2,
    )
    axes.add_collection(rays)


def _draw_close(axes: Axes, shot: ScanSpec, apart: float) -> None:
    """Draw the robot, what is around it, and how far apart the rays start, m."""
    draw_robot(axes, ROBOT, shot.robot, zorder=3)
    x, y = shot.pose.x, shot.pose.y
    axes.set_aspect("equal")
    axes.set_xlim(x - _AROUND, x + _AROUND)
    axes.set_ylim(y - _AROUND, y + _AROUND)
    axes.set_xticks([])
    axes.set_yticks([])
    draw_scale_bar(axes)
    axes.set_title(f"around the {ROBOT}, every beam", fontsize="medium", loc="left")
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
