"""Figure 5b: one beam goes out, is scattered, and in part comes back."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Arc, FancyArrowPatch

from radarsim.geometry import Floats, Pose2
from radarsim.lab.figures.figure import ROBOT, DrawnFigure, ScanSpec, draw_title
from radarsim.plotting.annotations import HALO, as_words
from radarsim.plotting.palette import RADAR, RETURNED
from radarsim.plotting.plan import draw_plan, draw_robot
from radarsim.plotting.ray_segments import line_opacity, split_rays
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.scene.scene import Scene
from radarsim.sensors.scan import Scan

MAP: Final = "marulan_trial"
BEAM: Final = 99  # past a pole, and into the hedge behind it
RAYS: Final = 60
LIGHT: Final = 299_792_458.0  # m/s
_BEND: Final = 1.1  # m; twice as far as the ways back are off the beam
_SETTINGS: Final = (
    ("side_mode", "cone"),
    ("beamwidth_az_deg", 2),
    ("cone_rays", RAYS),
    ("cone_sampling", "random"),
    ("return_mode", "all"),
)


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


def scan_spec_for(seed: int) -> ScanSpec:
    """Return the specification of the scan that holds the beam."""
    return ScanSpec(MAP, "radar", seed, _SETTINGS)


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
        Return(name, -max(pairs)[1], sum(strength for strength, _ in pairs))
        for name, pairs in found.items()
        if pairs
    ]
    return sorted(returns, key=lambda one: one.range)


def draw_scatter(seed: int) -> DrawnFigure:
    """Draw figure 5b: the beam from above, and the power received over the range."""
    shot = scan_spec_for(seed)
    scan, rays = take_beam(shot)
    returns = returns_of(scan)
    drawing = Figure(figsize=(13, 5.6), dpi=120)
    plan = drawing.add_axes((0.055, 0.58, 0.935, 0.3))
    bars = drawing.add_axes((0.055, 0.1, 0.935, 0.36))
    near, far = -1.0, returns[-1].range + 1.6
    _draw_beam(plan, shot, scan, rays)
    plan.set_ylim(*_across(plan, far - near))
    plan.set_xticks([])
    for number, one in enumerate(returns):
        _draw_waves(plan, one)
        _draw_way_back(plan, one, bend=(-1) ** number * _BEND / one.range)
    _draw_strengths(bars, returns)
    for axes in (plan, bars):
        axes.set_xlim(near, far)
    draw_title(drawing, f"One beam, several echoes: {_told(returns)}")
    return DrawnFigure(
        (drawing,),
        "A radar beam that is wider than the pole goes out (thin lines); the pole sends"
        " back a part of it, and the hedge behind it another (arrows). The time that"
        " each takes tells its range.",
        (shot.command,),
        _details(returns),
    )


def _told(returns: Sequence[Return]) -> str:
    """Return the names of what answers, without their numbers."""
    names = [re.sub(r" \d+$", "", as_words(one.name)) for one in returns]
    return ", and behind it ".join(f"a {name}" for name in names)


def _across(axes: Axes, length: float) -> tuple[float, float]:
    """Return y limits by which a metre is as long along the beam as across, m."""
    box = axes.get_window_extent()
    half = length * box.height / box.width / 2
    return -half, half


def _details(returns: Sequence[Return]) -> str:
    echoes = "; ".join(
        f"{one.name}, {one.range:.2f} m away, gives back {100 * one.strength:.0f} % of"
        f" the beam {2e9 * one.range / LIGHT:.0f} ns after it was sent"
        for one in returns
    )
    width = dict(_SETTINGS)["beamwidth_az_deg"]
    return (
        f"One beam of a radar, {width}° wide, here {RAYS} rays, goes out and is"
        " scattered where it meets something (arcs). Some of the scattered waves come"
        f" back (arrows, the thicker the more): {echoes}. A thing that is narrower than"
        f" the beam lets the rest pass, so that this one direction has {len(returns)}"
        f" objects at {len(returns)} ranges."
        f" What goes on to the right has got through the {returns[-1].name}'s leaves."
    )


def _draw_beam(axes: Axes, shot: ScanSpec, scan: Scan, rays: Rays) -> None:
    """Draw the objects, the robot and the rays, with the beam pointing to the right."""
    place, angle = scan.pose.position()[:2], float(scan.angles[BEAM])
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s], [s, c]])  # of rows, by minus the angle
    draw_plan(axes, _turned(shot.scene, place, turn), shot.pose.z)
    segments = split_rays(tracer_of(shot.scene), rays)
    shades = np.tile(to_rgba(RADAR), (len(segments.rays), 1))
    shades[:, 3] = 0.6 * line_opacity(segments.shares)
    lines = LineCollection(
        list((segments.lines - place) @ turn), colors=shades, linewidths=0.7, zorder=2
    )
    axes.add_collection(lines)
    x, y = (np.array([shot.robot.x, shot.robot.y]) - place) @ turn
    draw_robot(axes, ROBOT, Pose2(float(x), float(y), shot.robot.yaw - angle))
    axes.set_ylabel("across, m")


def _turned(scene: Scene, place: Floats, turn: Floats) -> Scene:
    """Return a scene with a place as origin, and turned; (2,) m and (2, 2), of rows."""
    parts = [
        replace(
            part,
            vertices=np.column_stack(
                [(part.vertices[:, :2] - place) @ turn, part.vertices[:, 2]]
            ),
        )
        for part in scene.parts
    ]
    return replace(scene, parts=tuple(parts))


def _draw_waves(axes: Axes, one: Return) -> None:
    """Draw the waves scattered by an object, and the part that comes back."""
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


def _draw_way_back(axes: Axes, one: Return, *, bend: float) -> None:
    """Draw an arrow from an object to the sensor, bent to one side of the beam."""
    arrow = FancyArrowPatch(
        (one.range, 0.0),
        (0.0, 0.0),
        connectionstyle=f"arc3,rad={bend}",
        arrowstyle="-|>,head_length=8,head_width=4",
        mutation_scale=1.2,
        color=RETURNED,
        linewidth=1.2 + 5 * one.strength,
        shrinkA=0,
        shrinkB=0,
        zorder=4.5,
    )
    axes.add_patch(arrow)
    axes.annotate(
        f"{100 * one.strength:.0f} % comes back",
        (one.range / 2, bend * one.range / 2),
        xytext=(0, 9 if bend > 0 else -9),
        textcoords="offset points",
        ha="center",
        va="bottom" if bend > 0 else "top",
        color=RETURNED,
        path_effects=[HALO],
        zorder=6,
    )


def _nanoseconds(ranges: Any) -> Any:
    return np.asarray(ranges) * (2e9 / LIGHT)


def _metres(times: Any) -> Any:
    return np.asarray(times) * (LIGHT / 2e9)


def _draw_strengths(axes: Axes, returns: Sequence[Return]) -> None:
    """Draw the received power over the range."""
    for one in returns:
        axes.vlines(one.range, 0, 100 * one.strength, color=RETURNED, linewidth=5)
        axes.annotate(
            f"{as_words(one.name)}: {one.range:.2f} m, {100 * one.strength:.0f} %",
            (one.range, 100 * one.strength),
            xytext=(-8, -4),
            textcoords="offset points",
            ha="right",
            va="top",
        )
    axes.set_ylim(0, 130 * max(one.strength for one in returns))
    axes.set_xlabel("range, m")
    axes.set_ylabel("comes back, %")
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    times = axes.secondary_xaxis("top", functions=(_nanoseconds, _metres))
    times.set_xlabel("time there and back, ns", fontsize="small")
