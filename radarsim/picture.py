"""Pictures of scans: the readings over a plan of the map."""

import io
import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from radarsim.geometry import Floats
from radarsim.robots.sections import section
from radarsim.scene.scene import Scene
from radarsim.sensors.scan import Scan

# Figures of beams show the left ray red and the right one blue.
RAY_COLOURS = {-1: ("tab:blue", "right"), 0: ("0.35", "centre"), 1: ("tab:red", "left")}
LASER_COLOUR = "tab:purple"
MARGIN = 0.5  # m around the map


def draw_scans(scene: Scene, scans: Sequence[Scan]) -> bytes:
    """Draw scans over the section of the map at the sensor's height.

    Args:
        scene: The map.
        scans: Of one sensor; at least one.

    Returns:
        A PNG file.
    """
    figure = Figure(figsize=(11, 7), dpi=110, layout="constrained")
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    _draw_plan(axes, scene, scans[0].pose.z)
    for scan in scans:
        _draw_scan(axes, scan, thin=len(scans) > 1)
    _frame(axes, scene, scans)
    text = io.BytesIO()
    canvas.print_figure(text, format="png", metadata={"Software": "radarsim"})
    return text.getvalue()


def _draw_plan(axes: Axes, scene: Scene, height: float) -> None:
    """Draw what the plane of the scan cuts, opaque things black, others green."""
    for part in scene.parts:
        opaque = math.isinf(part.material.density)
        lines = section(part.vertices, part.faces, height)
        colour = "black" if opaque else "tab:green"
        style = {"linewidths": 1.6} if opaque else {"linewidths": 1.0, "alpha": 0.7}
        axes.add_collection(LineCollection(list(lines), colors=colour, **style))


def _draw_scan(axes: Axes, scan: Scan, *, thin: bool) -> None:
    ends = scan_points(scan)
    came_back = np.isfinite(scan.ranges)
    rays = np.zeros(len(ends), np.int8) if scan.rays is None else scan.rays
    start = scan.pose.position()[:2]
    for ray, (ray_colour, _) in RAY_COLOURS.items():
        colour = LASER_COLOUR if scan.rays is None else ray_colour
        chosen = came_back & (rays == ray)
        if not thin:
            lines = [(start, end) for end in ends[chosen]]
            axes.add_collection(
                LineCollection(lines, colors=colour, linewidths=0.3, alpha=0.5)
            )
        axes.plot(*ends[chosen].T, ".", color=colour, markersize=2 if thin else 4)
    axes.plot(*start, "o", color="black", markersize=6)


def scan_points(scan: Scan) -> Floats:
    """Place readings along their beams, as a client does: (N, 2) m, map frame.

    Where nothing came back, the point is at the greatest range.
    """
    reach = np.where(np.isfinite(scan.ranges), scan.ranges, scan.range_max)
    flat = np.column_stack(
        [reach * np.cos(scan.angles), reach * np.sin(scan.angles), np.zeros(len(reach))]
    )
    return np.asarray((scan.pose.position() + flat @ scan.pose.rotation().T)[:, :2])


def _frame(axes: Axes, scene: Scene, scans: Sequence[Scan]) -> None:
    """Show the map, the sensor and its circles of equal range."""
    scan = scans[0]
    (x0, y0, _), (x1, y1, _) = scene.bounds
    x, y = scan.pose.x, scan.pose.y
    axes.set_xlim(min(x0, x) - MARGIN, max(x1, x) + MARGIN)
    axes.set_ylim(min(y0, y) - MARGIN, max(y1, y) + MARGIN)
    farthest = math.hypot(x1 - x0, y1 - y0)
    step = max(1, round(farthest / 8))
    around = np.linspace(0, 2 * math.pi, 181)
    for radius in np.arange(step, farthest, step):
        circle = (x + radius * np.cos(around), y + radius * np.sin(around))
        axes.plot(*circle, color="0.85", linewidth=0.5, zorder=0)
    axes.set_aspect("equal")
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    pose = f"x {x:.2f} m, y {y:.2f} m, yaw {math.degrees(scan.pose.yaw):.0f}°"
    beyond = sum(int(np.count_nonzero(~np.isfinite(s.ranges))) for s in scans)
    blind = sum(int(np.count_nonzero(s.ranges == 0)) for s in scans)
    counted = f"{len(scans)} scans of " if len(scans) > 1 else ""
    counted += f"{len(scan.ranges)} beams, {beyond} without return"
    counted += f", {blind} blinded" if blind else ""
    axes.set_title(
        f"{scan.sensor} in {scene.name} at {pose}: {counted}; circles every {step} m",
        fontsize="medium",
    )
    if scan.rays is not None:
        for colour, name in RAY_COLOURS.values():
            axes.plot([], [], ".", color=colour, label=f"{name} ray")
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))  # covers no reading
