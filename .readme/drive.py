"""Draw the moving picture of the README: what a laser and a radar read on a drive.

Called as ``drive.py FILE.gif``, with radarsim installed.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

import radarsim
from radarsim.plotting.plan import draw_plan, draw_robot

FRAMES = 40
STEP = 0.5  # simulated seconds per frame
SHOWN = 120  # ms per frame
HOLD = 4000  # ms of the last frame
COLOURS = 48
SENSORS = {
    "laser": ("A laser reads the bushes", "#e8490f"),
    "radar": ("A radar also reads what is behind them", "#5b3fe0"),
}
NAMES = (("bushes", 1.9, -5.9), ("crate", 5.0, 3.4), ("crate", 6.2, -3.9))
NAMES += (("pole", 3.9, -1.4), ("cabinet", 6.0, -0.9))


class Panel:
    """What one sensor reads, from above: rays now, and the ends of all rays so far."""

    def __init__(self, axes: Axes, scene: radarsim.Scene, sensor: str) -> None:
        title, colour = SENSORS[sensor]
        self.axes, self.scene = axes, scene
        self.sensor = radarsim.load_sensor(sensor)
        self.rng = radarsim.generator_for(0, sensor)
        self.ends = np.zeros((0, 2))
        self.robot: list = []
        axes.set_title(title, loc="left", fontsize=14, fontweight="bold")
        axes.set_axis_off()
        draw_plan(axes, scene, 0.35)
        for name, x, y in NAMES:
            axes.text(x, y, name, fontsize=9)
        (self.rays,) = axes.plot([], [], color=colour, linewidth=0.5, alpha=0.5)
        (self.dots,) = axes.plot([], [], ".", color=colour, markersize=3.5)

    def scan(self, pose: radarsim.Pose2) -> None:
        """Add a scan from a pose of the robot."""
        scan = self.sensor.scan(self.scene, (pose.x, pose.y, pose.yaw), self.rng)
        angles = scan.angles + pose.yaw
        directions = np.c_[np.cos(angles), np.sin(angles)]
        ends = (pose.x, pose.y) + scan.ranges[:, None] * directions
        ends = ends[np.isfinite(scan.ranges)]
        lines = np.full((len(ends), 3, 2), np.nan)
        lines[:, 0], lines[:, 1] = (pose.x, pose.y), ends
        self.ends = np.concatenate([self.ends, ends])
        self.rays.set_data(*lines.reshape(-1, 2).T)
        self.dots.set_data(*self.ends.T)
        for patch in self.robot:
            patch.remove()
        self.robot = draw_robot(self.axes, "P3AT", pose)


def main(target: Path) -> None:
    """Drive a robot along the bushes, and scan with both sensors from where it is."""
    scene = radarsim.load_map("foliage_room")
    robot = radarsim.simulate(scene, seed=0).spawn("P3AT", pose=(-8.0, -4.5, 0.95))
    figure = Figure(figsize=(9.6, 3.3), dpi=100, layout="constrained")
    canvas, frames = FigureCanvasAgg(figure), []
    axes = figure.subplots(1, 2)
    panels = [Panel(*each) for each in zip(axes, [scene] * 2, SENSORS, strict=True)]
    for number in range(FRAMES):
        for panel in panels:
            panel.scan(robot.pose)
        canvas.draw()
        pixels = np.asarray(canvas.buffer_rgba())[..., :3]
        frame = Image.fromarray(pixels).quantize(COLOURS, dither=Image.Dither.NONE)
        frames.append(frame)
        robot.drive(0.5, turn=0.3 * np.cos(number / 6))
        robot.simulation.step(STEP)
    times = [SHOWN] * (FRAMES - 1) + [HOLD]
    first, *others = frames
    first.save(target, save_all=True, append_images=others, duration=times, loop=0)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
