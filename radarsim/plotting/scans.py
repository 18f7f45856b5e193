"""Plots of scans: rays, echoes and ranges over a section of the map."""

import io
import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from radarsim.geometry import Floats
from radarsim.plotting.ray_segments import draw_rays, group_by_ray
from radarsim.plotting.style import Legend, echo_points, material_colours, scan_points
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.attenuation import EventKind
from radarsim.robots.obstacles import slice_mesh
from radarsim.scene.scene import Scene
from radarsim.sensors.echoes import ROBOT, Echoes
from radarsim.sensors.scan import Scan


class EchoMarker(NamedTuple):
    """Marker for the echoes of one kind.

    Attributes:
        text: Text of the legend.
        marker: Marker style of matplotlib.
        filled: Whether the marker is filled or only outlined.
        area: Area of the marker of the strongest echo, square points.
    """

    text: str
    marker: str
    filled: bool
    area: float


ECHO_MARKERS: Final = {
    EventKind.ENTER: EchoMarker("enters a volume", "^", filled=False, area=16),
    EventKind.LEAVE: EchoMarker("leaves a volume", "v", filled=False, area=16),
    EventKind.SHEET: EchoMarker("crosses a sheet", "D", filled=False, area=14),
    EventKind.HIT: EchoMarker("hits", "s", filled=True, area=18),
    EventKind.SPENT: EchoMarker("is spent", "x", filled=True, area=34),
    EventKind.RAIN: EchoMarker("rain shows", "*", filled=True, area=24),
}
MIN_AREA: Final = 0.3  # share of the area that an echo without strength has


def draw_echoes(
    axes: Axes, scan: Scan, colours: Mapping[str, str], legend: Legend
) -> set[str]:
    """Draw the echoes that the sensor keeps.

    Each kind and material gets its own collection of markers, labelled with both.

    Returns:
        Names of the materials that the echoes came from.
    """
    echoes = scan.echoes
    points, areas = echo_points(scan, echoes), _areas(echoes)
    material_of = {part: target.material for part, target in echoes.targets.items()}
    materials = np.array([material_of[part] for part in echoes.parts.tolist()], np.str_)
    for kind, shape in ECHO_MARKERS.items():
        for material in sorted(set(material_of.values())):
            chosen = (echoes.kinds == kind) & (materials == material)
            if chosen.any():
                colour = colours[material]
                axes.scatter(
                    points[chosen, 0],
                    points[chosen, 1],
                    areas[chosen],
                    marker=shape.marker,
                    facecolors=colour if shape.filled else "none",
                    edgecolors=None if shape.filled else colour,
                    linewidths=0.7,
                    label=f"{shape.text}: {material}",
                    zorder=3,
                )
    _add_echo_rows(legend, echoes)
    return set(material_of.values())


def _areas(echoes: Echoes) -> Floats:
    """Return the areas of markers, (E,) square points, larger for stronger echoes."""
    shares = MIN_AREA + (1 - MIN_AREA) * np.clip(echoes.strength, 0.0, 1.0)
    full = np.array(
        [ECHO_MARKERS[EventKind(kind)].area for kind in echoes.kinds.tolist()]
    )
    return np.asarray(full * shares)


def _add_echo_rows(legend: Legend, echoes: Echoes) -> None:
    kinds = set(echoes.kinds.tolist())
    if not kinds:
        return
    legend.add_heading("Echoes (larger: stronger)")
    for kind, shape in ECHO_MARKERS.items():
        if kind in kinds:
            fill = "black" if shape.filled else "none"
            legend.add_marker(
                shape.text,
                shape.marker,
                markeredgecolor="black",
                markerfacecolor=fill,
                markersize=5,
            )


MARGIN: Final = 0.5  # m around the map
OPAQUE_WIDTH: Final = 1.4  # points


def draw_scans(scene: Scene, scans: Sequence[Scan]) -> bytes:
    """Plot scans over the section of the map at the sensor's height.

    Args:
        scene: The map.
        scans: One or more scans of one sensor.

    Returns:
        Content of a PNG file.
    """
    canvas = FigureCanvasAgg(plot_scans(scene, scans))
    data = io.BytesIO()
    canvas.print_figure(data, format="png", metadata={"Software": "radarsim"})
    return data.getvalue()


def plot_scans(scene: Scene, scans: Sequence[Scan]) -> Figure:
    """Plot scans over the section of the map; a single scan with its rays and echoes.

    The rays are traced again, in the map without robots.

    Args:
        scene: The map.
        scans: One or more scans of one sensor.
    """
    layout = ConstrainedLayoutEngine(compress=True, w_pad=0.15, h_pad=0.1)
    figure = Figure(figsize=(13, 7.6), dpi=120, layout=layout)
    axes = figure.add_subplot()
    legend = Legend()
    colours = material_colours(scene)
    materials = [part.material for part in scene.parts]
    _draw_plan(axes, scene, colours, scans[0].pose.z)
    _frame(axes, scene, scans)
    _draw_readings(axes, scans, legend)
    if len(scans) == 1:
        draw_rays(axes, scene, scans[0], legend)
        hit = draw_echoes(axes, scans[0], colours, legend)
        materials += [ROBOT] if ROBOT.name in hit else []
    legend.add_heading("Materials")
    legend.add_materials(materials)
    legend.add_line("opaque, in the plan", color="black", linewidth=OPAQUE_WIDTH)
    legend.draw(figure)
    return figure


def _draw_plan(
    axes: Axes, scene: Scene, colours: Mapping[str, str], height: float
) -> None:
    """Draw the section of the map: opaque objects in black, others in colour."""
    for part in scene.parts:
        lines = slice_mesh(part.vertices, part.faces, height)
        opaque = math.isinf(part.material.density)
        plan = LineCollection(
            list(lines),
            colors="black" if opaque else colours[part.material.name],
            linewidths=OPAQUE_WIDTH if opaque else 1.0,
            alpha=1.0 if opaque else 0.7,
            zorder=1.5,
        )
        axes.add_collection(plan)


def _draw_readings(axes: Axes, scans: Sequence[Scan], legend: Legend) -> None:
    """Draw a dot for each range, along its beam, in the colour of its ray."""
    single = len(scans) == 1
    size = 3 if single else 2
    for scan in scans:
        ends, came_back = scan_points(scan), np.isfinite(scan.ranges)
        for chosen, colour, _ in group_by_ray(scan):
            dots = ends[chosen & came_back]
            axes.plot(*dots.T, ".", color=colour, markersize=size, zorder=4)
    place = scans[0].pose.position()
    axes.plot(*place[:2], "o", color="black", markersize=6, zorder=2.5)
    legend.add_heading("Rays that gave the ranges" if single else "Ranges")
    for _, colour, name in group_by_ray(scans[0]):
        if single:
            legend.add_line(name, color=colour, linewidth=1.2)
        else:
            legend.add_marker(name, ".", color=colour)
    if single:
        legend.add_marker("range, along its beam", ".", color="0.35")


def _frame(axes: Axes, scene: Scene, scans: Sequence[Scan]) -> None:
    """Set the limits and title, and draw circles of equal range around the sensor."""
    scan = scans[0]
    x, y = scan.pose.x, scan.pose.y
    read = [
        scan_points(s)[np.isfinite(s.ranges)] for s in scans
    ]  # ghosts of mirrors lie outside the map
    points = np.concatenate([scene.bounds[:, :2], [[x, y]], *read])
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    axes.set_xlim(x0 - MARGIN, x1 + MARGIN)
    axes.set_ylim(y0 - MARGIN, y1 + MARGIN)
    farthest = math.hypot(x1 - x0, y1 - y0)
    step = max(1, round(farthest / 8))
    around = np.linspace(0, 2 * math.pi, 181)
    for radius in np.arange(step, farthest, step):
        circle = (x + radius * np.cos(around), y + radius * np.sin(around))
        axes.plot(*circle, color="0.85", linewidth=0.5, zorder=0)
    axes.set_aspect("equal")
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    axes.set_title(_title(scene, scans, step), fontsize="medium", parse_math=False)


def _title(scene: Scene, scans: Sequence[Scan], step: int) -> str:
    scan = scans[0]
    beyond = sum(int(np.count_nonzero(~np.isfinite(s.ranges))) for s in scans)
    blind = sum(int(np.count_nonzero(s.ranges == 0)) for s in scans)
    turned = f"{math.degrees(scan.pose.yaw):.0f}°"
    counted = f"{len(scans)} scans of " if len(scans) > 1 else ""
    counted += f"{len(scan.ranges)} beams, {beyond} without return"
    counted += f", {blind} blinded" if blind else ""
    return (
        f"{scan.sensor} in {scene.name}"
        f" at x {scan.pose.x:.2f} m, y {scan.pose.y:.2f} m, yaw {turned}: {counted}\n"
        f"{_beams(scan.echoes.settings)}; plan at the sensor's height, "
        f"z {scan.pose.z:.2f} m; circles every {step} m"
    )


def _beams(settings: SensorSettings) -> str:
    """Describe the rays of a beam and the echoes that it keeps."""
    mode = settings.return_mode
    echoes = "all echoes" if mode == "all" else f"{mode} echo"
    if not settings.has_side_rays:
        return echoes
    answer = "together" if settings.combines_rays else "one drawn"
    if settings.side_mode == "cone":
        return f"cone of {settings.cone_rays} rays, {answer}, {echoes}"
    return f"N = {settings.side_offset_uu:g} {settings.side_mode}, {answer}, {echoes}"
