"""A sensor at a place, for the commands that typer still makes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, get_args

import click

from radarsim.cli.fields import read_setting
from radarsim.cli.scan import PlacedSensor, SensorPose
from radarsim.plans import Form

if TYPE_CHECKING:
    from radarsim.geometry import Pose3
    from radarsim.scene.scene import Scene
    from radarsim.sensors.range_scanner import RangeScanner


def load_scanner(sensor: str, settings: list[str] | None) -> RangeScanner:
    """Create a scanner from a preset and ``KEY=VALUE`` texts."""
    try:
        read = tuple(map(read_setting, settings or ()))
    except ValueError as error:
        raise click.BadParameter(str(error)) from None
    return PlacedSensor(sensor=sensor, settings=read).load_scanner()


def load_scene_and_pose(
    map_: str, *, start: str | None, pose: str | None
) -> tuple[Scene, Pose3]:
    """Load a map, and return it with the pose of the sensor in it."""
    from radarsim.scene.map_file import load_map

    if (start is None) == (pose is None):
        raise click.BadParameter("expected one of --start and --pose")
    form = next(x for x in get_args(SensorPose) if isinstance(x, Form))
    numbers: Any
    try:
        numbers = None if pose is None else form.read(pose)
    except ValueError:
        text = f"{pose!r}, expected {form.name}"
        raise click.BadParameter(text, param_hint="--pose") from None
    scene = load_map(map_)
    return scene, PlacedSensor(sensor="", start=start, pose=numbers).find_pose(scene)
