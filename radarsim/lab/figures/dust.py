"""Figures 2 to 5: radar and laser in clear air and in dust, as points.

Their captions count the readings in both airs.
"""

from dataclasses import dataclass
from typing import Any, Final

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
    draw_legend,
    draw_title,
    load_scene,
    object_names,
)
from radarsim.plotting import palette
from radarsim.plotting.palette import MARKER, Family
from radarsim.plotting.plan import draw_plan, draw_robot
from radarsim.plotting.style import (
    area_style,
    draw_scale_bar,
    scan_points,
)
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

NAMES: Final = {RADAR: "Radar", LASER: "Laser"}
COLOURS: Final = {RADAR: palette.RADAR, LASER: palette.LASER}
AIRS: Final = {"clear": "clear air", "dust": "heavy dust"}
READINGS: Final = "readings"  # label of their marks
_EDGE: Final = 1.0  # m around all that is shown
_BELOW: Final = 1.0  # m more below it, for the scale bar
_OF_OBJECT: Final[Any] = {"marker": "o", "markersize": 3.2, "markeredgewidth": 0}
_OF_DUST: Final[Any] = {"marker": "x", "markersize": 5, "markeredgewidth": 1.0}
_RING: Final[Any] = {
    "marker": "o",
    "markerfacecolor": "none",
    "markeredgecolor": MARKER,
    "markersize": 9,
}
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
    cloud = shapely.box(*dust_extent().ravel())
    crossing = []
    for scan in clear:
        ends = scan_points(scan)
        starts = np.broadcast_to(scan.pose.position()[:2], ends.shape)
        # From what is read in clear air: in dust a reading may end before it has
        # crossed.
        lines = shapely.linestrings(np.stack([starts, ends], axis=1))
        crossing.append(shapely.intersects(lines, cloud))
    across = np.array(crossing) & found
    same = found & np.array(list(map(_are_same, clear, scans)))
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


def _are_same(one: Scan, other: Scan) -> NDArray[np.bool_]:
    """Return which readings of two scans are the same, (N,)."""
    with np.errstate(invalid="ignore"):  # inf - inf: a beam without return is not
        return np.abs(one.ranges - other.ranges) <= CELL


def draw_readings(seed: int, *, sensor: str, air: str) -> DrawnFigure:
    """Draw one of figures 2 to 5."""
    shot = scan_spec_for(sensor, air, seed)
    counts = count_readings(sensor, air, seed)
    drawing = Figure(figsize=(9.6, 9.9), dpi=110)
    samples = _draw_panel(drawing.add_axes((0.01, 0.07, 0.98, 0.86)), shot)
    draw_title(
        drawing,
        f"{NAMES[sensor]} in {AIRS[air]}: {_verdict(counts)}",
        f"{COUNT} scans by {sensor} in {shot.map}",
    )
    draw_legend(drawing, samples, 11)
    if air == "clear":
        found = "Every object is read; where nothing stands, nothing comes back."
    elif counts.unchanged > 0.9 * counts.crossing:
        found = "The dust does not trouble it."
    else:
        found = "It reads the dust instead of nearly all that is behind it."
    return DrawnFigure(
        drawing,
        f"{NAMES[sensor]} readings of the trial scene in {AIRS[air]}, {COUNT} scans."
        f" {found}",
        (shot.command,),
        _details(shot, counts),
    )


def draw_all_readings(seed: int) -> DrawnFigure:
    """Draw figures 2 to 5 as one panel of two rows and two columns."""
    drawing = Figure(figsize=(12.4, 12.6), dpi=110)
    samples: dict[str, Line2D] = {}
    commands, details, read = [], [], []
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
            details.append(f"{NAMES[sensor]}, {AIRS[air]}: {_details(shot, counts)}")
        read.append(counts.objects)  # in dust, the last air
    everything = f"{read[0]} of {counts.all_objects} objects"
    draw_title(
        drawing,
        f"In dust the radar reads {everything}, the laser {read[1]}",
        f"{COUNT} scans each, in {MAP}",
    )
    draw_legend(drawing, samples, 11)
    return DrawnFigure(
        drawing,
        "Radar (above) and laser (below) read the trial scene in clear air (left) and"
        " through heavy dust (right). The radar reads the same in both; the laser reads"
        " the dust itself and misses nearly all that is behind it.",
        tuple(commands),
        "\n".join(details),
    )


def _verdict(counts: Counts) -> str:
    return f"{counts.objects} of {counts.all_objects} objects read"


def _details(shot: ScanSpec, counts: Counts) -> str:
    settings = shot.scanner.settings
    step, noise = settings.resolution_deg, settings.range_noise
    taken = f"{COUNT} scans by {WHO[shot.sensor]}, a beam every {step:g}°."
    if shot.map == MAP:
        return (
            f"{taken} {counts.objects} of {counts.all_objects} objects are"
            f" read, in {counts.clear} readings."
        ) + (f" Range noise of {noise:g} m draws the spots out." if noise else "")
    low, high = dust_extent()
    return (
        f"The dust is {high[0] - low[0]:g} m deep. {taken} Of readings of objects whose"
        f" beams the dust crosses, {counts.unchanged} of {counts.crossing} are the same"
        f" as in clear air to within {CELL:g} m, and {counts.cloud} readings are of the"
        f" dust itself. Beside it, {counts.beside} of"
        f" {counts.clear - counts.crossing} are the same."
    )


def _draw_panel(axes: Axes, shot: ScanSpec) -> dict[str, Line2D]:
    """Draw dust, pale objects, robot and readings; return samples by their text."""
    draw_plan(axes, load_scene(MAP), shot.pose.z)
    # Objects are pale and outlined, so that readings show on them.
    for patch in axes.patches:
        if isinstance(patch, PathPatch):
            red, green, blue, opacity = to_rgba(patch.get_facecolor())
            colour = to_hex((red, green, blue))
            patch.set_edgecolor(colour)
            patch.set_facecolor((*to_rgb(palette.paler(colour)), opacity))
            patch.set_linewidth(_OUTLINE)
    draw_robot(axes, ROBOT, shot.robot)
    scans = shot.take()
    samples: dict[str, Line2D] = {}
    if shot.map != MAP:
        low, high = dust_extent()
        wide, tall = high - low
        style = area_style(Family.SMOKE)
        axes.add_patch(Rectangle(low, wide, tall, zorder=0.5, **style))
        x, y = ((low + high) / 2).tolist()
        axes.text(x, y, "dust", ha="center", va="center", fontsize="large")
        # Rings around the readings of a scan in clear air that no scan in dust has.
        (clear, *_) = scan_spec_for(shot.sensor, "clear", shot.seed).take()
        kept = np.any([_are_same(clear, scan) for scan in scans], axis=0)
        changed = np.isfinite(clear.ranges) & ~kept
        if changed.any():
            missed = scan_points(clear)[changed]
            axes.plot(*missed.T, linestyle="none", zorder=3, **_RING)
            sample = Line2D([], [], linestyle="none", **_RING)
            samples["read in clear air, missed in dust"] = sample
    points = np.concatenate([scan_points(scan) for scan in scans])
    names = np.concatenate([object_names(scan) for scan in scans])
    of_dust = names == SMOKE_CELL
    who, colour = f"{NAMES[shot.sensor].lower()} reading", COLOURS[shot.sensor]
    for text, chosen, style in (
        (f"{who} of an object", (names != "") & ~of_dust, _OF_OBJECT),
        (f"{who} of the dust", of_dust, _OF_DUST),
    ):
        if not chosen.any():
            continue
        look = {"linestyle": "none", "color": colour, **style}
        axes.plot(*points[chosen].T, zorder=3.5, label=READINGS, **look)
        # the last is the first in the legend
        samples = {text: Line2D([], [], **look | {"markersize": _SAMPLE})} | samples
    # The limits are the same for all panels.
    corners = [part.vertices[:, :2] for part in trial_parts()]
    everything = np.concatenate([*corners, dust_extent(), [shot.pose.position()[:2]]])
    low, high = everything.min(axis=0) - _EDGE, everything.max(axis=0) + _EDGE
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1] - _BELOW, high[1])
    axes.set_axis_off()
    draw_scale_bar(axes)
    return samples
