"""Figures 2 to 5: radar and laser in clear air and in dust, as points.

Their captions count the readings in both airs.
"""

from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb, to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch, Rectangle
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.lab.figures.figure import (
    ROBOT,
    DrawnFigure,
    ScanSpec,
    draw_small_print,
    draw_title,
    load_scene,
    object_names,
)
from radarsim.plotting import palette
from radarsim.plotting.annotations import draw_scale_bar
from radarsim.plotting.palette import MARKER, Family
from radarsim.plotting.plan import draw_plan, draw_robot
from radarsim.plotting.style import area_style, scan_points
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

Mask = NDArray[np.bool_]
NAMES: Final = {RADAR: "Radar", LASER: "Laser"}
COLOURS: Final = {RADAR: palette.RADAR, LASER: palette.LASER}
AIRS: Final = {"clear": "clear air", "dust": "heavy dust"}
Samples: TypeAlias = dict[str, Line2D]  # of a legend, by their text
READINGS: Final = "readings"  # label of their marks
_EDGE: Final = 1.0  # m around all that is shown
_BELOW: Final = 1.0  # m more below it, for the scale bar
_OF_OBJECT: Final[Any] = {"marker": "o", "markersize": 3.2, "markeredgewidth": 0}
_OF_DUST: Final[Any] = {"marker": "x", "markersize": 5, "markeredgewidth": 1.0}
_SAMPLE: Final = 6.0  # points, of marks in the legend
_OUTLINE: Final = 1.1  # points, around pale objects


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
        all_objects=len({part.object_name for part in trial_parts()}),
    )


def trial_parts() -> list[Part]:
    """Return the parts that stand on the ground."""
    return [part for part in load_scene(MAP).parts if part.object_name != "ground"]


def dust_extent() -> Floats:
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
    return np.asarray(shapely.intersects(lines, shapely.box(*dust_extent().ravel())))


def draw_readings(seed: int, *, sensor: str, air: str) -> DrawnFigure:
    """Draw one of figures 2 to 5."""
    shot = scan_spec_for(sensor, air, seed)
    counts = count_readings(sensor, air, seed)
    drawing = Figure(figsize=(9.6, 9.9), dpi=110)
    axes = drawing.add_axes((0.01, 0.07, 0.98, 0.86))
    samples = _draw_panel(axes, shot)
    draw_title(drawing, f"{NAMES[sensor]} in {AIRS[air]}: {_verdict(counts)}")
    _draw_small_print(drawing, f"{COUNT} scans by {sensor} in {shot.map}", samples)
    who = f"{NAMES[sensor]} readings of the trial scene in {AIRS[air]}, {COUNT} scans."
    return DrawnFigure(
        (drawing,),
        f"{who} {_conclusion(counts, dusty=air != 'clear')}",
        (shot.command,),
        _details(shot, counts, dusty=air != "clear"),
    )


def draw_all_readings(seed: int) -> DrawnFigure:
    """Draw figures 2 to 5 as one panel of two rows and two columns."""
    drawing = Figure(figsize=(12.4, 12.6), dpi=110)
    samples: Samples = {}
    commands, details = [], []
    for row, sensor in enumerate(NAMES):
        for column, air in enumerate(AIRS):
            place = (0.005 + 0.5 * column, 0.5 - 0.455 * row, 0.49, 0.415)
            axes = drawing.add_axes(place)
            shot = scan_spec_for(sensor, air, seed)
            counts = count_readings(sensor, air, seed)
            samples |= _draw_panel(axes, shot)
            title = f"{NAMES[sensor]}, {AIRS[air]}: {_verdict(counts)}"
            axes.set_title(title, fontsize=13, loc="left", fontweight="bold")
            commands.append(shot.command)
            told = _details(shot, counts, dusty=air != "clear")
            details.append(f"{NAMES[sensor]}, {AIRS[air]}: {told}")
    dusty = [count_readings(sensor, "dust", seed) for sensor in (RADAR, LASER)]
    read, missed = (counts.objects for counts in dusty)
    everything = f"{read} of {dusty[0].all_objects} objects"
    draw_title(drawing, f"In dust the radar reads {everything}, the laser {missed}")
    _draw_small_print(drawing, f"{COUNT} scans each, in {MAP}", samples)
    return DrawnFigure(
        (drawing,),
        "Radar (above) and laser (below) read the trial scene in clear air (left) and"
        " through heavy dust (right). The radar reads the same in both; the laser reads"
        " the near edge of the dust and misses what is behind it.",
        tuple(commands),
        "\n".join(details),
    )


def _verdict(counts: Counts) -> str:
    return f"{counts.objects} of {counts.all_objects} objects read"


def _conclusion(counts: Counts, *, dusty: bool) -> str:
    if not dusty:
        return "Every object is read; where nothing stands, nothing comes back."
    if counts.unchanged > 0.9 * counts.crossing:
        return "The dust does not trouble it."
    return "It sees the dust instead of what is behind."


def _details(shot: ScanSpec, counts: Counts, *, dusty: bool) -> str:
    step = shot.scanner.settings.resolution_deg
    taken = f"{COUNT} scans by {WHO[shot.sensor]}, a beam every {step:g}°."
    if not dusty:
        noise = shot.scanner.settings.range_noise
        return (
            f"{taken} {counts.objects} of {counts.all_objects} objects are"
            f" read, in {counts.clear} readings."
        ) + (f" Range noise of {noise:g} m draws the spots out." if noise else "")
    low, high = dust_extent()
    return (
        f"The dust is {high[0] - low[0]:g} m deep. {taken} Of the {counts.crossing}"
        f" readings of objects whose beams the dust crosses, {counts.unchanged} are the"
        f" same as in clear air to within {CELL:g} m, and {counts.cloud} readings"
        f" are of the dust itself. Beside it, {counts.beside} of"
        f" {counts.clear - counts.crossing} are the same."
    )


def _draw_panel(axes: Axes, shot: ScanSpec) -> Samples:
    """Draw dust, pale objects, robot and readings; return samples by their text."""
    draw_plan(axes, load_scene(MAP), shot.pose.z)
    _pale_objects(axes)
    draw_robot(axes, ROBOT, shot.robot)
    samples: Samples = {}
    if shot.map != MAP:
        _draw_dust(axes)
        samples |= _draw_missed(axes, shot)
    of_objects, of_dust = _readings(shot.take())
    who, colour = f"{NAMES[shot.sensor].lower()} reading", COLOURS[shot.sensor]
    text = f"{who} of an object"
    samples = {text: _mark(axes, of_objects, colour, _OF_OBJECT)} | samples
    if len(of_dust):
        sample = _mark(axes, of_dust, colour, _OF_DUST)
        samples = {f"{who} of the dust": sample} | samples
    _frame(axes, shot)
    return samples


def _mark(axes: Axes, points: Floats, colour: str, style: dict[str, Any]) -> Line2D:
    """Mark readings, (N, 2) m, over the objects; return a sample."""
    axes.plot(
        *points.T, linestyle="none", color=colour, zorder=3.5, label=READINGS, **style
    )
    sample = style | {"markersize": _SAMPLE}
    return Line2D([], [], linestyle="none", color=colour, **sample)


def _pale_objects(axes: Axes) -> None:
    """Make the objects of a plan pale and outlined, so that readings show on them."""
    for patch in axes.patches:
        if isinstance(patch, PathPatch):
            red, green, blue, opacity = to_rgba(patch.get_facecolor())
            colour = to_hex((red, green, blue))
            patch.set_edgecolor(colour)
            patch.set_facecolor((*to_rgb(palette.paler(colour)), opacity))
            patch.set_linewidth(_OUTLINE)


def _draw_dust(axes: Axes) -> None:
    low, high = dust_extent()
    wide, tall = high - low
    style = area_style(Family.SMOKE)
    axes.add_patch(Rectangle(low, wide, tall, zorder=0.5, **style))
    x, y = ((low + high) / 2).tolist()
    axes.text(x, y, "dust", ha="center", va="center", fontsize="large")


def _draw_missed(axes: Axes, shot: ScanSpec) -> Samples:
    """Draw rings around the readings of clear air that dust changes."""
    missed = _missed(shot)
    if not len(missed):
        return {}
    style: dict[str, Any] = {
        "markerfacecolor": "none",
        "markeredgecolor": MARKER,
        "markersize": 9,
    }
    axes.plot(*missed.T, "o", linestyle="none", zorder=3, **style)
    sample = Line2D([], [], marker="o", linestyle="none", **style)
    return {"read in clear air, missed in dust": sample}


def _readings(scans: list[Scan]) -> tuple[Floats, Floats]:
    """Return the readings of objects and those of the dust, (N, 2) m each."""
    points = np.concatenate([scan_points(scan) for scan in scans])
    names = np.concatenate([object_names(scan) for scan in scans])
    of_dust = names == SMOKE_CELL
    return points[(names != "") & ~of_dust], points[of_dust]


def _missed(shot: ScanSpec) -> Floats:
    """Return the readings of a scan in clear air that dust changes, (N, 2) m."""
    (clear, *_), (dusty, *_) = (
        scan_spec_for(shot.sensor, "clear", shot.seed).take(),
        shot.take(),
    )
    with np.errstate(invalid="ignore"):  # inf - inf, of beams that are left out
        same = np.abs(clear.ranges - dusty.ranges) <= CELL
    return scan_points(clear)[np.isfinite(clear.ranges) & ~same]


def _frame(axes: Axes, shot: ScanSpec) -> None:
    """Set the limits, the same for all panels."""
    corners = [part.vertices[:, :2] for part in trial_parts()]
    ends = np.concatenate([*corners, dust_extent(), [shot.pose.position()[:2]]])
    low, high = ends.min(axis=0) - _EDGE, ends.max(axis=0) + _EDGE
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1] - _BELOW, high[1])
    axes.set_axis_off()
    draw_scale_bar(axes)


def _draw_small_print(drawing: Figure, text: str, samples: Samples) -> None:
    """Write a text below the title, and the legend at the bottom."""
    draw_small_print(drawing, text)
    drawing.legend(
        list(samples.values()),
        list(samples),
        loc="lower center",
        ncols=len(samples),
        fontsize=11,
        frameon=False,
    )
