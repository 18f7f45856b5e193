"""Shared by the figures of the thesis: scans at a start, their hits, and drawing."""

from collections.abc import Mapping
from functools import cache
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

import radarsim
from radarsim.geometry import Floats, Pose2, Pose3
from radarsim.plotting.plan import draw_plan, draw_robot
from radarsim.plotting.style import QUIET, as_words, draw_scale_bar, write_at
from radarsim.presets.robots import load_robot
from radarsim.rng import generator_for
from radarsim.scene.scene import Part, Scene
from radarsim.sensors.scan import Scan

TRIAL, ROOM = "marulan_trial", "foliage_room"  # maps
ROBOT, START, SEED = "P3AT", "RobotStart1", 0
BUSHES: Final = "foliage"  # material of the bushes in the room
FAR: Final = 80.0  # m, range of the Hokuyo here: its own does not reach the bushes
STEP: Final = 0.2  # m; ranges that differ by more count as different
AMBIENT: Final = 0.55  # brightness of faces along the light

Drawn = dict[str, tuple[Figure, str]]  # figures and captions by file name

load_scene = cache(radarsim.load_map)


def start_pose(scene: Scene) -> Pose3:
    """Return the pose on the ground at which the robot starts, map frame."""
    start = scene.start(START)
    assert start is not None
    return start.pose


def robot_pose(scene: Scene) -> Pose2:
    """Return the same pose in the plane."""
    pose = start_pose(scene)
    return Pose2(pose.x, pose.y, pose.yaw)


def sensor_pose(scene: Scene) -> Pose3:
    """Return the pose of the robot's scanner at its start, map frame."""
    model = load_robot(ROBOT)
    mount = model.items_of("RangeScanner")[0].mount
    return start_pose(scene).compose(Pose3(0, 0, model.origin_height)).compose(mount)


def take_scans(map_: str, sensor: str, count: int = 1, **settings: Any) -> list[Scan]:
    """Scan a map from the start of the robot; ``settings`` change the preset."""
    scene, scanner = load_scene(map_), radarsim.load_sensor(sensor, **settings)
    rng = generator_for(SEED, sensor)
    return [scanner.scan(scene, sensor_pose(scene), rng) for _ in range(count)]


def hit_points(scan: Scan) -> Floats:
    """Return the true ends of rays, (N, 3) m, map frame; inf for no return."""
    return scan.cast.origins + scan.ranges[:, None] * scan.cast.directions


def object_names(scan: Scan) -> NDArray[np.str_]:
    """Return the name of the object that each beam reads, (N,); empty for no return."""
    echoes, names = scan.echoes, np.full(len(scan.ranges), "", dtype="U40")
    for part, target in echoes.targets.items():
        names[echoes.beams[echoes.parts == part]] = target.object
    return np.where(np.isfinite(scan.ranges), names, "")


def bush_parts(scene: Scene) -> list[Part]:
    """Return the parts that are bushes."""
    return [part for part in scene.parts if part.material.name == BUSHES]


def far_side(scene: Scene) -> float:
    """Return the largest x of the bushes, m; the hidden part of the room is beyond."""
    return max(float(bush.vertices[:, 0].max()) for bush in bush_parts(scene))


def hidden_parts(scene: Scene) -> list[Part]:
    """Return one part of each object behind the bushes, without walls."""
    side = far_side(scene)
    hidden = (part for part in scene.parts if part.vertices[:, 0].min() > side)
    parts = {part.object_name: part for part in hidden}
    return [part for name, part in parts.items() if "wall" not in name]


def draw_title(drawing: Figure, text: str, small_print: str = "") -> None:
    """Write the title of a figure at its upper left, and a small text below it."""
    _, height = drawing.get_size_inches()
    bold: Any = {"va": "top", "fontsize": 17, "fontweight": "bold"}
    drawing.text(0.02, 1 - 0.16 / height, text, **bold)
    drawing.text(0.02, 1 - 0.52 / height, small_print, va="top", color=QUIET)


def draw_legend(
    drawing: Figure, samples: Mapping[str, Line2D], size: float | str | None = None
) -> None:
    """Draw a legend of samples by their texts at the bottom of a figure, in one row."""
    drawing.legend(
        list(samples.values()),
        list(samples),
        loc="lower center",
        ncols=len(samples),
        fontsize=size,
        frameon=False,
    )


def draw_room(axes: Axes) -> None:
    """Draw the test map with the robot at its start, and a scale bar for axes."""
    scene = load_scene(ROOM)
    draw_plan(axes, scene, sensor_pose(scene).z)
    draw_robot(axes, ROBOT, robot_pose(scene), zorder=6)
    show_room(axes)


def show_room(axes: Axes) -> None:
    """Set the limits, the same in all figures, and replace axes by a scale bar."""
    (west, south), (east, north) = load_scene(ROOM).bounds[:, :2].tolist()
    axes.set_xlim(west - 0.45, east + 0.45)
    axes.set_ylim(south - 1.05, north + 0.45)
    axes.set_aspect("equal")
    axes.set_axis_off()
    draw_scale_bar(axes)


def name_hidden_objects(axes: Axes) -> None:
    """Write the names of the objects behind the bushes to their right."""
    for part in hidden_parts(load_scene(ROOM)):
        low, high = part.vertices.min(axis=0), part.vertices.max(axis=0)
        text, place = as_words(part.object_name), (high[0], (low[1] + high[1]) / 2)
        style: Any = {"va": "center", "fontsize": "large", "zorder": 8}
        write_at(axes, text, place, offset=(5, 0), **style)


def shades(colour: str, opacity: Floats) -> Floats:
    """Return a colour in each opacity, (P, 4)."""
    shades = np.tile(to_rgba(colour), (len(opacity), 1))
    shades[:, 3] = opacity
    return shades


def painted_triangles(corners: Floats, colours: Floats, **style: Any) -> PolyCollection:
    """Return triangles, (T, 3, 2), in RGB colours, (T, 3) or one for all, (3,)."""
    # an array is much faster than a sequence of arrays, but missing in the types
    polygons: Any = corners
    return PolyCollection(polygons, facecolors=colours, edgecolors=colours, **style)


def brightness(corners: Floats, sun: Floats, *, both_sides: bool) -> Floats:
    """Return the brightness of triangles, (T, 3, 3) m, in the sun, (T,) from 0 to 1.

    Leaves are as bright when lit from their back: ``both_sides``.
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    facing = normals @ (sun / np.linalg.norm(sun))
    lit = np.abs(facing) if both_sides else np.maximum(facing, 0.0)
    return np.asarray(AMBIENT + (1 - AMBIENT) * lit)
