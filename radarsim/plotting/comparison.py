"""What several sensors see from one place, side by side."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from radarsim.geometry import Pose2
from radarsim.plotting.annotations import QUIET
from radarsim.plotting.plan import ROBOT_CLASS
from radarsim.plotting.scans import draw_scan, title_scans
from radarsim.plotting.sight import find_sight
from radarsim.plotting.style import Legend, scan_points
from radarsim.presets.robots import load_robot
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene, StartPose
from radarsim.sensors.range_scanner import RangeScanner, load_sensor
from radarsim.sensors.scan import Scan

_PANEL: Final = (6.6, 5.0)  # inches
_LEGEND: Final = 2.4  # inches beside the panels


def compare(
    map_: str | Path | Scene,
    *sensors: str | RangeScanner,
    start: str | None = None,
    seed: int = 0,
) -> Figure:
    """Draw what several sensors see from one place: a panel each, of one scale.

    Args:
        map_: A scene, or what ``load_map`` takes.
        sensors: Names of presets, or scanners from ``load_sensor``; at least one.
        start: Name of the start pose of the P3AT that carries them; None for the first.
        seed: Seed of all random numbers.

    Returns:
        A figure; ``figure.savefig("sensors.png")`` writes it.

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
    place = _find_start(scene, start)
    scanners = [
        load_sensor(each) if isinstance(each, str) else each for each in sensors
    ]
    pose = load_robot(ROBOT_CLASS).scanner_pose(place.pose)
    scans = [
        scanner.scan(scene, pose, generator_for(seed, scanner.name))
        for scanner in scanners
    ]
    return _draw_panels(scene, place, scans)


def _find_start(scene: Scene, name: str | None) -> StartPose:
    found = scene.start(name) if name is not None else next(iter(scene.starts), None)
    if found is None:
        names = [each.name for each in scene.starts]
        raise ValueError(f"start {name!r}, expected one of {names}")
    return found


def _draw_panels(scene: Scene, place: StartPose, scans: Sequence[Scan]) -> Figure:
    wide, tall = _PANEL
    size = (wide * len(scans) + _LEGEND, tall)
    figure = Figure(figsize=size, dpi=110, layout="constrained")
    legend, robot = Legend(QUIET), Pose2(place.pose.x, place.pose.y, place.pose.yaw)
    include = np.concatenate([scan_points(s)[np.isfinite(s.ranges)] for s in scans])
    panels = figure.subplots(1, len(scans), squeeze=False)[0]
    for axes, scan in zip(panels, scans, strict=True):
        draw_scan(axes, scene, [scan], legend, robot=robot, include=include)
        words = title_scans([scan], [find_sight(scene, scan)])
        axes.set_title(words, loc="left", fontsize=11, fontweight="bold")
        axes.set_xlabel("")
    figure.suptitle(
        f"{scene.name}, from {place.name}: what each sensor sees", parse_math=False
    )
    legend.draw(figure)
    return figure
