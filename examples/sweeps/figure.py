"""Draw what share of beams ends beyond an x, from the table of a sweep of scans.

python examples/sweeps/figure.py rows.parquet figure.png COLUMN LINES BEYOND_X

COLUMN is a column of the table for the horizontal axis, such as
``sensor.penetration_power``, and LINES one with a line for each of its values. A label
may follow either, as in ``sensor.side_offset_uu="N, UU"``. BEYOND_X is in m, map frame.
A band around each line is the middle half of the scans.
"""

import json
import math
import re
import sys
from collections import defaultdict
from functools import cache
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from pyarrow import parquet

from radarsim import load_sensor
from radarsim.geometry import Floats
from radarsim.plotting.palette import GRID, LASERS, RADARS
from radarsim.plotting.style import render
from radarsim.presets.sensors import load_settings

# Of one radar with several values of a setting, from the smallest to the largest.
RADAR_SHADES = ("#cfc6fb", "#a795f5", "#8068ef", "#5636d8", "#36208f")
DASHES, MARKERS = ("-", "--", ":"), "os^Dv"  # as lines may lie on each other
Lines = dict[str, dict[float | str, list[float]]]  # shares by line and place


@cache
def beam_angles(sensor: str) -> Floats:
    """Return the angles of the beams of a sensor, whose settings are JSON, rad."""
    settings = json.loads(sensor)
    return load_sensor(settings.pop("name"), **settings).angles


def share_beyond(row: dict[str, Any], beyond_x: float) -> float:
    """Return the share of the beams of a scan that end beyond an x."""
    settings = {
        key.removeprefix("sensor."): value
        for key, value in row.items()
        if key.startswith("sensor.")
    }
    angles = beam_angles(json.dumps(settings)) + math.radians(row["yaw_deg"])
    ranges = np.array(row["ranges"], float)  # nan where nothing came back
    return float(np.mean(row["x"] + ranges * np.cos(angles) > beyond_x))


def place_of(value: Any) -> float | str:
    """Return a number; of a map, that of a variant such as ``hedge@20cm``."""
    if isinstance(value, int | float):
        return float(value)
    found = re.fullmatch(r"([0-9]+)(mm|cm|m)", str(value).rpartition("@")[2])
    return float(found[1]) if found else str(value)


def line_colours(lines: Lines, column: str) -> dict[str, str]:
    """Return the colour of each line: of its sensor, or a shade of the radar's."""
    if column == "sensor.name":
        shades = {"radar": cycle(RADARS), "laser": cycle(LASERS)}
        return {name: next(shades[load_settings(name).medium]) for name in lines}
    step = (len(RADAR_SHADES) - 1) / max(len(lines) - 1, 1)
    return {name: RADAR_SHADES[int(n * step)] for n, name in enumerate(lines)}


def draw(lines: Lines, colours: dict[str, str]) -> Figure:
    """Draw the mean share of each line at each place, and the middle half."""
    figure = Figure((8.0, 4.6), layout="constrained")
    axes = figure.subplots()
    for number, (name, shares) in enumerate(lines.items()):
        places = sorted(shares, key=lambda each: (isinstance(each, str), each))
        low, high = np.transpose([np.quantile(shares[p], (0.25, 0.75)) for p in places])
        style: Any = {"color": colours[name], "linestyle": DASHES[number % len(DASHES)]}
        style |= {"marker": MARKERS[number % len(MARKERS)], "label": name}
        axes.plot(places, [np.mean(shares[p]) for p in places], **style)
        axes.fill_between(places, low, high, color=colours[name], alpha=0.12, lw=0)
    axes.set_ylim(0, None)
    axes.yaxis.set_major_formatter(lambda value, _: f"{100 * value:.0f} %")
    axes.grid(color=GRID, lw=0.6)
    return figure


def main() -> None:
    """Read the table, and write the figure."""
    table, picture, across, by, beyond_x = sys.argv[1:]
    (column, _, label), (line_column, _, title) = (
        across.partition("="),
        by.partition("="),
    )
    lines: Lines = defaultdict(lambda: defaultdict(list))
    for batch in parquet.ParquetFile(table).iter_batches(256):
        for row in batch.to_pylist():
            if row["ranges"] is not None:  # else its task failed
                place = place_of(row[column])
                share = share_beyond(row, float(beyond_x))
                lines[str(row[line_column])][place].append(share)
    figure = draw(lines, line_colours(lines, line_column))
    axes = figure.axes[0]
    axes.set(xlabel=label or column, ylabel=f"beams that end beyond x = {beyond_x} m")
    axes.legend(title=title or line_column, frameon=False)
    Path(picture).write_bytes(render(figure, picture.rpartition(".")[2]))


if __name__ == "__main__":
    main()
