"""Scans for figures, as anybody can take them again on the command line."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose2, Pose3
from radarsim.presets.robots import load_robot
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.sensors.range_scanner import RangeScanner, load_sensor
from radarsim.sensors.scan import Scan

ROBOT = "P3AT"
START = "RobotStart1"


@dataclass(frozen=True, slots=True)
class ScanSpec:
    """Scans that a robot's sensor takes at a start of a map.

    Attributes:
        map: Its name.
        sensor: Name of the preset.
        seed: Of its generator.
        settings: Keys and values that differ from the preset's.
        count: How many scans.
        start: Name of the start.
    """

    map: str
    sensor: str
    seed: int
    settings: tuple[tuple[str, str | float | tuple[float, ...]], ...] = ()
    count: int = 1
    start: str = START

    @property
    def command(self) -> str:
        """What takes the same scans on the command line."""
        words = ["radarsim scan", self.map, "--sensor", self.sensor]
        for key, value in self.settings:
            words += ["--set", f"{key}={_as_text(value)}"]
        words += ["--start", self.start, "--seed", str(self.seed)]
        if self.count > 1:
            words += ["--count", str(self.count)]
        return " ".join(words)

    @property
    def scene(self) -> Scene:
        """The map."""
        return scene_of(self.map)

    @property
    def scanner(self) -> RangeScanner:
        """The sensor."""
        return load_sensor(self.sensor, **dict(self.settings))

    @property
    def pose(self) -> Pose3:
        """Of the sensor, map frame."""
        model = load_robot(ROBOT)
        lift = Pose3(0.0, 0.0, model.origin_height)
        mount = model.items_of("RangeScanner")[0].mount
        return start_of(self.scene, self.start).compose(lift).compose(mount)

    @property
    def robot(self) -> Pose2:
        """Where the robot stands, map frame."""
        pose = start_of(self.scene, self.start)
        return Pose2(pose.x, pose.y, pose.yaw)

    def take(self) -> list[Scan]:
        """Scan."""
        scene, scanner, pose = self.scene, self.scanner, self.pose
        rng = generator_for(self.seed, self.sensor)
        return [scanner.scan(scene, pose, rng) for _ in range(self.count)]


@cache
def scene_of(map_: str) -> Scene:
    """Load a map, once in a process."""
    return load_map(map_)


def start_of(scene: Scene, name: str) -> Pose3:
    """Give where a start is, map frame."""
    start = scene.start(name)
    if start is None:
        names = [each.name for each in scene.starts]
        raise ValueError(f"start {name!r}, expected one of {names}")
    return start.pose


def ends_of(scan: Scan) -> Floats:
    """Give where rays ended in truth, (N, 3) m, map frame; inf for no return."""
    rays = scan.cast
    return rays.origins + scan.ranges[:, None] * rays.directions


def answers_of(scan: Scan) -> NDArray[np.str_]:
    """Give the name of what each beam reads, (N,); empty where nothing came back."""
    echoes, names = scan.echoes, np.full(len(scan.ranges), "", dtype="U40")
    for part, target in echoes.targets.items():
        names[echoes.beams[echoes.parts == part]] = target.object
    return np.where(np.isfinite(scan.ranges), names, "")


def _as_text(value: str | float | tuple[float, ...]) -> str:
    if isinstance(value, tuple):
        return ",".join(f"{each:g}" for each in value)
    return value if isinstance(value, str) else f"{value:g}"
