"""Scans for figures, each with the command that repeats it."""

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
from radarsim.suggestions import expected_one_of

ROBOT = "P3AT"
START = "RobotStart1"


@dataclass(frozen=True, slots=True)
class ScanSpec:
    """Scans of a robot's sensor at a start of a map.

    Attributes:
        map: Name of the map.
        sensor: Name of the sensor preset.
        seed: Seed of the sensor's generator.
        settings: Settings that differ from those of the preset.
        count: Number of scans.
        start: Name of the start pose.
    """

    map: str
    sensor: str
    seed: int
    settings: tuple[tuple[str, str | float | tuple[float, ...]], ...] = ()
    count: int = 1
    start: str = START

    @property
    def command(self) -> str:
        """Command that takes the same scans."""
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
        return load_scene(self.map)

    @property
    def scanner(self) -> RangeScanner:
        """The sensor."""
        return load_sensor(self.sensor, **dict(self.settings))

    @property
    def pose(self) -> Pose3:
        """Pose of the sensor, map frame."""
        model = load_robot(ROBOT)
        lift = Pose3(0.0, 0.0, model.origin_height)
        mount = model.items_of("RangeScanner")[0].mount
        return find_start_pose(self.scene, self.start).compose(lift).compose(mount)

    @property
    def robot(self) -> Pose2:
        """Pose of the robot, map frame."""
        pose = find_start_pose(self.scene, self.start)
        return Pose2(pose.x, pose.y, pose.yaw)

    def take(self) -> list[Scan]:
        """Take the scans."""
        scene, scanner, pose = self.scene, self.scanner, self.pose
        rng = generator_for(self.seed, self.sensor)
        return [scanner.scan(scene, pose, rng) for _ in range(self.count)]


@cache
def load_scene(map_: str) -> Scene:
    """Load a map; the result is cached."""
    return load_map(map_)


def find_start_pose(scene: Scene, name: str) -> Pose3:
    """Return the pose of a start, map frame."""
    start = scene.start(name)
    if start is None:
        names = [each.name for each in scene.starts]
        raise ValueError(f"start {expected_one_of(name, names)}")
    return start.pose


def hit_points(scan: Scan) -> Floats:
    """Return the true ends of rays, (N, 3) m, map frame; inf for no return."""
    rays = scan.cast
    return rays.origins + scan.ranges[:, None] * rays.directions


def object_names(scan: Scan) -> NDArray[np.str_]:
    """Return the name of the object that each beam reads, (N,); empty for no return."""
    echoes, names = scan.echoes, np.full(len(scan.ranges), "", dtype="U40")
    for part, target in echoes.targets.items():
        names[echoes.beams[echoes.parts == part]] = target.object
    return np.where(np.isfinite(scan.ranges), names, "")


def _as_text(value: str | float | tuple[float, ...]) -> str:
    if isinstance(value, tuple):
        return ",".join(f"{each:g}" for each in value)
    return value if isinstance(value, str) else f"{value:g}"
