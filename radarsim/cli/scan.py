"""``radarsim scan``: scans of a map as JSON, CSV or a picture, without a server."""

from __future__ import annotations

import csv
import io
import json
import math
import sys
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, ClassVar

import click
import numpy as np
from annotated_types import Ge

from radarsim.cli.fields import MapName, OutputFile, Seed, SensorName, Setting
from radarsim.cli.output import (
    PICTURE_FORMS,
    check_writable,
    list_endings,
    print_bytes,
    print_lines,
    write_file,
)
from radarsim.errors import PresetError, expected_one_of
from radarsim.plans import Form, Option, read_numbers

if TYPE_CHECKING:
    from pathlib import Path

    from radarsim.geometry import Pose3
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


def _read_pose(text: str) -> tuple[float, ...]:
    """Parse ``X,Y,YAW_DEG`` or ``X,Y,Z,ROLL,PITCH,YAW_DEG``; return m and rad."""
    numbers = read_numbers(text)
    if len(numbers) not in (3, 6):
        raise ValueError(f"{text!r}, expected 3 or 6 numbers")
    at = 2 if len(numbers) == 3 else 3
    return (*numbers[:at], *map(math.radians, numbers[at:]))


SensorPose = Annotated[
    tuple[float, ...],
    Form("X,Y,YAW_DEG or X,Y,Z,ROLL,PITCH,YAW_DEG", _read_pose),
    Option(metavar="X,Y,YAW_DEG"),
]


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedSensor:
    """A sensor at a pose in a map.

    Attributes:
        sensor: Name of a sensor preset; 'radarsim sensors' lists them.
        start: Place the sensor as if on a P3AT robot at this start pose.
        pose: Pose of the sensor, map frame, m; or X,Y,Z,ROLL,PITCH,YAW_DEG.
        settings: Change a setting of the sensor; repeat the option for others.
        seed: Seed of all random numbers.
    """

    option_group: ClassVar = "Sensor"
    one_required: ClassVar[tuple[tuple[str, ...], ...]] = (("start", "pose"),)

    sensor: SensorName
    start: str | None = None
    pose: SensorPose | None = None
    settings: Annotated[tuple[Setting, ...], Option(names=("--set",))] = ()
    seed: Seed = 0

    def load_scanner(self) -> RangeScanner:
        """Create the scanner.

        Raises:
            click.BadParameter: If the preset or a setting is wrong.
        """
        from radarsim.sensors.range_scanner import load_sensor

        try:
            return load_sensor(self.sensor, **dict(self.settings))
        except PresetError as error:
            raise click.BadParameter(str(error)) from None

    def find_pose(self, scene: Scene) -> Pose3:
        """Return the pose of the sensor in a map.

        Raises:
            click.BadParameter: If the map has no such start.
        """
        from radarsim.presets.robots import load_robot
        from radarsim.sensors.range_scanner import sensor_pose

        if self.start is None:
            return sensor_pose(scene, self.pose or ())
        start = scene.start(self.start)
        if start is None:
            names = [start.name for start in scene.starts]
            text = expected_one_of(self.start, names)
            if not names:
                text = f"{self.start[:80]!r}, expected --pose: the map has no starts"
            raise click.BadParameter(text, param_hint="--start")
        return load_robot("P3AT").scanner_pose(start.pose)


def scan(
    map_: MapName,
    plan: PlacedSensor,
    *,
    count: Annotated[int, Ge(1)] = 1,
    format_: ScanFormat | None = None,
    output: OutputFile = None,
) -> None:
    """Scan a map without a server.

    A terminal shows a summary; with -o, --format or a pipe the command writes all
    data.

    Args:
        map_: A map file or the name of a shipped map; MAP@VARIANT selects a variant.
        plan: The sensor and its pose.
        count: Number of scans; several scans are written as a list.
        format_: Output format; by default that of the file ending of -o, or json.
        output: Write to this file instead of stdout.
    """
    from radarsim.rng import generator_for
    from radarsim.scene.map_file import load_map

    chosen = _choose_format(format_, output)
    if output is not None:
        check_writable(output, "-o")
    scanner = plan.load_scanner()
    scene = load_map(map_)
    pose = plan.find_pose(scene)
    rng = generator_for(plan.seed, plan.sensor)
    scans = [scanner.scan(scene, pose, rng) for _ in range(count)]
    is_terminal = sys.stdout.isatty()
    if output is not None:
        write_file(output, _as_bytes(scans, scene, plan.start, chosen))
    elif is_terminal and chosen in PICTURE_FORMS:
        raise click.BadParameter("a terminal shows no pictures, expected -o FILE")
    elif is_terminal and format_ is None:
        print_lines(_summary(scans))
    else:
        # The output is written as bytes, since it may be a picture.
        print_bytes(_as_bytes(scans, scene, plan.start, chosen))


def _summary(scans: list[Scan]) -> list[str]:
    """Return lines that summarise scans for a terminal, and a hint at output files."""
    lines = []
    for each in scans:
        ranges, pose = each.ranges[np.isfinite(each.ranges)], each.pose
        lines.append(
            f"{each.sensor} at {pose.x:.2f} {pose.y:.2f} {pose.z:.2f},"
            f" {len(ranges)} of {len(each.ranges)} beams return"
        )
        if ranges.size:
            nearest = int(np.argmin(each.ranges))
            lines.append(
                f"  nearest {ranges.min():.2f} m"
                f" at {math.degrees(each.angles[nearest]):.0f} degrees,"
                f" median {np.median(ranges):.2f} m, farthest {ranges.max():.2f} m"
            )
    return [*lines, "all numbers: -o FILE.json or FILE.csv, or a pipe; a picture: .png"]


def _choose_format(format_: ScanFormat | None, output: Path | None) -> ScanFormat:
    """Return the output format, from ``--format`` or the ending of the file name.

    Raises:
        click.BadParameter: If the ending is unknown, or contradicts ``--format``.
    """
    ending = "" if output is None else output.suffix.lower().removeprefix(".")
    found = ScanFormat(ending) if ending in list(ScanFormat) else None
    # With --format any ending is allowed, except the endings of other picture formats.
    if ending and found is None and (format_ is None or ending in _OTHER_PICTURES):
        text = f"{output}, expected {list_endings(list(ScanFormat))}"
        if ending not in _OTHER_PICTURES:
            text += ", or --format"
        raise click.BadParameter(text, param_hint="-o")
    if format_ is not None and found not in (None, format_):
        text = f"{format_}, expected {found}, the ending of {output}"
        raise click.BadParameter(text, param_hint="--format")
    return format_ or found or ScanFormat.JSON


def _as_bytes(
    scans: list[Scan], scene: Scene, start: str | None, form: ScanFormat
) -> bytes:
    """Return scans in a format; a picture with a start pose also shows the robot."""
    if form is ScanFormat.JSON:  # an object for one scan, a list for several
        plain = [each.to_dict() for each in scans]
        data = plain if len(plain) > 1 else plain[0]
        return f"{json.dumps(data, allow_nan=False)}\n".encode()
    if form is ScanFormat.CSV:
        return _as_csv(scans).encode()
    from radarsim.geometry import Pose2
    from radarsim.plotting.scans import plot_scans
    from radarsim.plotting.style import render

    found = None if start is None else scene.start(start)
    at = None if found is None else found.pose
    robot = None if at is None else Pose2(at.x, at.y, at.yaw)
    return render(plot_scans(scene, scans, robot=robot), form.value)


def _as_csv(scans: list[Scan]) -> str:
    """Return CSV with a row for each beam; beams without echo have an empty range."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["scan", "beam", "angle", "range", "ray"])
    for number, each in enumerate(scans):
        plain = each.to_dict()
        rays = plain["rays"] or [None] * len(plain["ranges"])
        rows = zip(each.angles.tolist(), plain["ranges"], rays, strict=True)
        for beam, row in enumerate(rows):
            writer.writerow([number, beam, *row])
    return text.getvalue()
