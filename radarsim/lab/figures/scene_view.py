"""Views of whole scenes, shaded.

Triangles are painted from the farthest to the nearest (painter's algorithm), ordered by
their middles; large triangles are subdivided first, so that this order is right.

A robot as parts of a scene: body, deck and wheels, by the numbers of its class.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb

from radarsim.geometry import Floats, Pose2
from radarsim.lab.plants.figure import brightness, painted_triangles
from radarsim.plotting.palette import MARKER, ROBOT, colour_of
from radarsim.presets.robots import RobotModel
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene
from radarsim.scene.shapes import Mesh, box, cylinder

NAME: Final = "robot"  # of the parts of a robot
HULL, DARK = Material("hull"), Material("tyre")
_TYRE_WIDTH: Final = 0.09  # m
_DECK_HEIGHT: Final = 0.03  # m
_CLEARANCE: Final = 0.06  # m between the floor and the body
SUN: Final = np.array([-0.62, 0.22, 0.75])  # to the light: above left in a plan
_SHADE: Final = 0.78  # brightness of the ground in shadows
_LARGEST: Final = 2.0  # m, of sides of triangles that are painted obliquely
_FINE: Final = 0.08  # m; the same of a robot, whose parts are close together
_SEAM: Final = 0.6  # points; lines that close seams between triangles
_PALER: Final = 0.65  # share of white in the colour of the ground
_FLAT: Final = 0.05  # m above the lowest start, up to which a part is ground


def robot_parts(model: RobotModel, pose: Pose2) -> tuple[Part, ...]:
    """Return the body, the deck, the scanner and the wheels of a robot.

    Args:
        model: The robot class.
        pose: Pose of the robot on the floor, map frame.
    """
    top = 2 * model.origin_height
    inside = model.wheel_separation - _TYRE_WIDTH
    across = model.wheel_separation + _TYRE_WIDTH
    body = box(model.length, inside, top - _CLEARANCE)
    deck = box(model.length, across, _DECK_HEIGHT)
    scanner = cylinder(_TYRE_WIDTH, model.height - top)
    ahead = model.items_of("RangeScanner")[0].mount.x
    pieces: list[tuple[Material, Mesh, tuple[float, float, float]]] = [
        (HULL, body, (0.0, 0.0, (top + _CLEARANCE) / 2)),
        (DARK, deck, (0.0, 0.0, top + _DECK_HEIGHT / 2)),
        (HULL, scanner, (ahead - _TYRE_WIDTH, 0.0, (top + model.height) / 2)),
    ]
    ends = (-1, 1)
    pieces += [
        (
            DARK,
            _wheel(model.wheel_radius),
            (
                fore * model.wheel_base / 2,
                side * model.wheel_separation / 2,
                model.wheel_radius,
            ),
        )
        for fore in ends
        for side in ends
    ]
    return tuple(
        Part(NAME, material, _placed(vertices + np.array(place), pose), faces)
        for material, (vertices, faces), place in pieces
    )


def _wheel(radius: float) -> Mesh:
    """Create a cylinder around the y axis."""
    vertices, faces = cylinder(radius, _TYRE_WIDTH)
    x, y, z = vertices.T
    return np.column_stack([x, -z, y]), faces


def _placed(vertices: Floats, pose: Pose2) -> Floats:
    c, s = np.cos(pose.yaw), np.sin(pose.yaw)
    turn = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])  # of rows
    return np.asarray(vertices @ turn + np.array([pose.x, pose.y, 0.0]))


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


def ground_colour(scene: Scene) -> Floats:
    """Return the colour of the painted floor, RGB (3,)."""
    colour = colour_of(_ground_and_rest(scene)[0][0].material)
    level = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]])
    lit = brightness(level, SUN)[0] * np.array(to_rgb(colour))
    return np.asarray(_PALER + (1 - _PALER) * lit)


def draw_solids(axes: Axes, scene: Scene, view: View) -> None:
    """Draw a scene in sunlight: its floor, the shadows on it, then the objects.

    Walls around a room cast no shadow into it.
    """
    ground, rest = _ground_and_rest(scene)
    if ground:
        axes.add_collection(_painting(ground, view, math.inf, _PALER, zorder=0))
        casting = [part for part in rest if not _encloses(part, scene)]
        axes.add_collection(_shadows(ground, casting, view))
    largest = math.inf if view == ABOVE else _LARGEST
    axes.add_collection(_painting(rest, view, largest, 0.0, zorder=1))
    axes.set_aspect("equal")


def _ground_and_rest(scene: Scene) -> tuple[list[Part], list[Part]]:
    flat = min((start.pose.z for start in scene.starts), default=0.0) + _FLAT
    ground = [part for part in scene.parts if _top(part) <= flat]
    return ground, [part for part in scene.parts if _top(part) > flat]


def _encloses(part: Part, scene: Scene) -> bool:
    """Return whether a part reaches an edge of the map, as walls around a room do."""
    low, high = part.vertices[:, :2].min(axis=0), part.vertices[:, :2].max(axis=0)
    return bool(
        (low <= scene.bounds[0, :2]).any() or (high >= scene.bounds[1, :2]).any()
    )


def _top(part: Part) -> float:
    return float(part.vertices[:, 2].max(initial=-math.inf))


def _painting(
    parts: Sequence[Part],
    view: View,
    largest: float,
    paler: float,
    *,
    zorder: int,
) -> PolyCollection:
    """Create the polygons of parts.

    Args:
        parts: What is painted.
        view: Direction to see it from.
        largest: Sides of triangles that are longer are cut, m. What lies flat or is
            seen from right above is in order without cuts, whose seams would show.
        paler: Share of white in colours.
        zorder: Z-order in the axes.
    """
    corners = [
        _cut(part.vertices[part.faces], _FINE if _is_robot(part) else largest)
        for part in parts
    ]
    shades = [
        _brightness(part, triangles)[:, None] * np.array(to_rgb(_colour(part)))
        for part, triangles in zip(parts, corners, strict=True)
    ]
    seen = view.project(np.concatenate(corners))
    order = np.argsort(seen[:, :, 2].mean(axis=1), kind="stable")
    paint = paler + (1 - paler) * np.concatenate(shades)[order]
    return painted_triangles(
        seen[order][:, :, :2],
        paint,
        linewidths=_SEAM if zorder else 3 * _SEAM,
        zorder=zorder,
    )


def _colour(part: Part) -> str:
    """Return the colour of a part: of robots that of plans, else the material's."""
    if _is_robot(part):
        return MARKER if part.material == DARK else ROBOT
    return colour_of(part.material)


def _is_robot(part: Part) -> bool:
    return part.object_name == NAME


def _brightness(part: Part, corners: Floats) -> Floats:
    """Return the brightness of triangles, (T,); leaves are lit from both sides."""
    return brightness(corners, SUN, both_sides=part.material.sheet_loss is not None)


def _shadows(
    ground: Sequence[Part],
    parts: Sequence[Part],
    view: View,
) -> PolyCollection:
    """Create the shadows of parts on the ground, clipped to its bounding box."""
    height = max(_top(part) for part in ground)
    corners = np.concatenate([part.vertices[part.faces] for part in parts])
    lifts = np.maximum(corners[..., 2:] - height, 0.0)
    flat = corners[..., :2] - lifts * (SUN[:2] / SUN[2])
    floor = np.concatenate([part.vertices[:, :2] for part in ground])
    flat = np.clip(flat, floor.min(axis=0), floor.max(axis=0))
    level = np.concatenate([flat, np.full_like(lifts, height)], axis=2)
    colour = np.array(to_rgb(colour_of(ground[0].material)))
    shade = _SHADE * (_PALER + (1 - _PALER) * colour)
    return painted_triangles(
        view.project(level)[:, :, :2],
        shade,
        linewidths=0.3,
        zorder=0.5,
        label="shadows",
    )


def _cut(corners: Floats, largest: float = _LARGEST) -> Floats:
    """Subdivide triangles, (T, 3, 3) m, until no side is longer than ``largest``."""
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    large = sides.max(axis=1) > largest
    if not large.any():
        return corners
    a, b, c = np.swapaxes(corners[large], 0, 1)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    segments = np.concatenate([np.stack(one, axis=1) for one in quarters])
    return np.concatenate([corners[~large], _cut(segments, largest)])
