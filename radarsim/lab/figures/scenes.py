"""Figures 1 and 6: views of the maps."""

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from radarsim.geometry import Floats, Pose3
from radarsim.lab.figures.figure import (
    ROBOT,
    DrawnFigure,
    ScanSpec,
    draw_title,
    load_scene,
)
from radarsim.lab.figures.foliage_wall import (
    bush_parts,
    hidden_parts,
    new_sheet,
    show_room,
)
from radarsim.lab.figures.scene_view import (
    ABOVE,
    View,
    draw_solids,
    robot_parts,
)
from radarsim.plotting.annotations import HALO, as_words
from radarsim.plotting.plan import draw_robot
from radarsim.presets.robots import load_robot
from radarsim.robots.obstacles import slice_parts
from radarsim.scene.scene import Part, Scene
from radarsim.sensors.range_scanner import load_sensor

TRIAL: Final = "marulan_trial"
ROOM: Final = "foliage_room"
GROUND: Final = frozenset({"ground", "floor"})
OBLIQUE: Final = View(math.radians(-101), math.radians(33))  # x is right
_EDGE: Final = 1.2  # m around what is shown
_SMALL: Final = 9.0  # points


def draw_trial_scene(seed: int) -> DrawnFigure:
    """Draw figure 1: the trial scene, obliquely and from above."""
    scene = load_scene(TRIAL)
    drawing = Figure(figsize=(16, 6.9), dpi=110)
    oblique = drawing.add_axes((0.005, 0.02, 0.605, 0.87))
    plan = drawing.add_axes((0.655, 0.09, 0.34, 0.8))
    _draw_oblique(oblique, scene)
    _draw_plan(plan, scene)
    _label(plan, named_parts(scene), letter=0.38)
    plan.set_xlim(right=plan.get_xlim()[1] + 4.5)  # for the names
    draw_title(drawing, "The trial scene: poles, boxes and plants on open ground")
    return DrawnFigure(
        (drawing,),
        "The trial scene, made after the static trial of the Marulan data sets,"
        " obliquely and from above. Figures 2 to 5 are readings of it, taken by the"
        " robot on the left.",
        (f"radarsim check {TRIAL}",),
        _trial_details(scene, ScanSpec(TRIAL, "radar", seed).pose),
    )


def draw_test_map(seed: int) -> DrawnFigure:
    """Draw figure 6: the test map from above."""
    scene = load_scene(ROOM)
    drawing, plan = new_sheet()
    _draw_plan(plan, scene)
    show_room(plan, scene)
    objects = [part for part in named_parts(scene) if "wall" not in part.object_name]
    _label(plan, objects, letter=0.15)
    hidden = len(hidden_parts(scene))
    draw_title(
        drawing, f"The test map: a wall of bushes, and {hidden} things behind it"
    )
    return DrawnFigure(
        (drawing,),
        "The test map from above, with the robot at its start. Every straight line"
        " from one side to the other goes through leaves, more or less deep.",
        (f"radarsim check {ROOM}",),
        _map_details(scene, ScanSpec(ROOM, "radar", seed).pose),
    )


def _draw_oblique(axes: Axes, scene: Scene) -> None:
    """Draw a scene and a robot at its first start obliquely, with names."""
    model, pose = load_robot(ROBOT), ScanSpec(scene.name, "radar", 0).robot
    robot = robot_parts(model, pose)
    draw_solids(axes, replace(scene, parts=(*scene.parts, *robot)), OBLIQUE)
    _show(axes, OBLIQUE.project(_corners(scene))[:, :2])
    axes.set_axis_off()
    for part in (*named_parts(scene), robot[-1]):
        name = ROBOT if part is robot[-1] else part.object_name
        low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
        middle = (low + high) / 2
        x, y, _ = OBLIQUE.project(np.array([middle[0], middle[1], high[2]]))
        axes.annotate(
            as_words(name),
            (x, y),
            xytext=(0, 5),
            textcoords="offset points",
            ha="center",
            fontsize=_SMALL,
            path_effects=[HALO],
            zorder=6,
        )


def named_parts(scene: Scene) -> list[Part]:
    """Return one part of each object that stands on the ground."""
    parts = {part.object_name: part for part in scene.parts}
    return [part for name, part in parts.items() if name not in GROUND]


def _trial_details(scene: Scene, sensor: Pose3) -> str:
    parts = named_parts(scene)
    counts = Counter(_kind(part.object_name) for part in parts)
    solids = ", ".join(f"{counts[kind]} {kind}" for kind in ("poles", "boxes"))
    places = [part.vertices[:, :2] - sensor.position()[:2] for part in parts]
    away = [float(np.hypot(*place.T).min()) for place in places]
    return (
        f"{solids} and {counts['plants']} plants"
        f" stand {min(away):.0f} to {max(away):.0f} m from the sensor of the"
        f" {ROBOT}. Nothing else is there, so a beam"
        " that passes all of them does not come back."
    )


def _kind(name: str) -> str:
    """Return the category of an object by its name."""
    stem = re.sub(r"_\d+$", "", name)
    kinds = {"pole": "poles", "post": "poles"}
    boxes = {"block": "boxes", "crate": "boxes", "cabinet": "boxes"}
    return {**kinds, **boxes}.get(stem, "plants")


def _map_details(scene: Scene, sensor: Pose3) -> str:
    (wide, tall), bushes = _inside(scene), bush_parts(scene)
    cuts = [slice_parts([bush], sensor.z).reshape(-1, 2) for bush in bushes]
    thick = max(float(np.ptp(split_rays[:, 0])) for split_rays in cuts)
    hidden = len(hidden_parts(scene))
    depth = load_sensor("radar").settings.penetration_power / bushes[0].material.density
    return (
        f"A room of {wide:.1f} by {tall:.1f} m. A wall of {len(bushes)} spherical"
        f" bushes parts it from side to side; behind it stand {hidden} things to"
        " discover. The spheres overlap at the height of the sensor, so that every"
        " straight line goes through leaves: next to none at their edges,"
        f" {thick:.2f} m in the middle of the largest. The radar's beams get through"
        f" {depth:.2f} m. To a laser it is a solid wall."
    )


def _inside(scene: Scene) -> tuple[float, float]:
    """Return the inner width and depth of a room, m."""
    parts = {part.object_name: part.vertices for part in scene.parts}
    wide = parts["east_wall"][:, 0].min() - parts["west_wall"][:, 0].max()
    deep = parts["north_wall"][:, 1].min() - parts["south_wall"][:, 1].max()
    return float(wide), float(deep)


def _draw_plan(axes: Axes, scene: Scene) -> None:
    """Draw a scene from above, with a robot at its first start."""
    draw_solids(axes, scene, ABOVE)
    pose = ScanSpec(scene.name, "radar", 0).robot
    draw_robot(axes, ROBOT, pose)
    _show(axes, _corners(scene)[:, :2])
    front = pose.x + load_robot(ROBOT).length / 2
    _name(axes, f"{ROBOT} at its start", front, pose.y)
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")


def _corners(scene: Scene) -> Floats:
    """Return the corners of all bounding boxes and of the first start, (C, 3) m."""
    points = [np.array([[start.pose.x, start.pose.y, 0] for start in scene.starts[:1]])]
    for part in named_parts(scene):
        low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
        grid = np.meshgrid(*np.stack([low, high], axis=1))
        points.append(np.stack([axis.ravel() for axis in grid], axis=1))
    return np.concatenate(points)


def _show(axes: Axes, points: Floats) -> None:
    """Set the limits of axes to points, (P, 2) m, with a margin."""
    low, high = points.min(axis=0) - _EDGE, points.max(axis=0) + _EDGE
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])


def _label(axes: Axes, parts: Sequence[Part], *, letter: float) -> None:
    """Label objects, on the left where another object is on the right.

    Args:
        axes: Axes of a plan, m.
        parts: One part of each object to label.
        letter: Width of a letter, m.
    """
    boxes = [_box(part) for part in parts]
    for part, (west, south, east, north) in zip(parts, boxes, strict=True):
        text, middle = part.object_name, (south + north) / 2
        end, up, down = east + letter * len(text), middle + letter, middle - letter
        covered = any(
            east <= box[0] <= end and box[1] <= up and box[3] >= down for box in boxes
        )
        _name(axes, text, west if covered else east, middle, on_left=covered)


def _box(part: Part) -> tuple[float, float, float, float]:
    """Return the lower and upper x, y of a part, m."""
    low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])


def _name(axes: Axes, text: str, x: float, y: float, *, on_left: bool = False) -> None:
    """Write a text on the right or left of a place."""
    axes.annotate(
        as_words(text),
        (x, y),
        xytext=(-3 if on_left else 3, 0),
        textcoords="offset points",
        ha="right" if on_left else "left",
        va="center",
        fontsize=_SMALL,
        path_effects=[HALO],
        zorder=6,
    )
