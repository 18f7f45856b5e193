"""Figures 2 to 5: radar and laser in clear air and in dust, as points."""

from typing import Any, Final, NamedTuple

import numpy as np
import shapely
from common import (
    ROBOT,
    STEP,
    TRIAL,
    Drawn,
    draw_legend,
    draw_title,
    load_scene,
    object_names,
    robot_pose,
    sensor_pose,
    take_scans,
)
from matplotlib.axes import Axes
from matplotlib.colors import to_hex, to_rgb, to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch, Rectangle
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.plotting import palette
from radarsim.plotting.plan import draw_plan, draw_robot
from radarsim.plotting.style import area_style, draw_scale_bar, scan_points
from radarsim.scene.scene import Part
from radarsim.sensors.scan import Scan

RADAR, LASER = "hss94_marulan", "physical"  # presets; the laser loses light in dust
CLOUD: Final = "cloud"  # name of the dust in the map
COUNT: Final = 10  # scans
NAMES: Final = {RADAR: "Radar", LASER: "Laser"}
COLOURS: Final = {RADAR: palette.RADAR, LASER: palette.LASER}
MAPS: Final = {"clear": TRIAL, "dust": f"{TRIAL}@dust"}
AIRS: Final = {"clear": "clear air", "dust": "heavy dust"}
FIGURES: Final = ((RADAR, "clear"), (RADAR, "dust"), (LASER, "clear"), (LASER, "dust"))
RING: Final[Any] = {
    "marker": "o",
    "markerfacecolor": "none",
    "markeredgecolor": palette.MARKER,
    "markersize": 9,
}


class Counts(NamedTuple):
    """Number of readings in some air compared with those in clear air."""

    clear: int  # readings in clear air
    crossing: int  # those of them whose beam crosses the dust
    unchanged: int  # those of ``crossing`` that are the same in this air
    unchanged_clear: int  # those of the others that are the same
    cloud: int  # readings of the dust itself
    objects: int  # objects that are read


def scans_in(sensor: str, air: str) -> list[Scan]:
    """Scan the trial scene in clear air or in dust."""
    return take_scans(MAPS[air], sensor, COUNT)


def trial_parts() -> list[Part]:
    """Return the parts that stand on the ground."""
    return [part for part in load_scene(TRIAL).parts if part.object_name != "ground"]


def names_of_objects() -> set[str]:
    """Return the names of what stands on the ground."""
    return {part.object_name for part in trial_parts()}


def dust_extent() -> Floats:
    """Return the lower and upper x, y of the dust, (2, 2) m."""
    parts = load_scene(MAPS["dust"]).parts
    (cloud,) = (part for part in parts if part.object_name == CLOUD)
    corners = cloud.vertices[:, :2]
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def are_same(one: Scan, other: Scan) -> NDArray[np.bool_]:
    """Return which readings of two scans are the same, (N,)."""
    with np.errstate(invalid="ignore"):  # inf - inf: a beam without return is not
        return np.abs(one.ranges - other.ranges) <= STEP


def count_readings(sensor: str, air: str) -> Counts:
    """Compare scans in some air with those in clear air."""
    clear, scans = scans_in(sensor, "clear"), scans_in(sensor, air)
    found = np.array([np.isfinite(scan.ranges) for scan in clear])
    cloud = shapely.box(*dust_extent().ravel())
    crossing = []
    for scan in clear:
        ends = scan_points(scan)
        starts = np.broadcast_to(scan.pose.position()[:2], ends.shape)
        # In dust a reading may end before it has crossed.
        lines = shapely.linestrings(np.stack([starts, ends], axis=1))
        crossing.append(shapely.intersects(lines, cloud))
    across = np.array(crossing) & found
    same = found & np.array(list(map(are_same, clear, scans)))
    names = np.concatenate([object_names(scan) for scan in scans])
    return Counts(
        clear=int(found.sum()),
        crossing=int(across.sum()),
        unchanged=int((same & across).sum()),
        unchanged_clear=int((same & ~across).sum()),
        cloud=int((names == CLOUD).sum()),
        objects=len(set(names.tolist()) - {"", CLOUD}),
    )


def draw_panel(axes: Axes, sensor: str, air: str) -> dict[str, Line2D]:
    """Draw dust, pale objects, robot and readings; return samples by their text."""
    scene, scans = load_scene(TRIAL), scans_in(sensor, air)
    draw_plan(axes, scene, sensor_pose(scene).z)
    # Objects are pale and outlined, so that readings show on them.
    for patch in axes.patches:
        if isinstance(patch, PathPatch):
            red, green, blue, opacity = to_rgba(patch.get_facecolor())
            colour = to_hex((red, green, blue))
            patch.set_edgecolor(colour)
            patch.set_facecolor((*to_rgb(palette.paler(colour)), opacity))
            patch.set_linewidth(1.1)
    draw_robot(axes, ROBOT, robot_pose(scene))
    samples: dict[str, Line2D] = {}
    if air == "dust":
        samples = draw_dust(axes, sensor, scans)
    points = np.concatenate([scan_points(scan) for scan in scans])
    names = np.concatenate([object_names(scan) for scan in scans])
    objects: Any = {"marker": "o", "markersize": 3.2, "markeredgewidth": 0}
    cross: Any = {"marker": "x", "markersize": 5, "markeredgewidth": 1.0}
    for text, chosen, style in (
        ("reading of an object", (names != "") & (names != CLOUD), objects),
        ("reading of the dust", names == CLOUD, cross),
    ):
        if chosen.any():
            look = {"linestyle": "none", "color": COLOURS[sensor], **style}
            axes.plot(*points[chosen].T, zorder=3.5, label=text, **look)
            sample = Line2D([], [], **look | {"markersize": 6})
            samples = {f"{NAMES[sensor].lower()} {text}": sample} | samples
    corners = [part.vertices[:, :2] for part in trial_parts()]
    start = sensor_pose(scene).position()[:2]
    everything = np.concatenate([*corners, dust_extent(), [start]])
    (west, south), (east, north) = everything.min(axis=0), everything.max(axis=0)
    axes.set_xlim(west - 1, east + 1)
    axes.set_ylim(south - 2, north + 1)
    axes.set_axis_off()
    draw_scale_bar(axes)
    return samples


def draw_dust(axes: Axes, sensor: str, scans: list[Scan]) -> dict[str, Line2D]:
    """Draw the dust, and rings around readings in clear air that no scan in it has."""
    low, high = dust_extent()
    style = area_style(palette.Family.SMOKE)
    axes.add_patch(Rectangle(low, *(high - low), zorder=0.5, **style))
    x, y = ((low + high) / 2).tolist()
    axes.text(x, y, "dust", ha="center", va="center", fontsize="large")
    clear = scans_in(sensor, "clear")[0]
    kept = np.any([are_same(clear, scan) for scan in scans], axis=0)
    changed = np.isfinite(clear.ranges) & ~kept
    if not changed.any():
        return {}
    axes.plot(*scan_points(clear)[changed].T, linestyle="none", zorder=3, **RING)
    sample = Line2D([], [], linestyle="none", **RING)
    return {"read in clear air, missed in dust": sample}


def describe(sensor: str, air: str) -> tuple[str, str]:
    """Return how many objects are read, and a caption with all counts."""
    counts, everything = count_readings(sensor, air), len(names_of_objects())
    verdict = f"{counts.objects} of {everything} objects read"
    caption = f"{NAMES[sensor]} ({sensor}) in {AIRS[air]}, {COUNT} scans: {verdict}."
    if air == "dust":
        caption += (
            f" Of the {counts.crossing} readings of objects whose beams the dust"
            f" crosses, {counts.unchanged} are the same as in clear air, and"
            f" {counts.cloud} readings are of the dust itself."
        )
    return verdict, caption


def draw() -> Drawn:
    """Draw figures 2 to 5, each alone and all as one panel."""
    panel, drawn = Figure(figsize=(12.4, 12.6), dpi=110), Drawn()
    panel_samples: dict[str, Line2D] = {}
    for number, (sensor, air) in enumerate(FIGURES):
        verdict, caption = describe(sensor, air)
        figure = Figure(figsize=(9.6, 9.9), dpi=110)
        samples = draw_panel(figure.add_axes((0.01, 0.07, 0.98, 0.86)), sensor, air)
        title = f"{NAMES[sensor]} in {AIRS[air]}: {verdict}"
        draw_title(figure, title, f"{COUNT} scans by {sensor} in {MAPS[air]}")
        draw_legend(figure, samples, 11)
        drawn[f"figure_{2 + number:02}.png"] = figure, caption
        row, column = divmod(number, 2)
        axes = panel.add_axes((0.005 + 0.5 * column, 0.5 - 0.455 * row, 0.49, 0.415))
        panel_samples |= draw_panel(axes, sensor, air)
        title = f"{NAMES[sensor]}, {AIRS[air]}: {verdict}"
        axes.set_title(title, fontsize=13, loc="left", fontweight="bold")
    radar, laser = (count_readings(sensor, "dust").objects for sensor in NAMES)
    everything = f"{radar} of {len(names_of_objects())} objects"
    title = f"In dust the radar reads {everything}, the laser {laser}"
    draw_title(panel, title, f"{COUNT} scans each, in {TRIAL}")
    draw_legend(panel, panel_samples, 11)
    caption = "Figures 2 to 5 side by side: the radar reads the same in both airs."
    drawn["figures_02_to_05.png"] = panel, caption
    return drawn
