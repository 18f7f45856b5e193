"""Figures 2 to 5: radar and laser in clear air and in dust, as points."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from radarsim.figures.figure import DrawnFigure
from radarsim.figures.scan_spec import ROBOT, ScanSpec, load_scene, object_names
from radarsim.figures.scene_view import draw_robot
from radarsim.geometry import Floats
from radarsim.plotting.style import Legend, scan_points
from radarsim.robots.obstacles import slice_parts
from radarsim.scene.scene import Part
from radarsim.sensors.scan import Scan

MAP: Final = "marulan_trial"
RADAR: Final = "hss94_marulan"
LASER: Final = "physical"
WHO: Final = {
    RADAR: "the 94 GHz radar of the Marulan data sets",
    LASER: "a laser that loses light in dust",
}
SMOKE_CELL: Final = "cloud"  # the name of the dust in the map
COUNT: Final = 10  # scans
CELL: Final = 0.2  # m; readings that differ by no more are the same
THING_COLOUR: Final = "#1f4e9c"
CLOUD_COLOUR: Final = "#d95f02"
_DUST: Final = "#f6ead2"
_EDGE: Final = 1.5  # m around all that is shown
_SIZE: Final = (9.6, 7.0)  # inches
_PLACE: Final = (0.07, 0.08, 0.68, 0.9)  # of the map, the same in all four figures

Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Counts:
    """Readings in dust compared with those in clear air.

    Attributes:
        clear: Number of readings in clear air.
        crossing: Number of the readings in clear air whose beam crosses the dust.
        unchanged: Number of ``crossing`` that are the same in dust.
        beside: Number of the others that are the same in dust.
        cloud: Number of readings of the dust itself.
        objects: Number of objects that are read in dust.
        all_objects: Number of objects in the map.
    """

    clear: int
    crossing: int
    unchanged: int
    beside: int
    cloud: int
    objects: int
    all_objects: int


def scan_spec_for(sensor: str, air: str, seed: int) -> ScanSpec:
    """Return the scans of a figure; ``air`` is ``clear`` or ``dust``."""
    return ScanSpec(
        MAP if air == "clear" else f"{MAP}@{air}", sensor, seed, count=COUNT
    )


def count_readings(sensor: str, air: str, seed: int) -> Counts:
    """Compare scans in some air with those in clear air."""
    clear = scan_spec_for(sensor, "clear", seed).take()
    scans = scan_spec_for(sensor, air, seed).take()
    found = np.array([np.isfinite(scan.ranges) for scan in clear])
    across = np.array([_crosses(scan) for scan in clear]) & found
    with np.errstate(invalid="ignore"):  # inf - inf, of beams that are left out
        pairs = zip(clear, scans, strict=True)
        moved = np.array([np.abs(one.ranges - two.ranges) for one, two in pairs])
    same = found & (moved <= CELL)
    answers = [object_names(scan) for scan in scans]
    names = {name for each in answers for name in each.tolist()} - {"", SMOKE_CELL}
    return Counts(
        clear=int(found.sum()),
        crossing=int(across.sum()),
        unchanged=int((same & across).sum()),
        beside=int((same & ~across).sum()),
        cloud=sum(int((each == SMOKE_CELL).sum()) for each in answers),
        objects=len(names),
        all_objects=len({part.object_name for part in _parts_of_trial()}),
    )


def draw_readings(seed: int, *, sensor: str, air: str) -> DrawnFigure:
    """Draw one of figures 2 to 5."""
    shot = scan_spec_for(sensor, air, seed)
    scans = shot.take()
    drawing = Figure(figsize=_SIZE, dpi=110)
    axes = drawing.add_axes(_PLACE)
    legend = Legend()
    legend.add_heading(f"{COUNT} scans by {sensor}")
    _draw_map(axes, shot, legend, dusty=air != "clear")
    if air != "clear":
        _draw_rings(axes, scan_spec_for(sensor, "clear", seed).take(), legend)
    _draw_dots(axes, scans, legend)
    legend.draw(drawing)
    counts = count_readings(sensor, air, seed)
    caption = _caption(shot, counts, dusty=air != "clear")
    return DrawnFigure((drawing,), caption, (shot.command,))


def _caption(shot: ScanSpec, counts: Counts, *, dusty: bool) -> str:
    step = shot.scanner.settings.resolution_deg
    taken = f"{COUNT} scans by {WHO[shot.sensor]}, a beam every {step:g}°."
    if not dusty:
        noise = shot.scanner.settings.range_noise
        return (
            f"Clear air. {taken} {counts.objects} of {counts.all_objects} things are"
            f" read, in {counts.clear} readings; where nothing stands, nothing comes"
            " back."
        ) + (f" Range noise of {noise:g} m draws the spots out." if noise else "")
    low, high = _cloud()
    verdict = (
        "The dust does not trouble it."
        if counts.unchanged > 0.9 * counts.crossing
        else "It sees the dust instead of what is behind."
    )
    return (
        f"Heavy dust, {high[0] - low[0]:g} m deep. {taken} Of the {counts.crossing}"
        f" readings of things whose beams the dust crosses, {counts.unchanged} are the"
        " same"
        f" as in clear air (rings) to within {CELL:g} m, and {counts.cloud} readings"
        f" are of the dust itself. Beside it, {counts.beside} of"
        f" {counts.clear - counts.crossing} are the same. {verdict}"
    )


def _parts_of_trial() -> list[Part]:
    return [part for part in load_scene(MAP).parts if part.object_name != "ground"]


def _cloud() -> Floats:
    """Return the lower and upper x, y of the dust, (2, 2) m."""
    parts = load_scene(f"{MAP}@dust").parts
    (cloud,) = (part for part in parts if part.object_name == SMOKE_CELL)
    corners = cloud.vertices[:, :2]
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def _crosses(scan: Scan) -> Mask:
    """Return a mask (N,) of the readings whose beams cross the dust."""
    ends = scan_points(scan)
    starts = np.broadcast_to(scan.pose.position()[:2], ends.shape)
    lines = shapely.linestrings(np.stack([starts, ends], axis=1))
    return np.asarray(shapely.intersects(lines, shapely.box(*_cloud().ravel())))


def _draw_map(axes: Axes, shot: ScanSpec, legend: Legend, *, dusty: bool) -> None:
    """Draw the objects, the robot and the dust."""
    if dusty:
        low, high = _cloud()
        wide, tall = high - low
        axes.add_patch(Rectangle(low, wide, tall, color=_DUST, zorder=0))
        legend.add_marker("dust", "s", color=_DUST, markersize=9)
    lines = slice_parts(_parts_of_trial(), shot.pose.z)
    plan = LineCollection(list(lines), colors="0.6", linewidths=0.8, zorder=1)
    axes.add_collection(plan)
    legend.add_line("what stands there", color="0.6", linewidth=0.8)
    draw_robot(axes, ROBOT, shot.robot)
    ends = np.concatenate([lines.reshape(-1, 2), _cloud(), [shot.pose.position()[:2]]])
    low, high = ends.min(axis=0) - _EDGE, ends.max(axis=0) + _EDGE
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")


def _draw_rings(axes: Axes, scans: list[Scan], legend: Legend) -> None:
    """Draw the readings of the first scan in clear air."""
    ends = scan_points(scans[0])[np.isfinite(scans[0].ranges)]
    style: dict[str, Any] = {
        "color": "0.35",
        "markerfacecolor": "none",
        "markeredgewidth": 0.6,
    }
    axes.plot(*ends.T, "o", markersize=8, linestyle="none", zorder=2, **style)
    legend.add_marker("read in clear air", "o", markersize=8, **style)


def _draw_dots(axes: Axes, scans: list[Scan], legend: Legend) -> None:
    points = np.concatenate([scan_points(scan) for scan in scans])
    names = np.concatenate([object_names(scan) for scan in scans])
    of_cloud = names == SMOKE_CELL
    for chosen, colour, text in (
        ((names != "") & ~of_cloud, THING_COLOUR, "reading of a thing"),
        (of_cloud, CLOUD_COLOUR, "reading of the dust"),
    ):
        if chosen.any():
            axes.plot(*points[chosen].T, ".", color=colour, markersize=4, zorder=4)
            legend.add_marker(text, ".", color=colour, markersize=7)
