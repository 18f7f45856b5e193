"""The figure of a sweep of scans: what share of beams gets past something."""

import math
import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from radarsim.errors import SweepError, import_optional
from radarsim.geometry import Floats
from radarsim.lab.sweep.file import FigureEntry, SweepFile
from radarsim.lab.sweep.folder import EXTRA, flat_parameters
from radarsim.plotting.palette import LASER, RADAR
from radarsim.presets.sensors import load_settings
from radarsim.sensors.range_scanner import load_sensor

_SIZE: Final = (8.0, 4.6)  # inches
_SHADES: Final = ("#cfc6fb", "#a795f5", "#8068ef", "#5636d8", "#36208f")

_LENGTH: Final = re.compile(r"([0-9]+)(mm|cm|m)")

_DASHES: Final = ("-", "--", ":")  # lines may lie on each other

Points = dict[Any, dict[Any, list[float]]]


def draw_sweep(sweep: SweepFile, entry: FigureEntry, table: Path) -> Figure:
    """Draw the share of beams that end beyond a line, over a parameter.

    Args:
        sweep: The sweep.
        entry: What to draw.
        table: Its table.

    Raises:
        SweepError: If the sweep has no such parameters.
    """
    points = _points(sweep, entry, table)
    figure = Figure(_SIZE, layout="constrained")
    axes = figure.subplots()
    axes.set_title(entry.title, loc="left", fontsize=12, fontweight="bold")
    for number, (name, line) in enumerate(points.items()):
        colour = _colour(entry, name, number, len(points))
        style = {"color": colour, "linestyle": _DASHES[number % len(_DASHES)]}
        _draw_line(axes, line, style, f"{name}")
    axes.set_ylim(0, None)
    axes.yaxis.set_major_formatter(lambda value, _: f"{100 * value:.0f} %")
    axes.set_ylabel(f"beams that end beyond x = {entry.beyond_x:g} m")
    axes.set_xlabel(entry.x_label or entry.x)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="#e4e4e4", lw=0.6)
    axes.legend(title=entry.lines_label or entry.lines, frameon=False)
    return figure


def _points(sweep: SweepFile, entry: FigureEntry, table: Path) -> Points:
    """Return the share of each scan, by line and place on it."""
    known = list(flat_parameters(next(sweep.tasks())))
    for name in (entry.x, entry.lines):
        if name not in known:
            raise SweepError(f"figure: {name!r}, expected one of {known}")
    parquet = import_optional("pyarrow.parquet", EXTRA)
    columns = {*known, "ranges"}
    points: Points = defaultdict(lambda: defaultdict(list))
    angles_of = cache(_angles)
    for batch in parquet.ParquetFile(table).iter_batches(256, columns=list(columns)):
        for row in batch.to_pylist():
            if row["ranges"] is not None:
                place = _number_of(row[entry.x])
                points[row[entry.lines]][place].append(
                    _share_beyond(row, entry, angles_of)
                )
    return points


def _number_of(value: Any) -> Any:
    """Return a value, or the number that the name of a map's variant begins with."""
    if not isinstance(value, str):
        return value
    found = _LENGTH.fullmatch(value.rpartition("@")[2])
    return float(found[1]) if found else value


def _share_beyond(
    row: Mapping[str, Any],
    entry: FigureEntry,
    angles_of: Callable[[tuple[tuple[str, Any], ...]], Floats],
) -> float:
    """Return the share of a scan's beams that end beyond the line."""
    settings = tuple(
        (
            key.removeprefix("sensor."),
            tuple(value) if isinstance(value, list) else value,
        )
        for key, value in row.items()
        if key.startswith("sensor.")
    )
    angles = angles_of(settings) + math.radians(row["yaw_deg"])
    ranges = np.array([np.nan if each is None else each for each in row["ranges"]])
    return float(np.mean(row["x"] + ranges * np.cos(angles) > entry.beyond_x))


def _angles(settings: tuple[tuple[str, Any], ...]) -> Floats:
    """Return the directions of a sensor's beams, (N,) rad."""
    values = dict(settings)
    return load_sensor(values.pop("name"), **values).angles


def _draw_line(
    axes: Axes, line: dict[Any, list[float]], style: dict[str, Any], name: str
) -> None:
    places = sorted(line)
    values = [float(np.mean(line[place])) for place in places]
    axes.plot(places, values, marker="o", ms=4, label=name, **style)
    low, high = _quartiles([line[place] for place in places])
    axes.fill_between(places, low, high, color=style["color"], alpha=0.12, lw=0)


def _quartiles(samples: Sequence[Sequence[float]]) -> tuple[list[float], list[float]]:
    low, high = (
        [float(np.quantile(each, share)) for each in samples] for share in (0.25, 0.75)
    )
    return low, high


def _colour(entry: FigureEntry, name: Any, number: int, count: int) -> str:
    """Return the colour of a line: that of its sensor, or a shade of the radar's."""
    if entry.lines == "sensor.name":
        return RADAR if load_settings(name).medium == "radar" else LASER
    return _SHADES[number * (len(_SHADES) - 1) // max(count - 1, 1)]
