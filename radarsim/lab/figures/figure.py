"""Figures with their captions, as PNG files, and the scans that they show.

Each scan knows the command that repeats it.
"""

import io
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np
from matplotlib import image
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from radarsim.errors import expected_one_of
from radarsim.geometry import Floats, Pose2, Pose3
from radarsim.plotting.style import QUIET
from radarsim.presets.robots import load_robot
from radarsim.rng import generator_for
from radarsim.scene.map_file import load_map
from radarsim.scene.scene import Scene
from radarsim.sensors.range_scanner import RangeScanner, load_sensor
from radarsim.sensors.scan import Scan

ROBOT = "P3AT"
START = "RobotStart1"
_TITLE_GAP: Final = 0.16  # inches above the title
_TITLE_SIZE: Final = 17  # points
_SMALL_PRINT: Final = 0.52  # inches from the top


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
            values = value if isinstance(value, tuple) else (value,)
            text = ",".join(v if isinstance(v, str) else f"{v:g}" for v in values)
            words += ["--set", f"{key}={text}"]
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


@dataclass(frozen=True, slots=True)
class DrawnFigure:
    """A figure that has been drawn, with its caption.

    Attributes:
        drawing: The drawing.
        caption: What the figure shows and what to see in it, in two sentences.
        commands: Commands that take the same scans, drive the same path or show more.
        details: The measured numbers, in sentences; a line for each paragraph.
    """

    drawing: Figure
    caption: str
    commands: tuple[str, ...] = ()
    details: str = ""

    @property
    def headline(self) -> str:
        """What is written above the drawing, or above its panels."""
        texts = [text.get_text() for text in self.drawing.texts[:1]]
        titles = [axes.get_title(loc="left") for axes in self.drawing.axes]
        return "; ".join(texts or filter(None, titles))

    def as_png(self) -> bytes:
        """Return the content of a PNG file; equal drawings give equal bytes."""
        flat = io.BytesIO()
        # By way of the pixels, as matplotlib's PNG files always have the channel of
        # opacity.
        FigureCanvasAgg(self.drawing).print_figure(flat, format="rgba")
        width, height = self.drawing.canvas.get_width_height()
        pixels = np.frombuffer(flat.getvalue(), np.uint8).reshape(height, width, 4)
        data = io.BytesIO()
        # without the opacity, as all of it is opaque
        rgb = np.ascontiguousarray(pixels[:, :, :3])
        image.imsave(data, rgb, format="png", metadata={"Software": "radarsim"})
        return data.getvalue()


def png_size(png: bytes) -> tuple[int, int]:
    """Return the width and height of a PNG file, pixels."""
    return int.from_bytes(png[16:20], "big"), int.from_bytes(png[20:24], "big")


def draw_title(drawing: Figure, text: str, small_print: str = "") -> None:
    """Write the title of a figure at its upper left, and a small text below it."""
    _, height = drawing.get_size_inches()
    top = 1 - _TITLE_GAP / height
    drawing.text(0.02, top, text, va="top", fontsize=_TITLE_SIZE, fontweight="bold")
    if small_print:
        top = 1 - _SMALL_PRINT / height
        drawing.text(0.02, top, small_print, va="top", color=QUIET)


def draw_legend(
    drawing: Figure, samples: Mapping[str, Line2D], size: float | str | None = None
) -> None:
    """Draw a legend at the bottom of a figure, in one row.

    Args:
        drawing: The figure.
        samples: Samples by their texts.
        size: Font size; by default that of matplotlib.
    """
    drawing.legend(
        list(samples.values()),
        list(samples),
        loc="lower center",
        ncols=len(samples),
        fontsize=size,
        frameon=False,
    )
