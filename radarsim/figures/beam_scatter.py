"""Figure 5b: one beam goes out, is scattered, and in part comes back."""

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Arc

from radarsim.figures.figure import DrawnFigure
from radarsim.figures.scan_spec import ROBOT, ScanSpec
from radarsim.figures.scene_view import draw_robot
from radarsim.geometry import Pose2
from radarsim.plotting.ray_segments import line_opacity, split_rays
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.robots.obstacles import slice_parts
from radarsim.sensors.scan import Scan

MAP: Final = "marulan_trial"
BEAM: Final = 99  # past a pole, and into the hedge behind it
RAYS: Final = 60
LIGHT: Final = 299_792_458.0  # m/s
OUT, BACK = "#1f73cc", "#c2410c"
_ASIDE: Final = 1.7  # m on both sides of the beam
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
    traces = tracer.trace(plan.rays, events=plan.events, incidence=plan.incidence)
    rays = plan.rays.take(np.arange(BEAM * RAYS, (BEAM + 1) * RAYS))
    return scanner.read(plan, traces), rays


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
    drawing = Figure(figsize=(13, 5.2), dpi=110, layout="constrained")
    plan, bars = drawing.subplots(2, 1, sharex=True, height_ratios=[1.35, 1])
    _draw_beam(plan, shot, scan, rays)
    plan.text(5.0, -0.95, "goes out", color=OUT)
    plan.text(5.0, 0.75, "comes back", color=BACK)
    for one in returns:
        _draw_waves(plan, one)
    _draw_strengths(bars, returns)
    bars.set_xlim(-1.2, returns[-1].range + 2.5)
    return DrawnFigure((drawing,), _caption(returns), (shot.command,))


def _caption(returns: Sequence[Return]) -> str:
    echoes = "; ".join(
        f"{one.name}, {one.range:.2f} m away, gives back {100 * one.strength:.0f} % of"
        f" the beam {2e9 * one.range / LIGHT:.0f} ns after it was sent"
        for one in returns
    )
    width = dict(_SETTINGS)["beamwidth_az_deg"]
    return (
        f"One beam of a radar, {width}° wide, here {RAYS} rays, goes out (blue) and is"
        " scattered where it meets something (arcs). Some of the scattered waves come"
        " back (arrows, the thicker the more), and the time that they take tells the"
        f" range: {echoes}. A thing that is narrower than the beam lets the rest pass,"
        f" so that this one direction has {len(returns)} objects at {len(returns)}"
        " ranges."
        f" What goes on to the right has got through the {returns[-1].name}'s leaves."
    )


def _draw_beam(axes: Axes, shot: ScanSpec, scan: Scan, rays: Rays) -> None:
    """Draw the objects, the robot and the rays, with the beam pointing to the right."""
    place, angle = scan.pose.position()[:2], float(scan.angles[BEAM])
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s], [s, c]])  # of rows, by minus the angle
    objects = [part for part in shot.scene.parts if part.object_name != "ground"]
    lines = (slice_parts(objects, shot.pose.z) - place) @ turn
    style: dict[str, Any] = {"colors": "0.25", "linewidths": 1.1, "zorder": 3}
    axes.add_collection(LineCollection(list(lines), **style))
    segments = split_rays(tracer_of(shot.scene), rays)
    shades = np.tile(to_rgba(OUT), (len(segments.rays), 1))
    shades[:, 3] = 0.6 * line_opacity(segments.shares)
    lines = LineCollection(
        list((segments.lines - place) @ turn), colors=shades, linewidths=0.7, zorder=2
    )
    axes.add_collection(lines)
    x, y = (np.array([shot.robot.x, shot.robot.y]) - place) @ turn
    draw_robot(axes, ROBOT, Pose2(float(x), float(y), shot.robot.yaw - angle))
    axes.set_aspect("equal")
    axes.set_ylim(-_ASIDE, _ASIDE)
    axes.set_ylabel("across, m")


def _draw_waves(axes: Axes, one: Return) -> None:
    """Draw the waves scattered by an object, and the part that comes back."""
    for size in np.arange(0.5, 1.6, 0.25):
        wave = Arc(
            (one.range, 0.0),
            2 * size,
            2 * size,
            theta1=100,
            theta2=260,
            color=BACK,
            alpha=min(1.0, 0.2 + one.strength) * (1.7 - size) / 1.3,
            linewidth=1.2,
            zorder=4,
        )
        axes.add_patch(wave)
    lift = 0.55 if one.strength > 0.3 else -0.55
    arrow = {
        "arrowstyle": "-|>",
        "color": BACK,
        "linewidth": 0.8 + 4 * one.strength,
        "shrinkA": 0,
        "shrinkB": 0,
    }
    axes.annotate(
        "", (0.4, lift / 3), (one.range - 1.2, lift), arrowprops=arrow, zorder=3.5
    )


def _nanoseconds(ranges: Any) -> Any:
    return np.asarray(ranges) * (2e9 / LIGHT)


def _metres(times: Any) -> Any:
    return np.asarray(times) * (LIGHT / 2e9)


def _draw_strengths(axes: Axes, returns: Sequence[Return]) -> None:
    """Draw the received power over the range."""
    for one in returns:
        axes.vlines(one.range, 0, 100 * one.strength, color=BACK, linewidth=5)
        axes.annotate(
            f"{one.name}: {one.range:.2f} m, {100 * one.strength:.0f} %",
            (one.range, 100 * one.strength),
            xytext=(-8, -4),
            textcoords="offset points",
            ha="right",
            va="top",
        )
    axes.set_ylim(0, 100)
    axes.set_xlabel("range, m")
    axes.set_ylabel("comes back, %")
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    times = axes.secondary_xaxis("top", functions=(_nanoseconds, _metres))
    times.set_xlabel("time there and back, ns", fontsize="small")
