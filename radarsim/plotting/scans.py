"""Pictures of scans: rays, echoes and readings over a filled plan of the map.

A single scan is drawn with its rays, which end at their readings. Those that see
through something are the boldest lines, and their hits the largest marks. Several scans
are drawn without rays, as pale dots: readings, or echoes if the sensor keeps all.
"""

import textwrap
from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from radarsim.geometry import Floats, Pose2
from radarsim.plotting.annotations import write_title
from radarsim.plotting.echo_marks import add_echo_rows, draw_echoes
from radarsim.plotting.palette import MARKER
from radarsim.plotting.plan import (
    ROBOT,
    draw_plan,
    name_objects,
    plot_scene,
    show_extent,
)
from radarsim.plotting.ray_segments import draw_rays
from radarsim.plotting.reading_marks import (
    add_ray_rows,
    draw_hits,
    draw_many,
    draw_ray_ends,
    lists_echoes,
)
from radarsim.plotting.rendering import render
from radarsim.plotting.robots import draw_robot
from radarsim.plotting.scan_words import describe_beams, title_scans
from radarsim.plotting.sight import find_sight
from radarsim.plotting.style import Legend, scan_points
from radarsim.scene.scene import Scene
from radarsim.sensors.scan import Scan

NOWHERE: Final[Floats] = np.zeros((0, 2))
_LARGEST: Final = (9.4, 6.6)  # inches of a plan
_LEGEND: Final = 2.6  # inches beside it
_TITLE: Final = 0.9  # inches above and below it
_NAMES: Final = 20  # of objects; with more of them rays could not be seen
_NARROWEST: Final = 4.0  # inches that a plan has, for the title above it
_LETTER: Final = 0.155  # inches of a title, on average
_SMALL_LETTER: Final = 0.08  # inches, likewise, of the text below the plan


def draw_scans(
    scene: Scene,
    scans: Sequence[Scan],
    *,
    robot: Pose2 | None = None,
    form: str = "png",
) -> bytes:
    """Draw scans; arguments as in ``plot_scans``.

    Args:
        scene: The map.
        scans: One or more scans of one sensor.
        robot: Pose of the P3AT that carries the sensor; None for the sensor alone.
        form: File format, one of ``FORMS``.

    Returns:
        Content of the file; the same scans give the same bytes.
    """
    return render(plot_scans(scene, scans, robot=robot), form)


def plot_scans(
    scene: Scene, scans: Sequence[Scan], *, robot: Pose2 | None = None
) -> Figure:
    """Draw scans over the section of the map at the sensor's height.

    The rays are traced again, in the map without robots.

    Args:
        scene: The map.
        scans: One or more scans of one sensor.
        robot: Pose of the P3AT that carries the sensor; None for the sensor alone.
    """
    figure = Figure(dpi=120, layout="compressed")
    axes, legend = figure.add_subplot(), Legend()
    draw_scan(axes, scene, scans, legend, robot=robot)
    _fit(figure, axes)
    legend.draw(figure)
    return figure


def _fit(figure: Figure, axes: Axes) -> None:
    """Give a figure the size of its plan and a legend; wrap a title that is longer."""
    (west, east), (south, north) = axes.get_xlim(), axes.get_ylim()
    aspect = (east - west) / (north - south)
    wide = min(_LARGEST[0], _LARGEST[1] * aspect)
    width = max(wide, _NARROWEST) + _LEGEND
    figure.set_size_inches(width, wide / aspect + _TITLE)
    title = textwrap.fill(axes.get_title(loc="left"), int(width / _LETTER))
    small_print = textwrap.fill(axes.get_xlabel(), int(width / _SMALL_LETTER))
    write_title(axes, title, small_print)


def draw_scan(
    axes: Axes,
    scene: Scene,
    scans: Sequence[Scan],
    legend: Legend | None = None,
    *,
    robot: Pose2 | None = None,
    include: Floats = NOWHERE,
) -> None:
    """Draw scans into axes; arguments as in ``plot_scans``.

    Args:
        axes: Axes in m to draw in.
        scene: The map.
        scans: One or more scans of one sensor.
        legend: Gets rows for what is drawn; several panels may share it.
        robot: Pose of the P3AT that carries the sensor; None for the sensor alone.
        include: Points, (N, 2) m, that the limits are to contain too.
    """
    legend = legend or Legend()
    plan = draw_plan(axes, scene, scans[0].pose.z)
    sights = [find_sight(scene, scan) for scan in scans]
    if len(scans) == 1:
        (scan,), (sight,) = scans, sights
        draw_rays(axes, scene, scan, sight)
        add_ray_rows(legend, scan, sight)
        if lists_echoes(scan):
            draw_echoes(axes, scan)
            add_echo_rows(legend, scans)
            draw_hits(axes, scan, sight)
        else:
            draw_ray_ends(axes, scan, sight)
    else:
        draw_many(axes, scans, sights, legend)
    legend.add_heading("Materials")
    legend.add_materials(plan.materials)
    _draw_sensor(axes, scans[0], robot)
    show_extent(axes, np.concatenate([plan.corners, include, *_points(scans)]))
    name_objects(axes, scene.parts, scans[0].pose.z, _NAMES)
    words = describe_beams(scene.name, scans)
    write_title(axes, title_scans(scans, sights), words)


def plot_scan(scene: Scene, scan: Scan, axes: Axes | None = None) -> Axes:
    """Draw a scan into axes, or into a figure of its own with a legend."""
    if axes is None:
        return plot_scans(scene, [scan]).axes[0]
    draw_scan(axes, scene, [scan])
    return axes


def draw_scene(scene: Scene, *, form: str = "png") -> bytes:
    """Draw the plan of a scene, see ``plot_scene``, as a file of one of ``FORMS``."""
    return render(_figure_of(plot_scene(scene)), form)


def as_svg(axes: Axes) -> str:
    """Return the figure of axes as an ``<svg>`` element."""
    text = render(_figure_of(axes), "svg").decode()
    return text[text.index("<svg") :]


def _figure_of(axes: Axes) -> Figure:
    figure = axes.get_figure(root=True)
    if figure is None:
        raise ValueError("axes without a figure, expected axes of a figure")
    return figure


def _draw_sensor(axes: Axes, scan: Scan, robot: Pose2 | None) -> None:
    if robot is not None:
        draw_robot(axes, ROBOT, robot, zorder=6)
    else:
        axes.plot(scan.pose.x, scan.pose.y, "o", color=MARKER, markersize=6, zorder=6)


def _points(scans: Sequence[Scan]) -> list[Floats]:
    """Return the places of the sensor and of all readings, (N, 2) m each."""
    place = np.array([[scans[0].pose.x, scans[0].pose.y]])
    # ghosts of mirrors lie outside the map
    return [place, *(scan_points(s)[np.isfinite(s.ranges)] for s in scans)]
