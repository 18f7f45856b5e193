"""Pictures of spectra: from above, by direction and range, and one direction alone."""

import math
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.plotting.palette import INK, RADAR, RADARS

if TYPE_CHECKING:
    from radarsim.addons.fmcw.detection import Detections
    from radarsim.addons.fmcw.spectrum import Spectrum

VIEWS: Final = ("cartesian", "polar", "ascope")
PIXELS: Final = 1000  # along a side of the picture from above
DARKEST: Final = 10  # dB of the grey scale under the median of the noise
BRIGHTEST: Final = 50  # and over it
VISIBLE: Final = 3.0  # dB over the noise, from which on an echo shows
LEAST_LOUD: Final = 2  # directions at a range, or it is not shown for them
MARGIN: Final = 1.1  # what is shown, by what has echoes
SHORTEST_REACH: Final = 5.0  # m
_MARK: Final[dict[str, Any]] = {
    "marker": "o",
    "linestyle": "none",
    "markerfacecolor": "none",
    "color": RADARS[2],  # which shows on black
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
) -> Axes:
    """Draw a turn.

    Args:
        spectrum: The turn.
        ax: Axes of matplotlib; None for a figure of its own.
        view: ``cartesian``, as seen from above with the front of the sensor upwards;
            ``polar``, a row for each direction; ``ascope``, power over range.
        azimuth: The direction of an A-scope.
        reach: Longest range that is shown, m; None for what is above the noise.
        detections: Targets to be marked.

    Raises:
        ValueError: If there is no such view or azimuth.
    """
    if view not in VIEWS:
        raise ValueError(f"view {view!r}, expected one of {VIEWS}")
    last = len(spectrum.angles) - 1
    if not 0 <= azimuth <= last:
        raise ValueError(f"azimuth {azimuth}, expected 0 to {last}")
    if ax is None:
        sizes = {"cartesian": (8.0, 8.4), "polar": (11.0, 5.2), "ascope": (10.0, 4.2)}
        ax = Figure(figsize=sizes[view], layout="constrained").add_subplot()
    reach = min(reach or echo_reach(spectrum), float(spectrum.ranges[-1]))
    title = f"x {spectrum.pose.x:.1f} m, y {spectrum.pose.y:.1f} m"
    if view == "ascope":
        _draw_ascope(ax, spectrum, azimuth, reach, detections)
        angle = math.degrees(-spectrum.angles[azimuth])
        title = f"azimuth {azimuth}, {angle:.1f}° clockwise, {title}"
    elif view == "polar":
        _draw_polar(ax, spectrum, reach, detections)
    else:
        _draw_cartesian(ax, spectrum, reach, detections)
    ax.set_title(f"{spectrum.sensor}, {title}", fontsize="medium")
    return ax


def echo_reach(spectrum: "Spectrum") -> float:
    """Return the range up to which there are echoes above the noise, and a bit more."""
    # By the mean power of echoes: noise that happens to be loud would move the edge.
    noise = spectrum.noise_floor * np.float32(10 ** (VISIBLE / 10))
    loud = (spectrum.echo_power > noise).sum(axis=0) >= LEAST_LOUD
    last = np.flatnonzero(loud).max(initial=0)
    return max(MARGIN * float(spectrum.ranges[last]), SHORTEST_REACH)


def _grey(spectrum: "Spectrum") -> NDArray[np.float32]:
    """Return the power of each bin relative to the median of the noise, dB."""
    floor = spectrum.noise_floor.mean() * math.log(2)
    return spectrum.decibels - np.float32(10 * math.log10(floor) + 30)


def _draw_cartesian(
    axes: Axes, spectrum: "Spectrum", reach: float, detections: "Detections | None"
) -> None:
    image = cartesian_image(spectrum, _grey(spectrum), reach, PIXELS)
    axes.imshow(image, extent=(-reach, reach, -reach, reach), **_GREY)
    axes.set_xlabel("to the right, m")
    axes.set_ylabel("ahead, m")
    if detections is not None:
        near = detections.ranges <= reach
        ranges, angles = detections.ranges[near], detections.angles[near]
        right, ahead = -ranges * np.sin(angles), ranges * np.cos(angles)
        axes.plot(right, ahead, **_MARK, markersize=3)
    axes.set_xlim(-reach, reach)
    axes.set_ylim(-reach, reach)


def cartesian_image(
    spectrum: "Spectrum", values: NDArray[np.float32], reach: float, pixels: int
) -> NDArray[np.float32]:
    """Return a turn as seen from above, straight ahead upwards; nan beyond its range.

    Args:
        spectrum: The turn.
        values: (A, B) what to show of each bin.
        reach: Distance from the middle to the sides, m.
        pixels: P, along each side.

    Returns:
        (P, P), by linear interpolation between directions and bins.
    """
    places: Floats = ((np.arange(pixels) + 0.5) / pixels * 2 - 1) * reach
    right, ahead = places[None, :], -places[:, None]
    count, bins = values.shape
    row = np.remainder(np.arctan2(right, ahead), 2 * np.pi) / (2 * np.pi) * count
    column = np.hypot(right, ahead) / spectrum.settings.bin_size
    low, near = np.floor(row).astype(np.int64), np.floor(column).astype(np.int64)
    across, along = np.float32(row - low), np.float32(column - near)
    # Linear interpolation needs the bin after as well.
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
    axes.imshow(_grey(spectrum)[:, :bins], extent=extent, aspect="auto", **_GREY)
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
    axes.set_ylabel("dBm")
    axes.set_xlim(0, reach)
    axes.grid(visible=True, linewidth=0.3)
    axes.legend(loc="upper right", fontsize="small")
