"""Draw the rows of ``run.py``, and print a table of them in Markdown.

python examples/study/figure.py rows.jsonl study.png
"""

import json
import math
import sys
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from radarsim.autonomy.evaluation.own_controllers import Estimate, mean, share
from radarsim.plotting import palette

Row = dict[str, Any]
Groups = dict[str, dict[str, list[Row]]]  # by map and sensor
STYLES = {  # of each sensor: colour, marker, whether the marker is filled
    "radar": (palette.RADAR, "D", True),
    "range-only radar": (palette.RADAR, "D", False),
    "first-echo laser": (palette.LASERS[0], "o", True),
    "last-echo laser": (palette.LASERS[0], "o", False),
    "USARSim Hokuyo": (palette.LASERS[1], "s", True),
    "USARSim SICK": (palette.LASERS[2], "^", True),
}
STEP = 0.15  # rows between two sensors


def right_verdicts(rows: Sequence[Row]) -> Estimate:
    """Return the share of drives that ended rightly and touched nothing."""
    drives = [row for row in rows if "expected" in row]
    # The robot's footprint may pass where the disc of the shortest path does not.
    right = [row for row in drives if row["outcome"] in (row["expected"], "reached")]
    return share(sum(not row["collisions"] for row in right), len(drives))


def detour(rows: Sequence[Row]) -> Estimate | None:
    """Return path / shortest path of the drives that arrived."""
    ratios = [
        row["path_length"] / row["shortest_path"]
        for row in rows
        if row["outcome"] == "reached" == row.get("expected")
    ]
    return mean(ratios) if ratios else None


def mean_share(key: str) -> Callable[[Sequence[Row]], Estimate | None]:
    """Return a function that returns the mean of a share of explorations."""

    def of(rows: Sequence[Row]) -> Estimate | None:
        shares = [row[key] for row in rows if row.get(key) is not None]
        found = mean(shares or [math.nan])
        cut = replace(found, low=max(found.low, 0.0), high=min(found.high, 1.0))
        return cut if shares else None

    return of


MEASURES: dict[str, Callable[[Sequence[Row]], Estimate | None]] = {
    "right verdicts": right_verdicts,
    "path / shortest path": detour,
    "reachable floor": mean_share("reachable_coverage"),
    "hidden floor": mean_share("hidden_coverage"),
    "obstacles in place": mean_share("within_two_cells"),
}
SHOWN = {  # titles of panels
    "right verdicts": "Drives that end right, without a touch",
    "hidden floor": "Hidden floor that is mapped",
}


def table(groups: Groups) -> str:
    """Return the estimates with their intervals in Markdown."""
    lines = [("map", "sensor", *MEASURES, "touches"), ["---"] * (len(MEASURES) + 3)]
    for kind, sensors in groups.items():
        for sensor, rows in sensors.items():
            values = [text(measure(rows)) for measure in MEASURES.values()]
            touches = sum(row["collisions"] for row in rows)
            lines.append((kind, sensor, *values, str(touches)))
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def text(estimate: Estimate | None) -> str:
    """Return an estimate with its interval; empty if there is none."""
    if estimate is None:
        return ""
    value = f"{estimate.value:.3f}"
    if estimate.low == estimate.high:
        return value
    return f"{value} ({estimate.low:.3f} to {estimate.high:.3f})"


def draw(groups: Groups) -> Figure:
    """Draw the mean and the 95 % interval of each sensor on each kind of map."""
    figure = Figure((11.0, 7.0), layout="constrained")
    for axes, name in zip(figure.subplots(1, len(SHOWN)), SHOWN, strict=True):
        axes.set_title(SHOWN[name], loc="left", weight="bold")
        draw_measure(axes, groups, MEASURES[name])
    handles, labels = figure.axes[0].get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    # Few kinds of maps have hidden floor, so there is space below them.
    figure.axes[-1].legend(unique.values(), unique, loc="lower center", frameon=False)
    return figure


def draw_measure(
    axes: Axes, groups: Groups, measure: Callable[[Sequence[Row]], Estimate | None]
) -> None:
    """Draw one measure, with a row for each kind of map that has it."""
    rows = [
        kind for kind, sensors in groups.items() if any(map(measure, sensors.values()))
    ]
    for number, kind in enumerate(rows):
        for place, (sensor, (colour, marker, filled)) in enumerate(STYLES.items()):
            estimate = measure(groups[kind].get(sensor, []))
            if estimate is None:
                continue
            y = number + (place - (len(STYLES) - 1) / 2) * STEP
            axes.plot([estimate.low, estimate.high], [y, y], color=colour)
            axes.plot(
                [estimate.value],
                [y],
                marker,
                color=colour,
                markerfacecolor=colour if filled else palette.PAPER,
                label=sensor,
                clip_on=False,
            )
    axes.set_yticks(range(len(rows)), [kind.replace("_", " ") for kind in rows])
    axes.set_ylim(len(groups) - 0.5, -0.5)
    axes.set_xlim(-0.03, 1.03)
    axes.set_xticks([0, 0.5, 1], ["0", "50 %", "100 %"])
    axes.grid(axis="x", color=palette.GRID)
    axes.spines[["top", "right", "left"]].set_visible(False)


def main() -> None:
    """Read the rows, write the figure, and print the table."""
    source, picture = sys.argv[1:]
    groups: Groups = defaultdict(lambda: defaultdict(list))
    for line in Path(source).read_text().splitlines():
        row = json.loads(line)
        groups[row["map"]][row["sensor"]].append(row)
    draw(groups).savefig(picture, dpi=100)
    print(table(groups))


if __name__ == "__main__":
    main()
