"""Echoes as markers."""

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
from radarsim.plotting.ray_segments import draw_rays, kinds_of_rays
from radarsim.plotting.style import Legend, echo_points, material_colours, scan_points
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.raycast.attenuation import EventKind
from radarsim.robots.obstacles import slice_mesh
from radarsim.scene.scene import Scene
from radarsim.sensors.echoes import Echoes
from radarsim.sensors.scan import Scan


class Shape(NamedTuple):
    """How echoes of one kind look.

    Attributes:
        text: What the legend says.
        marker: Of matplotlib.
        filled: Whether in colour, or only its outline.
        area: Square points, of the strongest echo.
    """

    text: str
    marker: str
    filled: bool
    area: float


SHAPES: Final = {
    EventKind.ENTER: Shape("enters a volume", "^", filled=False, area=16),
    EventKind.LEAVE: Shape("leaves a volume", "v", filled=False, area=16),
    EventKind.SHEET: Shape("crosses a sheet", "D", filled=False, area=14),
    EventKind.HIT: Shape("hits", "s", filled=True, area=18),
    EventKind.SPENT: Shape("is spent", "x", filled=True, area=34),
    EventKind.RAIN: Shape("rain shows", "*", filled=True, area=24),
}
WEAKEST: Final = 0.3  # area of an echo without strength, as a share


def draw_echoes(
    axes: Axes, scan: Scan, colours: Mapping[str, str], legend: Legend
) -> set[str]:
    """Draw the echoes that the sensor keeps.

    One collection of markers is added for each kind and material, labelled with both.

    Returns:
        The names of the materials that the echoes came from.
    """
    echoes = scan.echoes
    points, areas = echo_points(scan, echoes), _areas(echoes)
    told = {part: target.material for part, target in echoes.targets.items()}
    met = np.array([told[part] for part in echoes.parts.tolist()], np.str_)
    for kind, shape in SHAPES.items():
        for material in sorted(set(told.values())):
            chosen = (echoes.kinds == kind) & (met == material)
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
    _tell_kinds(legend, echoes)
    return set(told.values())


def _areas(echoes: Echoes) -> Floats:
    """Give the sizes of markers, (E,) square points: stronger echoes are larger."""
    shares = WEAKEST + (1 - WEAKEST) * np.clip(echoes.strength, 0.0, 1.0)
    full = np.array([SHAPES[EventKind(kind)].area for kind in echoes.kinds.tolist()])
    return np.asarray(full * shares)


def _tell_kinds(legend: Legend, echoes: Echoes) -> None:
    kinds = set(echoes.kinds.tolist())
    if not kinds:
        return
    legend.head("Echoes (larger: stronger)")
    for kind, shape in SHAPES.items():
        if kind in kinds:
            fill = "black" if shape.filled else "none"
            legend.mark(
                shape.text,
                shape.marker,
                markeredgecolor="black",
                markerfacecolor=fill,
                markersize=5,
            )


# Section from picture.drawing.
# Pictures of scans: rays, echoes and readings over a plan of the map.

MARGIN: Final = 0.5  # m around the map
MOST_NAMES: Final = 20  # of materials that fit beside the picture
OPAQUE_WIDTH: Final = 1.4  # points


def draw_scans(scene: Scene, scans: Sequence[Scan]) -> bytes:
    """Draw scans over the section of the map at the sensor's height.

    Args:
        scene: The map.
        scans: Of one sensor; at least one.

    Returns:
        A PNG file.
    """
    canvas = FigureCanvasAgg(figure_of(scene, scans))
    data = io.BytesIO()
    canvas.print_figure(data, format="png", metadata={"Software": "radarsim"})
    return data.getvalue()


def figure_of(scene: Scene, scans: Sequence[Scan]) -> Figure:
    """Draw scans; of one alone also its rays and its echoes.

    Rays are cast anew, into the map without any robots.

    Args:
        scene: The map.
        scans: Of one sensor; at least one.
    """
    layout = ConstrainedLayoutEngine(compress=True, w_pad=0.15, h_pad=0.1)
    figure = Figure(figsize=(13, 7.6), dpi=120, layout=layout)
    axes = figure.add_subplot()
    legend = Legend()
    colours = material_colours(scene)
    materials = {part.material.name for part in scene.parts}
    _draw_plan(axes, scene, colours, scans[0].pose.z)
    _frame(axes, scene, scans)
    _draw_readings(axes, scans, legend)
    if len(scans) == 1:
        draw_rays(axes, scene, scans[0], legend)
        materials |= draw_echoes(axes, scans[0], colours, legend)
    _tell_materials(legend, [name for name in colours if name in materials], colours)
    legend.draw(figure)
    return figure


def _tell_materials(
    legend: Legend, names: Sequence[str], colours: Mapping[str, str]
) -> None:
    legend.head("Materials")
    for name in names[:MOST_NAMES]:
        legend.mark(name, "s", color=colours[name], markersize=7)
    if names[MOST_NAMES:]:
        legend.mark(f"and {len(names) - MOST_NAMES} more", "")
    legend.line("opaque, in the plan", color="black", linewidth=OPAQUE_WIDTH)


def _draw_plan(
    axes: Axes, scene: Scene, colours: Mapping[str, str], height: float
) -> None:
    """Draw what the plane of the scan cuts: opaque things black, others in colour."""
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
    alone = len(scans) == 1
    size = 3 if alone else 2
    for scan in scans:
        ends, came_back = scan_points(scan), np.isfinite(scan.ranges)
        for chosen, colour, _ in kinds_of_rays(scan):
            dots = ends[chosen & came_back]
            axes.plot(*dots.T, ".", color=colour, markersize=size, zorder=4)
    place = scans[0].pose.position()
    axes.plot(*place[:2], "o", color="black", markersize=6, zorder=2.5)
    legend.head("Rays that gave the ranges" if alone else "Ranges")
    for _, colour, name in kinds_of_rays(scans[0]):
        if alone:
            legend.line(name, color=colour, linewidth=1.2)
        else:
            legend.mark(name, ".", color=colour)
    if alone:
        legend.mark("range, along its beam", ".", color="0.35")


def _frame(axes: Axes, scene: Scene, scans: Sequence[Scan]) -> None:
    """Show the map, all readings, and circles of equal range around the sensor."""
    scan = scans[0]
    x, y = scan.pose.x, scan.pose.y
    read = [scan_points(s)[np.isfinite(s.ranges)] for s in scans]  # ghosts lie outside
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
    """Say which rays a beam has, and which of its echoes it keeps."""
    mode = settings.return_mode
    kept = "all echoes" if mode == "all" else f"{mode} echo"
    if not settings.has_side_rays:
        return kept
    answer = "together" if settings.combines_rays else "one drawn"
    if settings.side_mode == "cone":
        return f"cone of {settings.cone_rays} rays, {answer}, {kept}"
    return f"N = {settings.side_offset_uu:g} {settings.side_mode}, {answer}, {kept}"
