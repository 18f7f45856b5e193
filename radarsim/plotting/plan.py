"""Plans of maps: sections at one height, with areas in the colours of materials.

Robots are drawn as seen from above.

Plans with equal limits have exactly the same position and size in their pictures, even
if titles differ, so pictures of several sensors can be compared side by side.
"""

import re
import textwrap
from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Polygon
from matplotlib.path import Path
from shapely import Geometry

from radarsim.geometry import Floats, Pose2
from radarsim.plotting.labels import Label, write_labels
from radarsim.plotting.palette import GRID, MARKER, ROBOT, TARGET, Family, family_of
from radarsim.plotting.style import (
    SMALL_PRINT,
    Legend,
    area_style,
    as_words,
    draw_scale_bar,
    write_title,
)
from radarsim.presets.robots import RobotModel, load_robot
from radarsim.robots.footprint import Footprint
from radarsim.robots.obstacles import slice_mesh
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene, StartPose, expected_scene

_TYRE: Final = 0.09  # m, width of a wheel
HEIGHT: Final = 0.346  # m; height of a P3AT's scanner above the floor
MARGIN: Final = 0.8  # m around the content
ROBOT_CLASS: Final = "P3AT"
LEAF_OPACITY: Final = 0.35  # opacity of the area around leaves
_BAR_SPACE: Final = 0.06  # space for the scale bar, as a share of the plan's height
_DIGITS: Final = 6  # decimal places of end points, so that adjacent lines share points
_WALLS: Final = ("wall", "fence")  # objects of these names need no label
MANY: Final = 8  # more objects than this with equal names share a label
_DARK: Final = (Family.WOOD, Family.METAL)  # areas too dark for labels inside them
DPI: Final = 110
# Sizes of figures, all in inches.
_LARGEST: Final = (9.4, 6.6)  # largest width and height of a plan
_NARROWEST: Final = 4.0  # least width of a plan, for the title above it
_LOWEST: Final = 3.2  # least height of the figure, for the legend
_LEGEND: Final = 2.6  # width of the legend on the right
_LEFT, _LEFT_OF_NUMBERS = 0.15, 0.6
_BOTTOM, _NUMBERS = 0.12, 0.25  # space below and above the small print
_LINE, _SMALL_LINE = 0.25, 0.15  # line heights of the title and the small print
_LETTER: Final = 0.155  # mean width of a letter of the title
_SMALL_LETTER: Final = 0.075  # mean width of a letter of the small print
_TITLE_LINES, _SMALL_LINES = 2, 2  # lines for which each figure reserves space


def draw_robot(
    axes: Axes, robot_class: str | RobotModel, pose: Pose2, *, zorder: float = 5
) -> list[Polygon]:
    """Draw a robot from above: its footprint, its wheels, and a wedge pointing forward.

    Args:
        axes: Axes in m, map frame.
        robot_class: The robot class, or the name of a shipped one.
        pose: Pose of the robot.
        zorder: Z-order of the footprint; wheels and wedge are drawn a little above it.

    Returns:
        The patches that were added to the axes.
    """
    model = robot_class
    if isinstance(model, str):
        model = load_robot(model)
    body = Footprint(model.length, model.width)
    tyre = Footprint(2 * model.wheel_radius, _TYRE)
    ahead, aside = model.wheel_base / 2, model.wheel_separation / 2
    wheels = ((ahead, aside), (ahead, -aside), (-ahead, aside), (-ahead, -aside))
    shapes = [(body, (0.0, 0.0), ROBOT, zorder)]
    shapes += [(tyre, wheel, MARKER, zorder + 0.1) for wheel in wheels]
    drawn = []
    for shape, (x, y), colour, order in shapes:
        place = pose.compose(Pose2(x, y))
        corners = shape.outline(Pose2(place.x, place.y, pose.yaw))[:, 0]
        patch = Polygon(corners, facecolor=colour, edgecolor=MARKER, linewidth=0.8)
        patch.set_zorder(order)
        drawn.append(patch)
    tip, side = model.length / 2, model.width / 5
    places = ((tip, 0.0), (tip / 2, side), (tip / 2, -side))
    points = [pose.compose(Pose2(x, y)) for x, y in places]
    wedge = [(point.x, point.y) for point in points]
    drawn.append(Polygon(wedge, facecolor=MARKER, zorder=zorder + 0.2))
    for patch in drawn:
        axes.add_patch(patch)
    return drawn


def draw_plan(axes: Axes, scene: Scene, height: float) -> tuple[list[Material], Floats]:
    """Draw the section of a scene at a height, filled with the colours of materials.

    Args:
        axes: Axes in m, map frame.
        scene: The map.
        height: Height of the section, m, map frame.

    Returns:
        The materials in the section, in the order of the map, and the corners of its
        outlines, (N, 2) m, map frame.
    """
    drawn: dict[str, Material] = {}
    corners = [np.zeros((0, 2))]
    for part in scene.parts:
        lines = slice_mesh(part.vertices, part.faces, height)
        if len(lines):
            drawn.setdefault(part.material.name, part.material)
            corners.append(lines.reshape(-1, 2))
            _draw_part(axes, part, lines)
    axes.set_aspect("equal")
    return [*drawn.values()], np.concatenate(corners)


def _draw_part(axes: Axes, part: Part, lines: Floats) -> None:
    style = area_style(family_of(part.material))
    area = _area(part, lines)
    if not shapely.is_empty(area):
        rings = shapely.get_parts(shapely.boundary(area))
        paths = [Path(shapely.get_coordinates(ring)) for ring in rings]
        patch = PathPatch(Path.make_compound_path(*paths), **style, zorder=1)
        if part.material.sheet_loss is not None:
            patch.set_facecolor((*style["facecolor"][:3], LEAF_OPACITY))
        patch.set_label(part.object_name)
        axes.add_patch(patch)
    if part.material.sheet_loss is not None or shapely.is_empty(area):
        surfaces = LineCollection(
            list(lines), colors=[style["edgecolor"]], linewidths=0.8, zorder=1.1
        )
        axes.add_collection(surfaces)


def _area(part: Part, lines: Floats) -> Geometry:
    """Return the area that a section of a part encloses; of leaves, the convex hull."""
    if part.material.sheet_loss is not None:
        hull = shapely.convex_hull(shapely.multipoints(lines.reshape(-1, 2)))
        # The hull of one or two points is not a polygon, so it has no area.
        return hull if hull.geom_type == "Polygon" else shapely.Polygon()
    apart = np.abs(lines[:, 0] - lines[:, 1]).max(axis=1) > 0
    segments = shapely.multilinestrings(np.round(lines[apart], _DIGITS))
    return shapely.build_area(shapely.node(segments))


def show_extent(axes: Axes, points: Floats, *, coordinates: bool = False) -> None:
    """Set the limits of axes to show points with a margin, and draw a scale bar.

    Args:
        axes: Axes in m.
        points: Points to show, (N, 2) m.
        coordinates: Whether a grid with coordinates replaces the scale bar.
    """
    if not len(points):
        points = np.zeros((1, 2))
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    space = 0.0 if coordinates else _BAR_SPACE * (y1 - y0)
    axes.set_xlim(x0 - MARGIN, x1 + MARGIN)
    axes.set_ylim(y0 - MARGIN - space, y1 + MARGIN)
    if not coordinates:
        draw_scale_bar(axes)
        return
    axes.grid(color=GRID, linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=SMALL_PRINT, color=GRID)
    axes.set_ylabel("y, m", fontsize=SMALL_PRINT)


def plot_scene(scene: Scene, axes: Axes | None = None) -> Axes:
    """Draw the plan of a scene, with coordinates and the names of its objects.

    The section is at the height of a P3AT's scanner; starts are drawn as P3ATs.

    Args:
        scene: The map.
        axes: Axes in m to draw in; None for a new figure with a legend.

    Returns:
        The axes.

    Raises:
        TypeError: If ``scene`` is not a ``Scene``.
    """
    if not isinstance(scene, Scene):
        raise expected_scene(scene)
    figure = None
    if axes is None:
        figure = Figure(dpi=DPI)
        axes = figure.add_subplot()
    height = scene.floor_at(0.0, 0.0) + HEIGHT
    materials, corners = draw_plan(axes, scene, height)
    places = np.array([(start.pose.x, start.pose.y) for start in scene.starts])
    shown = [corners, places.reshape(-1, 2)]
    labels = [_draw_start(axes, start) for start in scene.starts]
    if scene.trial is not None:
        x, y = scene.trial.goal
        axes.plot(x, y, "*", color=TARGET, mec=MARKER, mew=0.7, ms=13, zorder=5)
        shown.append(np.array([[x, y]]))
        labels.append(
            Label("goal of the trial", (x, y, x, y), is_bold=True, radius=5.0)
        )
    show_extent(axes, np.concatenate(shown), coordinates=True)
    cut = [it for it in scene.parts if it.bounds[0, 2] < height < it.bounds[1, 2]]
    objects = len({part.object_name for part in cut})
    starts = len(scene.starts)
    words = (
        f"{scene.name}: {objects} object{'s' * (objects != 1)},"
        f" {starts} start{'s' * (starts != 1)}"
    )
    section = f"section at z {height:.2f} m, where a P3AT scans"
    write_title(axes, words, f"x, m; {section}")
    if figure is not None:
        fit_plan(figure, axes, coordinates=True)
    labels += label_objects(scene.parts, height)
    numbers = write_labels(axes, labels, numbered=figure is not None)
    if figure is not None:
        legend = Legend()
        legend.add_heading("Materials")
        legend.add_materials(materials)
        legend.add_heading("Names")
        legend.add_numbers(numbers)
        legend.draw(figure)
    return axes


def _draw_start(axes: Axes, start: StartPose) -> Label:
    """Draw a start pose as a P3AT robot, and return its label."""
    pose = Pose2(start.pose.x, start.pose.y, start.pose.yaw)
    corners = np.concatenate(
        [each.get_xy() for each in draw_robot(axes, ROBOT_CLASS, pose, zorder=4)]
    )
    return Label(start.name, _box_of(corners).bounds, is_bold=True)


def name_objects(axes: Axes, parts: Iterable[Part], height: float, most: int) -> None:
    """Write the name of each object in the section, except walls.

    Args:
        axes: Axes in m, map frame, with their final limits.
        parts: The parts of the scene.
        height: Height of the section, m, map frame.
        most: Maximum number of names; no names are written if there are more.
    """
    labels = label_objects(parts, height)
    if len(labels) <= most:
        write_labels(axes, labels)


def label_objects(parts: Iterable[Part], height: float) -> list[Label]:
    """Return labels for the objects in a section, except walls.

    Adjacent objects with numbered names, such as ``bush_1`` and ``bush_2``, share a
    label. Such objects that are apart share a label if there are more than ``MANY``.
    Labels may be written inside pale objects, but only next to dark objects.

    Args:
        parts: The parts of the scene.
        height: Height of the section, m, map frame.
    """
    places: dict[str, list[Floats]] = {}
    fills: dict[str, Family] = {}
    for part in parts:
        lines = slice_mesh(part.vertices, part.faces, height)
        if len(lines) and not any(word in part.object_name for word in _WALLS):
            places.setdefault(part.object_name, []).append(lines.reshape(-1, 2))
            fills.setdefault(part.object_name, family_of(part.material))
    boxes = {name: _box_of(np.concatenate(each)) for name, each in places.items()}
    labels = []
    for text, name in _names(boxes).items():
        is_pale = fills[name] not in _DARK
        labels.append(Label(text, boxes[name].bounds, is_inside=is_pale))
    return labels


def _box_of(corners: Floats) -> shapely.Polygon:
    return shapely.box(*corners.min(axis=0), *corners.max(axis=0))


def _names(boxes: Mapping[str, shapely.Polygon]) -> dict[str, str]:
    """Return the text of each label, with the name of the object that it labels."""
    rows: dict[str, list[str]] = {}
    for name in boxes:
        rows.setdefault(re.sub(r"_\d+$", "", name), []).append(name)
    names = {}
    for stem, members in rows.items():
        together = shapely.union_all([boxes[name] for name in members])
        northmost = max(members, key=lambda name: boxes[name].bounds[3])
        if len(members) > 1 and together.geom_type == "Polygon":
            names[_plural(as_words(stem))] = northmost
        elif len(members) > MANY:
            names[f"{len(members)} {_plural(as_words(stem))}"] = northmost
        else:
            names |= {as_words(name): name for name in members}
    return names


def _plural(word: str) -> str:
    """Return the plural of a regular English noun.

    >>> _plural("bush"), _plural("young tree"), _plural("u")
    ('bushes', 'young trees', 'u')
    """
    if len(word) == 1:  # the plural of a letter could be read as a word, such as "us"
        return word
    return word + ("es" if word.endswith(("s", "x", "ch", "sh")) else "s")


def fit_plan(figure: Figure, axes: Axes, *, coordinates: bool = False) -> None:
    """Fit a figure's size to its plan, title and legend, and wrap long lines of text.

    Args:
        figure: The figure, without a layout engine.
        axes: The axes of the figure, with their final limits, and with title and small
            print from ``write_title``.
        coordinates: Whether the axes have tick labels.
    """
    (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
    aspect = (east - west) / (north - south)
    wide = min(_LARGEST[0], _LARGEST[1] * aspect)
    tall = wide / aspect
    left = _LEFT_OF_NUMBERS if coordinates else _LEFT
    width = left + max(wide, _NARROWEST) + _LEGEND
    # Lines are wrapped by the mean width of letters, since true widths are known only
    # after the figure is drawn.
    title = textwrap.wrap(axes.get_title(loc="left"), int(width / _LETTER))
    small_print = textwrap.wrap(axes.get_xlabel(), int(width / _SMALL_LETTER))
    write_title(axes, "\n".join(title), "\n".join(small_print))
    bottom = _BOTTOM + _SMALL_LINE * max(len(small_print), _SMALL_LINES)
    bottom += _NUMBERS if coordinates else 0.0
    top = _LINE * max(len(title), _TITLE_LINES) + _BOTTOM
    height = max(bottom + tall + top, _LOWEST)
    figure.set_size_inches(width, height)
    axes.set_position((left / width, bottom / height, wide / width, tall / height))
