"""Pictures of scans: rays, echoes and readings over a filled plan of the map.

A single scan is drawn with its rays, which end at their readings. Rays that see through
a material have the boldest lines, and their readings the largest markers. Several scans
are drawn without rays, as pale dots: readings, or echoes if the sensor reports all of
them. Scans of several sensors at the same pose are drawn side by side.
"""

import math
import re
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from radarsim.errors import expected_one_of
from radarsim.geometry import Pose2
from radarsim.plotting.marks import (
    END_MARKS,
    add_echo_rows,
    add_ray_rows,
    describe_end,
    draw_echoes,
    draw_many,
    draw_ray_ends,
    draw_rays,
    lists_echoes,
)
from radarsim.plotting.palette import MARKER
from radarsim.plotting.plan import (
    ROBOT_CLASS,
    draw_plan,
    draw_robot,
    fit_plan,
    name_objects,
    show_extent,
)
from radarsim.plotting.sight import BeamEnd, Sight, find_sight, name_materials
from radarsim.plotting.style import (
    QUIET,
    Legend,
    as_words,
    figure_of,
    render,
    write_title,
)
from radarsim.presets.robots import load_robot
from radarsim.presets.sensors import sensor_presets
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.scene.material import Material
from radarsim.scene.scene import Scene
from radarsim.sensors.range_scanner import RangeScanner, load_sensor
from radarsim.sensors.scan import Scan

# Sizes of panels in pictures of several sensors, inches.
_PANEL: Final = (5.0, 3.7)
_TALL_PANEL: Final = (2.5, 5.5)  # for maps with an aspect ratio below _TALL
_LONG_PANEL: Final = 10.0  # width for maps with an aspect ratio above _LONG
_LONG: Final = 4.0  # width by height; panels of such maps are stacked
_TALL: Final = 2 / 3  # width by height
_PANEL_TITLE: Final = 0.45
_PANEL_LEGEND: Final = 1.2  # height of the legend and the title of the figure
_LEGEND_COLUMN: Final = 2.5
_COLUMNS: Final = 4  # maximum number of columns in the legend
_LETTERS: Final = 10  # letters per inch in the title of a panel
_NAMES: Final = 20  # maximum number of object names; more would hide the rays
# Kinds of beam ends that a title counts, unless the number of beams is 0.
_COUNTED: Final = (
    BeamEnd.THROUGH,
    BeamEnd.STOPPED,
    BeamEnd.SPENT,
    BeamEnd.NO_RETURN,
    BeamEnd.BLINDED,
)


def title_scans(
    scans: Sequence[Scan], sights: Sequence[Sight], name: str | None = None
) -> str:
    """Return a title with the sensor, and how many of its beams end in which way.

    Args:
        scans: One or more scans of one sensor.
        sights: A ``Sight`` for each scan.
        name: Name of the sensor; by default the result of ``name_sensor``.
    """
    name = name or name_sensor(scans[0])
    many = f"{len(scans)} scans of " if len(scans) > 1 else ""
    counts = []
    for end in _COUNTED:
        count = sum(int((sight.ends == end).sum()) for sight in sights)
        if count:
            most = max(sights, key=lambda sight: len(sight.materials[end]))
            counts.append(f"{count} {describe_end(end, most)}")
    beams = f"{many}{len(scans[0].ranges)} beams"
    return f"{name}, {beams}: {', '.join(counts) or 'all come back'}"


def name_sensor(scan: Scan) -> str:
    """Return the name of a sensor with its type, such as "Laser (SICK LMS200)"."""
    preset, medium = sensor_presets().get(scan.sensor), scan.echoes.settings.medium
    name = (preset.title if preset else "") or as_words(scan.sensor)
    if re.search(rf"\b{medium}\b", name):
        return name[0].upper() + name[1:]
    return f"{medium.capitalize()} ({name})"


def _names_of(scanners: Sequence[RangeScanner], scans: Sequence[Scan]) -> list[str]:
    """Return the names of sensors; equal names are told apart by their settings."""
    names = [
        name_sensor(scan) + (" with noise of one's own" if scanner.noise else "")
        for scanner, scan in zip(scanners, scans, strict=True)
    ]
    settings = [scan.echoes.settings.model_dump() for scan in scans]
    whole = []
    for name, own in zip(names, settings, strict=True):
        others = [s for other, s in zip(names, settings, strict=True) if other == name]
        changed = [
            f"{key} {value:g}" if isinstance(value, float) else f"{key} {value}"
            for key, value in own.items()
            if any(other[key] != value for other in others)
        ]
        whole.append(f"{name} with {', '.join(changed)}" if changed else name)
    return whole


def _finding(
    names: Sequence[str], scans: Sequence[Scan], sights: Sequence[Sight]
) -> str:
    """Return a title that says which sensors see through a material; maybe empty."""
    seeing: list[str] = []
    blocked: list[str] = []
    passed: list[Material] = []
    modes = set()
    for name, scan, sight in zip(names, scans, sights, strict=True):
        if (sight.ends == BeamEnd.THROUGH).any():
            seeing.append(name)
            passed += sight.materials[BeamEnd.THROUGH]
        else:
            blocked.append(name[0].lower() + name[1:])
            modes.add(scan.echoes.settings.return_mode)
    if not seeing or not blocked:
        return ""
    verb = "sees" if len(seeing) == 1 else "see"
    others, does = " and ".join(blocked), "does" if len(blocked) == 1 else "do"
    if modes == {"first"}:  # a last echo could come from behind the material
        others = f"first-echo {others}"
    through = f"{' and '.join(seeing)} {verb} through {name_materials(passed)}"
    return f"{through}; {others} {does} not"


def describe_beams(scene: str, scans: Sequence[Scan]) -> str:
    """Return the small print of a picture: pose, beams, and return mode of its scans.

    Args:
        scene: Name of the map.
        scans: One or more scans of one sensor in that map.
    """
    scan = scans[0]
    beyond = sum(int(np.count_nonzero(~np.isfinite(s.ranges))) for s in scans)
    blind = sum(int(np.count_nonzero(s.ranges == 0)) for s in scans)
    counted = f"{len(scans)} scans of " if len(scans) > 1 else ""
    counted += f"{len(scan.ranges)} beams, {beyond} without return"
    counted += f", {blind} blinded" if blind else ""
    return (
        f"{scan.sensor} in {scene}, at x {scan.pose.x:.2f} m, y {scan.pose.y:.2f} m,"
        f" yaw {math.degrees(scan.pose.yaw):.0f}°; section at z {scan.pose.z:.2f} m;"
        f" {counted}; {_beams(scan)}"
    )


def _beams(scan: Scan) -> str:
    """Describe how many rays form a beam, and which echoes the sensor reports."""
    settings = scan.echoes.settings
    mode = settings.return_mode
    if scan.targets is not None:
        target = {"first": "nearest", "strongest": "strongest"}.get(mode, "farthest")
        return f"{target} target of the detector {settings.detector!r}"
    echoes = "all echoes" if mode == "all" else f"{mode} echo"
    if not settings.has_side_rays:
        return echoes
    answer = "together" if settings.combines_rays else "one drawn"
    if settings.side_mode == "cone":
        return f"cone of {settings.cone_rays} rays, {answer}, {echoes}"
    return f"N = {settings.side_offset_uu:g} {settings.side_mode}, {answer}, {echoes}"


def plot_scans(
    scene: Scene, scans: Sequence[Scan], *, robot: Pose2 | None = None
) -> Figure:
    """Draw scans over a section of the map at the sensor's height.

    The rays are traced again in the map without robots.

    Args:
        scene: The map.
        scans: One or more scans of one sensor.
        robot: Pose of the P3AT that carries the sensor; None for the sensor alone.
    """
    figure = Figure(dpi=120)
    axes, legend = figure.add_subplot(), Legend()
    draw_scan(axes, scene, scans, legend, robot=robot)
    fit_plan(figure, axes)
    name_objects(axes, scene.parts, scans[0].pose.z, _NAMES)
    legend.draw(figure)
    return figure


def draw_scan(
    axes: Axes,
    scene: Scene,
    scans: Sequence[Scan],
    legend: Legend | None = None,
    *,
    robot: Pose2 | None = None,
) -> None:
    """Draw scans into given axes.

    The limits depend only on the map and the position of the sensor, so they are equal
    for all sensors at a position. Readings outside the limits, by mirrors, are cut off.

    Args:
        axes: Axes in m to draw in.
        scene: The map.
        scans: One or more scans of one sensor.
        legend: The legend to which rows are added; several panels may share it.
        robot: Pose of the P3AT that carries the sensor; None for the sensor alone.
    """
    legend = legend or Legend()
    materials, corners = draw_plan(axes, scene, scans[0].pose.z)
    sights = [find_sight(scene, scan) for scan in scans]
    if len(scans) == 1:
        (scan,), (sight,) = scans, sights
        draw_rays(axes, scene, scan, sight)
        if legend.ray_colour is None:  # otherwise ``compare`` has added the rows
            add_ray_rows(legend, scans, sights)
        if lists_echoes(scan):
            draw_echoes(axes, scan)
            add_echo_rows(legend, scans)
            draw_ray_ends(axes, scan, sight, [BeamEnd.THROUGH])
        else:
            draw_ray_ends(axes, scan, sight, END_MARKS)
    else:
        draw_many(axes, scans, sights, legend)
    legend.add_heading("Materials")
    legend.add_materials(materials)
    _draw_sensor(axes, scans[0], robot)
    place = np.array([[scans[0].pose.x, scans[0].pose.y]])
    show_extent(axes, np.concatenate([corners, place]))
    words = describe_beams(scene.name, scans)
    write_title(axes, title_scans(scans, sights), words)


def plot_scan(scene: Scene, scan: Scan, axes: Axes | None = None) -> Axes:
    """Draw a scan into axes, or into a new figure with a legend."""
    if axes is None:
        return plot_scans(scene, [scan]).axes[0]
    draw_scan(axes, scene, [scan])
    name_objects(axes, scene.parts, scan.pose.z, _NAMES)
    return axes


def as_svg(axes: Axes) -> str:
    """Return the figure that contains the axes as an ``<svg>`` element."""
    text = render(figure_of(axes), "svg").decode()
    return text[text.index("<svg") :]


def _draw_sensor(axes: Axes, scan: Scan, robot: Pose2 | None) -> None:
    if robot is not None:
        draw_robot(axes, ROBOT_CLASS, robot, zorder=6)
    else:
        axes.plot(scan.pose.x, scan.pose.y, "o", color=MARKER, markersize=6, zorder=6)


class _ShownFigure(Figure):
    """A figure that notebooks show without using pyplot."""

    def _repr_png_(self) -> bytes:
        return render(self)


def compare(
    map_: str | Path | Scene,
    *sensors: str | RangeScanner,
    start: str | None = None,
    seed: int = 0,
) -> Figure:
    """Draw the scans of several sensors at one pose, in panels of equal scale.

    Args:
        map_: A scene, or the argument of ``load_map``.
        sensors: Names of presets, or scanners from ``load_sensor``; at least one.
        start: Start pose of the P3AT that carries the sensors; None for the first one.
        seed: Seed of all random numbers.

    Returns:
        A figure. A notebook shows it; ``figure.savefig("sensors.png")`` writes a file.

    Raises:
        MapError: If the map is wrong.
        PresetError: If there is no such sensor.
        ValueError: If there is no sensor, or no such start.

    >>> figure = compare("foliage_room", "radar", "laser")
    >>> len(figure.axes)
    2
    """
    if not sensors:
        raise ValueError("no sensors, expected at least one")
    scene = map_ if isinstance(map_, Scene) else load_map(map_)
    place = scene.start(start) if start is not None else next(iter(scene.starts), None)
    if place is None:
        names = [each.name for each in scene.starts]
        raise ValueError(f"start {expected_one_of(start, names)}")
    scanners = [
        each if isinstance(each, RangeScanner) else load_sensor(each)
        for each in sensors
    ]
    pose = load_robot(ROBOT_CLASS).scanner_pose(place.pose)
    scans = [
        scanner.scan(scene, pose, generator_for(seed, scanner.name))
        for scanner in scanners
    ]
    figure = _ShownFigure(dpi=120, layout="constrained")
    legend, robot = Legend(QUIET), Pose2(place.pose.x, place.pose.y, place.pose.yaw)
    panels = figure.subplots(1, len(scans), squeeze=False)[0]
    sights = [find_sight(scene, scan) for scan in scans]
    add_ray_rows(legend, scans, sights)
    for axes, scan in zip(panels, scans, strict=True):
        draw_scan(axes, scene, [scan], legend, robot=robot)
        axes.set_xlabel("")
    width = _fit_panels(figure, panels)
    names = _names_of(scanners, scans)
    for axes, scan, sight, name in zip(panels, scans, sights, names, strict=True):
        words = textwrap.fill(title_scans([scan], [sight], name), int(_LETTERS * width))
        axes.set_title(words, loc="left", fontsize=11, fontweight="bold")
    title = _finding(names, scans, sights)
    title = title or f"{scene.name}, from {place.name}: what each sensor sees"
    figure.suptitle(
        title, parse_math=False, fontsize="x-large", fontweight="bold", wrap=True
    )
    columns = int(figure.get_size_inches()[0] / _LEGEND_COLUMN)
    legend.draw(figure, min(_COLUMNS, columns))
    for axes in panels:
        name_objects(axes, scene.parts, pose.z, _NAMES)
    return figure


def _fit_panels(figure: Figure, panels: Sequence[Axes]) -> float:
    """Arrange panels of equal limits without gaps; return the total width, inches.

    Panels of long maps are stacked, others are side by side.
    """
    (west, east), (south, north) = panels[0].get_xlim(), panels[0].get_ylim()
    aspect, count = (east - west) / (north - south), len(panels)
    if aspect > _LONG:
        grid = figure.add_gridspec(count, 1)
        for row, axes in enumerate(panels):
            axes.set_subplotspec(grid[row])
        height = count * (_LONG_PANEL / aspect + _PANEL_TITLE) + _PANEL_LEGEND
        figure.set_size_inches(_LONG_PANEL, height)
        return _LONG_PANEL
    width, height = _TALL_PANEL if aspect < _TALL else _PANEL
    if aspect < _TALL:
        for axes in panels:
            axes.set_anchor("W")  # aligned with the left end of the title
    height = min(height, width / aspect + _PANEL_TITLE)
    figure.set_size_inches(width * max(count, 2), height + _PANEL_LEGEND)
    return width
