"""Figure 5b: one radar beam goes out, is scattered, and in part comes back."""

import math
import re
from dataclasses import replace
from typing import Any, Final, NamedTuple

import numpy as np
from common import (
    ROBOT,
    SEED,
    TRIAL,
    Drawn,
    draw_title,
    load_scene,
    robot_pose,
    sensor_pose,
    shades,
)
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Arc, FancyArrowPatch

import radarsim
from radarsim.geometry import Pose2
from radarsim.plotting.marks import line_opacity, split_rays
from radarsim.plotting.palette import RADAR, RETURNED
from radarsim.plotting.plan import draw_plan, draw_robot
from radarsim.plotting.style import as_words, write_at
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import tracer_of
from radarsim.rng import generator_for
from radarsim.sensors.scan import Scan
from radarsim.sensors.scan_batch import ScanBatch

BEAM: Final = 99  # past a pole, and into the hedge behind it
RAYS: Final = 60
WIDTH: Final = 2  # degrees, of the beam
LIGHT: Final = 299_792_458.0  # m/s
BEND: Final = 1.1  # m; twice as far as the ways back are off the beam


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


def take_beam() -> tuple[Scan, Rays]:
    """Take the scan; return it and all rays of the beam."""
    scene = load_scene(TRIAL)
    scanner = radarsim.load_sensor(
        "radar",
        side_mode="cone",
        beamwidth_az_deg=WIDTH,
        cone_rays=RAYS,
        cone_sampling="random",
        return_mode="all",
    )
    pose = sensor_pose(scene)
    places = np.array([(*pose.numbers(), -1.0)])
    batch = ScanBatch(scanner.pattern, tracer_of(scene), places)
    batch.draw(0, generator_for(SEED, "radar"), "radar")
    batch.trace()
    rays = batch.all_rays(0).take(np.arange(BEAM * RAYS, (BEAM + 1) * RAYS))
    return batch.scan(0, "radar", pose), rays


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


def draw() -> Drawn:
    """Draw the beam from above, and the power received over the range."""
    scan, rays = take_beam()
    returns = returns_of(scan)
    drawing = Figure(figsize=(13, 5.6), dpi=120)
    plan = drawing.add_axes((0.055, 0.58, 0.935, 0.3))
    bars = drawing.add_axes((0.055, 0.1, 0.935, 0.36))
    near, far = -1.0, returns[-1].range + 1.6
    draw_beam(plan, scan, rays)
    # a metre is as long across the beam as along it
    frame = plan.get_window_extent()
    half = (far - near) * frame.height / frame.width / 2
    plan.set_ylim(-half, half)
    plan.set_xticks([])
    for number, one in enumerate(returns):
        # To either side in turns, and by the range, so that all arrows are as far off
        # the beam and none covers another.
        draw_return(plan, one, bend=(-1) ** number * BEND / one.range)
    draw_strengths(bars, returns)
    for axes in (plan, bars):
        axes.set_xlim(near, far)
    names = [re.sub(r" \d+$", "", as_words(one.name)) for one in returns]
    seen = ", and behind it ".join(f"a {name}" for name in names)
    draw_title(drawing, f"One beam, several echoes: {seen}")
    echoes = "; ".join(
        f"{one.name}, {one.range:.2f} m away, sends back {100 * one.strength:.0f} % of"
        f" the beam {2e9 * one.range / LIGHT:.0f} ns after it was sent"
        for one in returns
    )
    caption = f"A radar beam, {WIDTH}° wide, here {RAYS} rays, meets objects: {echoes}."
    return {"figure_05b.png": (drawing, caption)}


def draw_beam(axes: Axes, scan: Scan, rays: Rays) -> None:
    """Draw the objects, the robot and the rays, with the beam pointing to the right."""
    place, angle = scan.pose.position()[:2], float(scan.angles[BEAM])
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s], [s, c]])  # of rows, by minus the angle
    scene, parts = load_scene(TRIAL), []
    for part in scene.parts:
        level = (part.vertices[:, :2] - place) @ turn
        turned = np.column_stack([level, part.vertices[:, 2]])
        parts.append(replace(part, vertices=turned))
    draw_plan(axes, replace(scene, parts=tuple(parts)), scan.pose.z)
    segments = split_rays(tracer_of(scene), rays)
    lines = LineCollection(
        list((segments.lines - place) @ turn),
        colors=shades(RADAR, 0.6 * line_opacity(segments.shares)),
        linewidths=0.7,
        zorder=2,
    )
    axes.add_collection(lines)
    robot = robot_pose(scene)
    x, y = (np.array([robot.x, robot.y]) - place) @ turn
    draw_robot(axes, ROBOT, Pose2(float(x), float(y), robot.yaw - angle))
    axes.set_ylabel("across, m")


def draw_return(axes: Axes, one: Return, *, bend: float) -> None:
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


def draw_strengths(axes: Axes, returns: list[Return]) -> None:
    """Draw the received power over the range, and over the time there and back."""
    for one in returns:
        percent = 100 * one.strength
        axes.vlines(one.range, 0, percent, color=RETURNED, linewidth=5)
        text = f"{as_words(one.name)}: {one.range:.2f} m, {percent:.0f} %"
        place = (one.range, percent)
        aside: dict[str, Any] = {"offset": (-8, -4), "ha": "right", "va": "top"}
        write_at(axes, text, place, path_effects=None, **aside)
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
