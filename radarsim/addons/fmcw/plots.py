"""Draws spectra: from above, by azimuth and range, or the A-scope of one azimuth.

The outlines of the map at the height of the sensor are drawn over them, if known.
"""

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.plotting.palette import INK, RADAR, RADARS, TRUTH
from radarsim.robots.obstacles import slice_mesh

if TYPE_CHECKING:
    from radarsim.addons.fmcw.detection import Detections
    from radarsim.addons.fmcw.spectrum import Spectrum
    from radarsim.scene.scene import Scene

SIZES: Final = {"cartesian": (9.2, 8.0), "polar": (11.0, 5.2), "ascope": (10.0, 4.2)}
PIXELS: Final = 1000  # width and height of the picture from above
DARKEST: Final = 10  # range of the grey scale below the median of the noise, dB
BRIGHTEST: Final = 50  # range of the grey scale above the median of the noise, dB
VISIBLE: Final = 3.0  # least level above the noise of visible echoes, dB
LEAST_LOUD: Final = 2  # least number of azimuths with visible echoes at a range
MARGIN: Final = 1.1  # ratio of the range of a picture to the longest range of echoes
SHORTEST_REACH: Final = 5.0  # m, least range that is shown
PIECE: Final = 0.1  # m, longest piece of an outline; it looks straight in every view
_DECIBELS: Final = "power over the median of the noise, dB"
_MARK: Final[dict[str, Any]] = {
    "marker": "o",
    "linestyle": "none",
    "markerfacecolor": "none",
    "color": RADARS[2],  # visible on black
}
_GREY: Final[dict[str, Any]] = {
    "cmap": "gray",
    "vmin": -DARKEST,
    "vmax": BRIGHTEST,
    "interpolation": "antialiased",
}


def plot_spectrum(
    spectrum: "Spectrum",
    ax: Axes | None = None,
    *,
    view: str = "cartesian",
    azimuth: int = 0,
    reach: float | None = None,
    detections: "Detections | None" = None,
    scene: "Scene | None" = None,
) -> Axes:
    """Draw the spectrum of a revolution.

    Args:
        spectrum: The revolution.
        ax: Axes of matplotlib; None for a new figure.
        view: ``cartesian``, as seen from above with straight ahead up; ``polar``, with
            a row for each azimuth; or ``ascope``, power over range.
        azimuth: Index of the azimuth of an A-scope.
        reach: Longest range that is shown, m; None to show all echoes above the noise.
        detections: Targets to mark.
        scene: The map, whose outlines are drawn.

    Raises:
        ValueError: If there is no such view or azimuth.
    """
    if view not in SIZES:
        raise ValueError(f"view {view!r}, expected one of {tuple(SIZES)}")
    last = len(spectrum.angles) - 1
    if not 0 <= azimuth <= last:
        raise ValueError(f"azimuth {azimuth}, expected 0 to {last}")
    if ax is None:
        ax = Figure(figsize=SIZES[view], layout="constrained").add_subplot()
    reach = min(reach or echo_reach(spectrum), float(spectrum.ranges[-1]))
    title = f"x {spectrum.pose.x:.1f} m, y {spectrum.pose.y:.1f} m"
    pieces = None if scene is None else outline_pieces(spectrum, scene)
    if view == "ascope":
        angle = float(spectrum.angles[azimuth])
        _draw_ascope(ax, spectrum, azimuth, reach, detections)
        if pieces is not None:
            _mark_surfaces(ax, pieces, angle, reach)
        ax.legend(loc="upper right", fontsize="small")
        title = f"azimuth {azimuth}, {math.degrees(-angle):.1f}° clockwise, {title}"
    elif view == "polar":
        _draw_polar(ax, spectrum, reach, detections)
        if pieces is not None:
            _draw_outlines(ax, _polar_lines(pieces))
    else:
        _draw_cartesian(ax, spectrum, reach, detections)
        if pieces is not None:
            seen = pieces[np.hypot(*pieces.T).max(axis=0) < reach]
            _draw_outlines(ax, seen @ [[0, 1], [-1, 0]])
    # The title is on the left, since the legend of outlines is on the right.
    ax.set_title(f"{spectrum.sensor}, {title}", fontsize="medium", loc="left")
    return ax


def echo_reach(spectrum: "Spectrum") -> float:
    """Return the longest range, m, at which echoes exceed the noise, plus a margin."""
    # Echoes without noise are used, since random peaks of noise would extend the range.
    noise = spectrum.noise_floor * np.float32(10 ** (VISIBLE / 10))
    loud = (spectrum.echo_power > noise).sum(axis=0) >= LEAST_LOUD
    last = np.flatnonzero(loud).max(initial=0)
    return max(MARGIN * float(spectrum.ranges[last]), SHORTEST_REACH)


def _grey(spectrum: "Spectrum") -> NDArray[np.float32]:
    """Return the power of each bin relative to the median of the noise, dB."""
    floor = spectrum.noise_floor.mean() * math.log(2)
    return spectrum.decibels - np.float32(10 * math.log10(floor) + 30)


def outline_pieces(spectrum: "Spectrum", scene: "Scene") -> Floats:
    """Return the outlines of a map at the height of a sensor, in pieces up to 0.1 m.

    Args:
        spectrum: A revolution of the sensor.
        scene: The map.

    Returns:
        Both ends of the pieces in the sensor frame, x ahead and y left, (P, 2, 2) m.
    """
    pose = spectrum.pose
    cuts = [slice_mesh(part.vertices, part.faces, pose.z) for part in scene.parts]
    ends = np.concatenate([np.zeros((0, 2, 2)), *cuts])
    # A triangle of which only a corner reaches the height gives a single point, which
    # is removed.
    lines = shapely.linestrings(ends[(ends[:, 0] != ends[:, 1]).any(axis=1)])
    coordinates, line = shapely.get_coordinates(
        shapely.segmentize(lines, PIECE), return_index=True
    )
    pieces = np.stack([coordinates[:-1], coordinates[1:]], axis=1)
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    own = (pieces - [pose.x, pose.y]) @ np.array([[cos, -sin], [sin, cos]])
    return np.asarray(own[line[:-1] == line[1:]])


def _polar_lines(pieces: Floats) -> Floats:
    """Convert pieces of outlines to range, m, and azimuth, degrees clockwise."""
    x, y = pieces[..., 0], pieces[..., 1]
    degrees = np.degrees(np.arctan2(-y, x)) % 360
    lines = np.stack([np.hypot(x, y), degrees], axis=2)
    # Lines across 0 degrees are left out, since they would span the whole picture.
    return np.asarray(lines[np.ptp(degrees, axis=1) < 180])


def _draw_outlines(axes: Axes, lines: Floats) -> None:
    """Draw the outlines of the map over a picture of a spectrum, with a legend."""
    limits = axes.get_xlim(), axes.get_ylim()
    # The lines are thin, so that they do not hide the echoes.
    style: dict[str, Any] = {"colors": TRUTH, "linewidths": 0.6, "alpha": 0.8}
    outlines = LineCollection(list(lines), **style, label="true outlines")
    axes.add_collection(outlines, autolim=False)
    axes.set(xlim=limits[0], ylim=limits[1])
    place: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0)}
    axes.legend(**place, borderaxespad=0.2, frameon=False, fontsize="small")


def _mark_surfaces(axes: Axes, pieces: Floats, angle: float, reach: float) -> None:
    """Draw a line at each range at which an azimuth crosses an outline."""
    cos, sin = math.cos(angle), math.sin(angle)
    pieces = pieces @ np.array([[cos, -sin], [sin, cos]])
    # Adjacent pieces share an end, so an azimuth through this end crosses one of these
    # pieces or both.
    (x0, y0), (x1, y1) = pieces[:, 0].T, pieces[:, 1].T
    share = np.divide(y0, y0 - y1, out=np.full(len(y0), np.inf), where=y0 != y1)
    ranges = (x0 + share * (x1 - x0))[(share >= 0) & (share <= 1)]
    ranges = ranges[(ranges > 0) & (ranges < reach)]
    for number, one in enumerate(np.unique(np.round(ranges, 3)).tolist()):
        text = "true outlines" if number == 0 else None
        axes.axvline(one, color=TRUTH, linewidth=1.0, label=text, zorder=0)


def _add_scale(axes: Axes, image: AxesImage) -> None:
    """Draw a colour bar next to a picture."""
    figure = axes.get_figure(root=True)
    if figure is not None:
        figure.colorbar(image, ax=axes, label=_DECIBELS, shrink=0.9, pad=0.02)


def _draw_cartesian(
    axes: Axes, spectrum: "Spectrum", reach: float, detections: "Detections | None"
) -> None:
    image = _from_above(spectrum, reach)
    _add_scale(axes, axes.imshow(image, extent=(-reach, reach, -reach, reach), **_GREY))
    axes.set_xlabel("to the right, m")
    axes.set_ylabel("ahead, m")
    if detections is not None:
        near = detections.ranges <= reach
        ranges, angles = detections.ranges[near], detections.angles[near]
        right, ahead = -ranges * np.sin(angles), ranges * np.cos(angles)
        axes.plot(right, ahead, **_MARK, markersize=3, label="detected")
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)


def _from_above(spectrum: "Spectrum", reach: float) -> NDArray[np.float32]:
    """Return a revolution as seen from above, dB; nan beyond the radar's range."""
    values, pixels = _grey(spectrum), PIXELS
    places: Floats = ((np.arange(pixels) + 0.5) / pixels * 2 - 1) * reach
    right, ahead = places[None, :], -places[:, None]
    count, bins = values.shape
    row = np.remainder(np.arctan2(right, ahead), 2 * np.pi) / (2 * np.pi) * count
    column = np.hypot(right, ahead) / spectrum.settings.bin_size
    low, near = np.floor(row).astype(np.int64), np.floor(column).astype(np.int64)
    across, along = np.float32(row - low), np.float32(column - near)
    # The last bin is outside, since linear interpolation also needs the next bin.
    outside = near >= bins - 1
    near = np.minimum(near, bins - 2)
    low, high = low % count, (low + 1) % count
    first = values[low, near] * (1 - across) + values[high, near] * across
    second = values[low, near + 1] * (1 - across) + values[high, near + 1] * across
    image = first * (1 - along) + second * along
    image[outside] = np.nan
    return np.asarray(image, np.float32)


def _draw_polar(
    axes: Axes, spectrum: "Spectrum", reach: float, detections: "Detections | None"
) -> None:
    bins = int(np.searchsorted(spectrum.ranges, reach, side="right"))
    extent = (0.0, reach, 360.0, 0.0)
    grey = _grey(spectrum)[:, :bins]
    _add_scale(axes, axes.imshow(grey, extent=extent, aspect="auto", **_GREY))
    axes.set_xlabel("range, m")
    axes.set_ylabel("azimuth, degrees clockwise")
    axes.set_yticks(range(0, 361, 90))
    if detections is not None:
        near = detections.ranges <= reach
        degrees = np.degrees(-detections.angles[near])
        axes.plot(detections.ranges[near], degrees, **_MARK, markersize=3)
        axes.set_xlim(0, reach)
        axes.set_ylim(360, 0)


def _draw_ascope(
    axes: Axes,
    spectrum: "Spectrum",
    azimuth: int,
    reach: float,
    detections: "Detections | None",
) -> None:
    shown = spectrum.ranges <= reach
    ranges = spectrum.ranges[shown]
    axes.plot(ranges, spectrum.decibels[azimuth, shown], linewidth=0.8, color="0.35")
    mean = 10 * np.log10(spectrum.mean[azimuth, shown]) + 30
    axes.plot(ranges, mean, linewidth=1.2, color=RADAR, label="mean of many turns")
    floor = 10 * np.log10(spectrum.noise_floor[shown]) + 30
    axes.plot(ranges, floor, linewidth=1, linestyle="--", color="0.5", label="noise")
    if detections is not None:
        own = (detections.rows == azimuth) & (detections.ranges <= reach)
        ranges, dbm = detections.ranges[own], detections.dbm[own]
        axes.plot(ranges, dbm, **{**_MARK, "color": INK}, label="detected")
    axes.set_xlabel("range, m")
    axes.set_ylabel("power, dBm")
    axes.set_xlim(0, reach)
    axes.grid(visible=True, linewidth=0.3)
