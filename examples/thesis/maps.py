"""Figures 1 and 6: the maps in sunlight, obliquely and from above.

Triangles are painted from the farthest to the nearest (painter's algorithm), ordered by
their middles; large triangles are subdivided first, so that this order is right.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from common import (
    ROBOT,
    ROOM,
    TRIAL,
    Drawn,
    brightness,
    bush_parts,
    draw_title,
    hidden_parts,
    load_scene,
    painted_triangles,
    robot_pose,
    show_room,
)
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure

import radarsim
from radarsim.geometry import Floats, Pose2
from radarsim.plotting import palette
from radarsim.plotting.palette import colour_of
from radarsim.plotting.plan import draw_robot
from radarsim.plotting.style import as_words, write_at
from radarsim.presets.robots import RobotModel, load_robot
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import Mesh, box, cylinder

GROUND: Final = frozenset({"ground", "floor"})
EDGE: Final = 1.2  # m around the shown objects
SMALL: Final = 9.0  # points
BODY: Final = "robot"  # object name of the parts of a robot
HULL, DARK = Material("hull"), Material("tyre")
TYRE_WIDTH: Final = 0.09  # m
DECK_HEIGHT: Final = 0.03  # m
CLEARANCE: Final = 0.06  # m between the floor and the body
SUN: Final = np.array([-0.62, 0.22, 0.75])  # to the light: above left in a plan
SHADE: Final = 0.78  # brightness of the ground in shadows
LARGEST: Final = 2.0  # m, of sides of triangles that are painted obliquely
FINE: Final = 0.08  # m; the same of a robot, whose parts are close together
SEAM: Final = 0.6  # points; lines that close seams between triangles
PALER: Final = 0.65  # share of white in the colour of the ground
FLAT: Final = 0.05  # m above the lowest start, up to which a part is ground


@dataclass(frozen=True, slots=True)
class View:
    """Direction of an orthographic view.

    Attributes:
        azimuth: Azimuth of the viewer, rad, counter-clockwise from the map's x axis.
        elevation: Elevation of the viewer above the horizon, rad.
    """

    azimuth: float
    elevation: float

    def project(self, points: Floats) -> Floats:
        """Return right, up and depth towards the viewer of points, (..., 3) m each."""
        c, s = math.cos(self.azimuth), math.sin(self.azimuth)
        low, high = math.cos(self.elevation), math.sin(self.elevation)
        axes = np.array(
            [[-s, c, 0.0], [-high * c, -high * s, low], [low * c, low * s, high]]
        )
        return np.asarray(points @ axes.T)


ABOVE: Final = View(-math.pi / 2, math.pi / 2)  # x to the right, y up


OBLIQUE: Final = View(math.radians(-101), math.radians(33))  # x is right


def draw_trial_scene() -> tuple[Figure, str]:
    """Draw figure 1: the trial scene, obliquely and from above."""
    scene = load_scene(TRIAL)
    drawing = Figure(figsize=(16, 6.9), dpi=110)
    oblique = drawing.add_axes((0.005, 0.02, 0.605, 0.87))
    plan = drawing.add_axes((0.655, 0.09, 0.34, 0.8))
    parts = named_parts(scene)
    draw_oblique(oblique, scene)
    draw_from_above(plan, scene)
    label(plan, parts, letter=0.38)
    plan.set_xlim(right=plan.get_xlim()[1] + 4.5)  # for the names
    draw_title(drawing, "The trial scene: poles, boxes and plants on open ground")
    return drawing, (
        f"The trial scene, {len(parts)} objects after the static trial of the Marulan"
        " data sets, obliquely and from above."
    )


def draw_test_map() -> tuple[Figure, str]:
    """Draw figure 6: the test map from above."""
    scene = load_scene(ROOM)
    drawing = Figure(figsize=(12, 8.2), dpi=120)
    plan = drawing.add_axes((0.01, 0.06, 0.98, 0.87))
    draw_from_above(plan, scene)
    show_room(plan)
    objects = [part for part in named_parts(scene) if "wall" not in part.object_name]
    label(plan, objects, letter=0.15)
    hidden, bushes = len(hidden_parts(scene)), bush_parts(scene)
    title = f"The test map: a wall of bushes, and {hidden} things behind it"
    draw_title(drawing, title)
    power = radarsim.load_sensor("radar").settings.penetration_power
    depth = power / bushes[0].material.density
    return drawing, (
        f"A wall of {len(bushes)} spherical bushes, and {hidden} objects behind it."
        f" The radar's beams get through {depth:.2f} m of leaves."
    )


def draw() -> Drawn:
    """Draw figures 1 and 6."""
    return {"figure_01.png": draw_trial_scene(), "figure_06.png": draw_test_map()}


def named_parts(scene: Scene) -> list[Part]:
    """Return one part of each object that stands on the ground."""
    parts = {part.object_name: part for part in scene.parts}
    return [part for name, part in parts.items() if name not in GROUND]


def draw_oblique(axes: Axes, scene: Scene) -> None:
    """Draw a scene and a robot at its first start obliquely, with names."""
    robot = robot_parts(load_robot(ROBOT), robot_pose(scene))
    draw_solids(axes, replace(scene, parts=(*scene.parts, *robot)), OBLIQUE)
    show(axes, OBLIQUE.project(corners(scene))[:, :2])
    axes.set_axis_off()
    for part in (*named_parts(scene), robot[-1]):
        name = ROBOT if part is robot[-1] else part.object_name
        low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
        middle = (low + high) / 2
        x, y, _ = OBLIQUE.project(np.array([middle[0], middle[1], high[2]]))
        words = as_words(name)
        write_at(
            axes, words, (x, y), offset=(0, 5), ha="center", fontsize=SMALL, zorder=6
        )


def draw_from_above(axes: Axes, scene: Scene) -> None:
    """Draw a scene from above, with a robot at its first start."""
    draw_solids(axes, scene, ABOVE)
    pose = robot_pose(scene)
    draw_robot(axes, ROBOT, pose)
    show(axes, corners(scene)[:, :2])
    front = pose.x + load_robot(ROBOT).length / 2
    name(axes, f"{ROBOT} at its start", front, pose.y)
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")


def corners(scene: Scene) -> Floats:
    """Return the corners of all bounding boxes and of the first start, (C, 3) m."""
    points = [np.array([[start.pose.x, start.pose.y, 0] for start in scene.starts[:1]])]
    for part in named_parts(scene):
        low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
        grid = np.meshgrid(*np.stack([low, high], axis=1))
        points.append(np.stack([axis.ravel() for axis in grid], axis=1))
    return np.concatenate(points)


def show(axes: Axes, points: Floats) -> None:
    """Set the limits of axes to points, (P, 2) m, with a margin."""
    low, high = points.min(axis=0) - EDGE, points.max(axis=0) + EDGE
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])


def label(axes: Axes, parts: Sequence[Part], *, letter: float) -> None:
    """Label objects, on the left where another object is on the right.

    Args:
        axes: Axes of a plan, m.
        parts: One part of each object to label.
        letter: Width of a letter, m.
    """
    places = [part.vertices[:, :2] for part in parts]
    boxes = [(*xy.min(axis=0).tolist(), *xy.max(axis=0).tolist()) for xy in places]
    for part, (west, south, east, north) in zip(parts, boxes, strict=True):
        text, middle = part.object_name, (south + north) / 2
        end, up, down = east + letter * len(text), middle + letter, middle - letter
        covered = any(
            east <= box[0] <= end and box[1] <= up and box[3] >= down for box in boxes
        )
        name(axes, text, west if covered else east, middle, on_left=covered)


def name(axes: Axes, text: str, x: float, y: float, *, on_left: bool = False) -> None:
    """Write a text on the right or left of a place."""
    write_at(
        axes,
        as_words(text),
        (x, y),
        offset=(-3 if on_left else 3, 0),
        ha="right" if on_left else "left",
        va="center",
        fontsize=SMALL,
        zorder=6,
    )


def robot_parts(model: RobotModel, pose: Pose2) -> tuple[Part, ...]:
    """Return the body, the deck, the scanner and the wheels of a robot.

    Args:
        model: The robot class.
        pose: Pose of the robot on the floor, map frame.
    """
    top = 2 * model.origin_height
    inside = model.wheel_separation - TYRE_WIDTH
    across = model.wheel_separation + TYRE_WIDTH
    body = box(model.length, inside, top - CLEARANCE)
    deck = box(model.length, across, DECK_HEIGHT)
    scanner = cylinder(TYRE_WIDTH, model.height - top)
    ahead = model.items_of("RangeScanner")[0].mount.x
    pieces: list[tuple[Material, Mesh, tuple[float, float, float]]] = [
        (HULL, body, (0.0, 0.0, (top + CLEARANCE) / 2)),
        (DARK, deck, (0.0, 0.0, top + DECK_HEIGHT / 2)),
        (HULL, scanner, (ahead - TYRE_WIDTH, 0.0, (top + model.height) / 2)),
    ]
    upright, faces = cylinder(model.wheel_radius, TYRE_WIDTH)
    x, y, z = upright.T
    wheel = np.column_stack([x, -z, y]), faces  # around the y axis
    for fore in (-1, 1):
        for side in (-1, 1):
            axle, left = fore * model.wheel_base, side * model.wheel_separation
            pieces.append((DARK, wheel, (axle / 2, left / 2, model.wheel_radius)))
    c, s = np.cos(pose.yaw), np.sin(pose.yaw)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])  # of rows
    moved = np.array([pose.x, pose.y, 0.0])
    return tuple(
        Part(BODY, material, (vertices + np.array(place)) @ turn + moved, faces)
        for material, (vertices, faces), place in pieces
    )


def draw_solids(axes: Axes, scene: Scene, view: View) -> None:
    """Draw a scene in sunlight: its floor, the shadows on it, then the objects.

    Walls around a room cast no shadow into it.
    """
    ground, rest = ground_and_rest(scene)
    if ground:
        axes.add_collection(painting(ground, view, math.inf, PALER, zorder=0))
        low, high = scene.bounds[:, :2]
        casting = [
            part
            for part in rest
            if (part.vertices[:, :2].min(axis=0) > low).all()
            and (part.vertices[:, :2].max(axis=0) < high).all()
        ]
        axes.add_collection(shadows(ground, casting, view))
    largest = math.inf if view == ABOVE else LARGEST
    axes.add_collection(painting(rest, view, largest, 0.0, zorder=1))
    axes.set_aspect("equal")


def ground_and_rest(scene: Scene) -> tuple[list[Part], list[Part]]:
    """Return the parts that lie flat on the ground, and all others."""
    flat = min((start.pose.z for start in scene.starts), default=0.0) + FLAT
    ground = [part for part in scene.parts if top(part) <= flat]
    return ground, [part for part in scene.parts if top(part) > flat]


def top(part: Part) -> float:
    """Return the largest height of a part, m."""
    return float(part.vertices[:, 2].max(initial=-math.inf))


def painting(
    parts: Sequence[Part],
    view: View,
    largest: float,
    paler: float,
    *,
    zorder: int,
) -> PolyCollection:
    """Create the polygons of parts.

    Args:
        parts: The painted parts.
        view: Direction to see it from.
        largest: Sides of triangles that are longer are cut, m. What lies flat or is
            seen from right above is in order without cuts, whose seams would show.
        paler: Share of white in colours.
        zorder: Z-order in the axes.
    """
    corners, shades = [], []
    for part in parts:
        is_robot = part.object_name == BODY
        triangles = cut(part.vertices[part.faces], FINE if is_robot else largest)
        colour = colour_of(part.material)
        if is_robot:  # as in plans
            colour = palette.MARKER if part.material == DARK else palette.ROBOT
        # leaves are lit from both sides
        thin = part.material.sheet_loss is not None
        light = brightness(triangles, SUN, both_sides=thin)
        corners.append(triangles)
        shades.append(light[:, None] * np.array(to_rgb(colour)))
    seen = view.project(np.concatenate(corners))
    # Stable, so that triangles of equal depth are painted in the same order everywhere.
    order = np.argsort(seen[:, :, 2].mean(axis=1), kind="stable")
    paint = paler + (1 - paler) * np.concatenate(shades)[order]
    return painted_triangles(
        seen[order][:, :, :2],
        paint,
        # The ground is of large triangles without cuts, whose seams show more.
        linewidths=SEAM if zorder else 3 * SEAM,
        zorder=zorder,
    )


def shadows(
    ground: Sequence[Part],
    parts: Sequence[Part],
    view: View,
) -> PolyCollection:
    """Create the shadows of parts on the ground, clipped to its bounding box."""
    height = max(top(part) for part in ground)
    corners = np.concatenate([part.vertices[part.faces] for part in parts])
    # A part below the ground, such as the foot of a plant, casts its shadow where it
    # stands.
    lifts = np.maximum(corners[..., 2:] - height, 0.0)
    flat = corners[..., :2] - lifts * (SUN[:2] / SUN[2])
    floor = np.concatenate([part.vertices[:, :2] for part in ground])
    # Clipped, so that no shadow lies on the paper around the ground.
    flat = np.clip(flat, floor.min(axis=0), floor.max(axis=0))
    level = np.concatenate([flat, np.full_like(lifts, height)], axis=2)
    colour = np.array(to_rgb(colour_of(ground[0].material)))
    shade = SHADE * (PALER + (1 - PALER) * colour)
    return painted_triangles(
        view.project(level)[:, :, :2],
        shade,
        linewidths=0.3,
        zorder=0.5,
        label="shadows",
    )


def cut(corners: Floats, largest: float) -> Floats:
    """Subdivide triangles, (T, 3, 3) m, until no side is longer than ``largest``."""
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    large = sides.max(axis=1) > largest
    if not large.any():
        return corners
    a, b, c = np.swapaxes(corners[large], 0, 1)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    segments = np.concatenate([np.stack(one, axis=1) for one in quarters])
    return np.concatenate([corners[~large], cut(segments, largest)])
