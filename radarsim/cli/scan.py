"""``radarsim scan``, and what it shares with ``explain``."""

import csv
import io
import json
import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import typer

from radarsim.cli.options import write_file
from radarsim.errors import PresetError
from radarsim.geometry import Pose3
from radarsim.presets.robots import load_robot
from radarsim.presets.sensors import parse_setting
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.sensors.range_scanner import RangeScanner, load_sensor, sensor_pose
from radarsim.sensors.scan import Scan


@dataclass(frozen=True, slots=True)
class Request:
    """What the options ask for, unread.

    Attributes:
        map_: Path or name.
        sensor: Name of a preset.
        start: Name of a start pose, or None.
        pose: Numbers between commas, or None.
        settings: ``KEY=VALUE`` texts.
        seed: Of the sensor's generator.
    """

    map_: str
    sensor: str
    start: str | None
    pose: str | None
    settings: list[str]
    seed: int

    def read(self) -> tuple[Scene, RangeScanner, Pose3, np.random.Generator]:
        """Load the map and the sensor, and find where it stands.

        Raises:
            MapError: If the map is wrong.
            typer.BadParameter: If an option is.
        """
        try:
            changes = dict(parse_setting(text) for text in self.settings)
            scanner = load_sensor(self.sensor, **changes)
        except PresetError as error:
            raise typer.BadParameter(str(error)) from None
        if (self.start is None) == (self.pose is None):
            raise typer.BadParameter("expected one of --start and --pose")
        scene = load_map(self.map_)
        pose = self._at_start(scene) if self.start else self._at_pose(scene)
        return scene, scanner, pose, generator_for(self.seed, self.sensor)

    def _at_start(self, scene: Scene) -> Pose3:
        start = scene.start(self.start or "")
        if start is None:
            names = [start.name for start in scene.starts]
            expected = f"one of {names}" if names else "--pose: the map has no starts"
            raise typer.BadParameter(
                f"{self.start!r}, expected {expected}", param_hint="--start"
            )
        model = load_robot("P3AT")
        lift = Pose3(0.0, 0.0, model.origin_height)
        return start.pose.compose(lift).compose(model.items_of("RangeScanner")[0].mount)

    def _at_pose(self, scene: Scene) -> Pose3:
        try:
            numbers = [float(text) for text in (self.pose or "").split(",")]
            if len(numbers) == 6:
                numbers[3:5] = [math.radians(number) for number in numbers[3:5]]
            numbers[-1] = math.radians(numbers[-1])
            return sensor_pose(scene, numbers)
        except ValueError:
            raise typer.BadParameter(
                f"{self.pose!r}, expected X,Y,YAW_DEG or X,Y,Z,ROLL,PITCH,YAW_DEG",
                param_hint="--pose",
            ) from None


def write_scans(
    request: Request, *, count: int, form: str, output: Path | None
) -> None:
    """Take scans and write them.

    Raises:
        MapError: If the map is wrong.
        typer.BadParameter: If an option is.
    """
    scene, scanner, pose, rng = request.read()
    scans = [scanner.scan(scene, pose, rng) for _ in range(count)]
    if form == "png":
        from radarsim.plotting import draw_scans

        data = draw_scans(scene, scans)
    else:
        text = scans_as_json(scans) if form == "json" else scans_as_csv(scans)
        data = text.encode()
    if output is not None:
        write_file(output, data)
    elif form == "png" and sys.stdout.isatty():
        raise typer.BadParameter("a picture for a terminal, expected -o FILE")
    else:
        sys.stdout.buffer.write(data)


def scans_as_json(scans: list[Scan]) -> str:
    """Give one scan as an object, several as a list."""
    shown = [scan.to_dict() for scan in scans]
    return json.dumps(shown if len(shown) > 1 else shown[0], allow_nan=False) + "\n"


def scans_as_csv(scans: list[Scan]) -> str:
    """Give a row for each beam; an empty range where nothing came back."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["scan", "beam", "angle", "range", "ray"])
    for number, scan in enumerate(scans):
        shown = scan.to_dict()
        rays = shown["rays"] or [None] * len(shown["ranges"])
        rows = zip(scan.angles.tolist(), shown["ranges"], rays, strict=True)
        for beam, row in enumerate(rows):
            writer.writerow([number, beam, *row])
    return text.getvalue()
