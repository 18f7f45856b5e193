"""Pictures of scans: rays, echoes and readings over a filled plan of the map.

A single scan is drawn with its rays, which end at their readings. Those that see
through something are the boldest lines, and their hits the largest marks. Several scans
are drawn as readings, or as echoes if the sensor keeps all of them.
"""

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from radarsim.geometry import Floats, Pose2
from radarsim.plotting.annotations import write_title
from radarsim.plotting.echo_marks import add_echo_rows, draw_echoes
from radarsim.plotting.palette import MARKER
from radarsim.plotting.plan import ROBOT, draw_plan, plot_scene, show_extent
from radarsim.plotting.ray_segments import add_ray_rows, draw_rays, group_by_ray
from radarsim.plotting.rendering import render
from radarsim.plotting.robots import draw_robot
from radarsim.plotting.scan_words import describe_beams, describe_scans
from radarsim.plotting.sight import Sight, find_sight
from radarsim.plotting.style import Legend, scan_points
from radarsim.scene.scene import Scene
from radarsim.sensors.scan import Scan

THROUGH_AREA: Final = 42.0  # square points of the hit of a ray that sees through
NOWHERE: Final[Floats] = np.zeros((0, 2))
_SIZE: Final = (12.0, 7.6)  # inches


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
    figure = Figure(figsize=_SIZE, dpi=120, layout="compressed")
    axes, legend = figure.add_subplot(), Legend()
    draw_scan(axes, scene, scans, legend, robot=robot)
    legend.draw(figure)
    return figure


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
    echoing = scans[0].echoes.settings.return_mode == "all"
    sight = find_sight(scene, scans[0])
    if len(scans) == 1:
        draw_rays(axes, scene, scans[0], sight)
        add_ray_rows(legend, scans[0], sight)
        _draw_hits(axes, scans[0], sight, legend)
    if echoing or len(scans) == 1:
        for scan in scans:
            draw_echoes(axes, scan)
        add_echo_rows(legend, scans)
    if not echoing or len(scans) == 1:
        _draw_readings(axes, scans, legend)
    legend.add_heading("Materials")
    legend.add_materials(plan.materials)
    _draw_sensor(axes, scans[0], robot)
    show_extent(axes, np.concatenate([plan.corners, include, *_points(scans)]))
    words = describe_scans(f"{scans[0].sensor} in {scene.name}", scans, sight)
    write_title(axes, words, describe_beams(scans))


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


def _draw_hits(axes: Axes, scan: Scan, sight: Sight, legend: Legend) -> None:
    """Mark what is read by rays that see through something: the largest marks."""
    if not sight.through.any():
        return
    rays, seeing = scan.cast, np.flatnonzero(sight.through)
    ranges, directions = scan.ranges[seeing, None], rays.directions[seeing]
    points = rays.origins[seeing] + ranges * directions
    style: dict[str, Any] = {"facecolors": "white", "linewidths": 1.6, "zorder": 5}
    colours = np.full(len(scan.ranges), MARKER, dtype="U32")
    for chosen, colour, _ in group_by_ray(scan):
        colours[chosen] = colour
    edges = colours[sight.through].tolist()
    axes.scatter(
        *(points[:, 0], points[:, 1], THROUGH_AREA),
        edgecolors=edges,
        label="seen through",
        **style,
    )
    legend.add_heading("Rays")
    marks: dict[str, Any] = {"markerfacecolor": "white", "markeredgewidth": 1.6}
    size = math.sqrt(THROUGH_AREA)
    legend.add_marker(
        "what it sees there", "o", markeredgecolor=MARKER, markersize=size, **marks
    )


def _draw_readings(axes: Axes, scans: Sequence[Scan], legend: Legend) -> None:
    """Draw a dot for each range, along its beam, in the colour of its ray."""
    single = len(scans) == 1
    size = 3 if single else 2.5
    legend.add_heading("Readings")
    for scan in scans:
        ends, came_back = scan_points(scan), np.isfinite(scan.ranges)
        for chosen, colour, name in group_by_ray(scan):
            dots = ends[chosen & came_back]
            if len(dots):
                axes.plot(*dots.T, ".", color=colour, markersize=size, zorder=4)
                if not single:
                    legend.add_marker(f"of the {name}", ".", color=colour)
    if single and np.isfinite(scans[0].ranges).any():
        legend.add_marker("range, along its beam", ".", color=MARKER, markersize=4)


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
