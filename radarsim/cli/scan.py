"""``radarsim scan``: scans of a map as JSON, CSV or a picture, without a server."""

from __future__ import annotations

import csv
import io
import json
import math
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from radarsim.cli.options import (
    MapArgument,
    SeedOption,
    SensorOption,
    SensorPoseOption,
    SensorSettingsOption,
    SensorStartOption,
    check_writable,
    list_endings,
    write_file,
)
from radarsim.errors import PresetError, expected_one_of

if TYPE_CHECKING:
    from radarsim.geometry import Pose2, Pose3
    from radarsim.scene.scene import Scene
    from radarsim.sensors.range_scanner import RangeScanner
    from radarsim.sensors.scan import Scan


_OTHER_PICTURES = ("gif", "jpeg", "jpg", "tif", "tiff", "webp", "eps", "ps", "bmp")


class ScanFormat(StrEnum):
    """Output formats of a scan."""

    JSON = "json"
    CSV = "csv"
    PNG = "png"
    SVG = "svg"
    PDF = "pdf"

    @property
    def is_picture(self) -> bool:
        """Whether it shows the scans instead of listing their numbers."""
        return self not in (ScanFormat.JSON, ScanFormat.CSV)


def scan(
    map_: MapArgument,
    *,
    sensor: SensorOption,
    start: SensorStartOption = None,
    pose: SensorPoseOption = None,
    settings: SensorSettingsOption = None,
    seed: SeedOption = 0,
    count: Annotated[
        int, typer.Option(min=1, help="Number of scans; more than 1 make a list.")
    ] = 1,
    format_: Annotated[
        ScanFormat | None,
        typer.Option(
            "--format", help="Output format; by default the suffix of -o, or json."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Write to this file instead of stdout."),
    ] = None,
) -> None:
    """Scan a map without a server."""
    from radarsim.rng import generator_for

    format_ = _choose_format(format_, output)
    if output is not None:
        check_writable(output, "-o")
    scanner = load_scanner(sensor, settings)
    scene, sensor_pose = load_scene_and_pose(map_, start=start, pose=pose)
    rng = generator_for(seed, sensor)
    scans = [scanner.scan(scene, sensor_pose, rng) for _ in range(count)]
    if format_.is_picture:
        from radarsim.plotting.scans import draw_scans

        robot = _robot_pose(scene, start)
        data = draw_scans(scene, scans, robot=robot, form=format_.value)
    else:
        text = _as_json(scans) if format_ is ScanFormat.JSON else _as_csv(scans)
        data = text.encode()
    if output is not None:
        write_file(output, data)
    elif format_.is_picture and sys.stdout.isatty():
        raise typer.BadParameter("a picture for a terminal, expected -o FILE")
    else:
        sys.stdout.buffer.write(data)


def load_scanner(sensor: str, settings: list[str] | None) -> RangeScanner:
    """Create a scanner from a preset and ``KEY=VALUE`` texts.

    Raises:
        typer.BadParameter: If the preset or a setting is wrong.
    """
    from radarsim.presets.sensors import parse_setting
    from radarsim.sensors.range_scanner import load_sensor

    try:
        return load_sensor(sensor, **dict(map(parse_setting, settings or [])))
    except PresetError as error:
        raise typer.BadParameter(str(error)) from None


def load_scene_and_pose(
    map_: str, *, start: str | None, pose: str | None
) -> tuple[Scene, Pose3]:
    """Load a map, and return it with the pose of the sensor in it.

    Args:
        map_: Name of a map, or path of a map file.
        start: Name of a start pose, or None.
        pose: Text of 3 or 6 numbers with commas between them, or None.

    Raises:
        MapError: If the map is wrong.
        typer.BadParameter: If not exactly one of start and pose is given, or it is
            wrong.
    """
    from radarsim.scene.map_file import load_map

    if (start is None) == (pose is None):
        raise typer.BadParameter("expected one of --start and --pose")
    scene = load_map(map_)
    if start is not None:
        return scene, _pose_at_start(scene, start)
    return scene, _read_pose(scene, pose or "")


def _pose_at_start(scene: Scene, name: str) -> Pose3:
    from radarsim.presets.robots import load_robot

    start = scene.start(name)
    if start is None:
        names = [start.name for start in scene.starts]
        text = expected_one_of(name, names)
        if not names:
            text = f"{name[:80]!r}, expected --pose: the map has no starts"
        raise typer.BadParameter(text, param_hint="--start")
    return load_robot("P3AT").scanner_pose(start.pose)


def _read_pose(scene: Scene, text: str) -> Pose3:
    from radarsim.sensors.range_scanner import sensor_pose

    try:
        numbers = [float(number) for number in text.split(",")]
        if len(numbers) == 6:
            numbers[3:5] = [math.radians(number) for number in numbers[3:5]]
        numbers[-1] = math.radians(numbers[-1])
        return sensor_pose(scene, numbers)
    except ValueError:
        raise typer.BadParameter(
            f"{text!r}, expected X,Y,YAW_DEG or X,Y,Z,ROLL,PITCH,YAW_DEG",
            param_hint="--pose",
        ) from None


def _choose_format(format_: ScanFormat | None, output: Path | None) -> ScanFormat:
    """Return the format that is asked for, or that the ending of a file tells.

    Raises:
        typer.BadParameter: If the ending tells no format, or another one.
    """
    ending = "" if output is None else output.suffix.lower().removeprefix(".")
    told = ScanFormat(ending) if ending in list(ScanFormat) else None
    if ending and told is None and (format_ is None or ending in _OTHER_PICTURES):
        text = f"{output}, expected {list_endings(list(ScanFormat))}"
        if ending not in _OTHER_PICTURES:
            text += ", or --format"
        raise typer.BadParameter(text, param_hint="-o")
    if format_ is not None and told not in (None, format_):
        text = f"{format_}, expected {told} as {output} has this ending"
        raise typer.BadParameter(text, param_hint="--format")
    return format_ or told or ScanFormat.JSON


def _robot_pose(scene: Scene, start: str | None) -> Pose2 | None:
    """Return where the robot stands that carries the sensor; None without a start."""
    from radarsim.geometry import Pose2

    found = None if start is None else scene.start(start)
    if found is None:
        return None
    return Pose2(found.pose.x, found.pose.y, found.pose.yaw)


def _as_json(scans: list[Scan]) -> str:
    """Return one scan as an object, several as a list."""
    plain = [scan.to_dict() for scan in scans]
    return json.dumps(plain if len(plain) > 1 else plain[0], allow_nan=False) + "\n"


def _as_csv(scans: list[Scan]) -> str:
    """Return a row for each beam; the range is empty where no echo came back."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["scan", "beam", "angle", "range", "ray"])
    for number, scan in enumerate(scans):
        plain = scan.to_dict()
        rays = plain["rays"] or [None] * len(plain["ranges"])
        rows = zip(scan.angles.tolist(), plain["ranges"], rays, strict=True)
        for beam, row in enumerate(rows):
            writer.writerow([number, beam, *row])
    return text.getvalue()
