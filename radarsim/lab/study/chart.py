"""The figure of the study: a dot with its interval for each sensor and map."""

from collections.abc import Callable
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from radarsim.lab.study.findings import headline
from radarsim.lab.study.maps import SENSORS
from radarsim.lab.study.results import TITLES, Estimate, Summaries, Summary, kinds_of
from radarsim.plotting.palette import INK, LASERS, RADAR

_SIZE: Final = (11.0, 6.6)  # inches
_STEP: Final = 0.19  # rows between two sensors
_COLOURS: Final = dict(zip(SENSORS, (RADAR, *LASERS), strict=True))
_MARKERS: Final = {"radar": "D", "physical": "o", "hokuyo": "s", "sick": "^"}
_FLOOR: Final = (
    ("hidden_room", "hidden", "hidden\nbehind bushes"),
    ("hidden_room", "reachable", "this side\nof the bushes"),
    ("office", "reachable", "reachable\nin the office"),
)


def draw_study(summaries: Summaries) -> Figure:
    """Draw the verdicts of all maps, and what is known of the floor.

    Args:
        summaries: The runs of each sensor on each kind of map.
    """
    figure = Figure(_SIZE, layout="constrained")
    figure.suptitle(
        headline(summaries).replace("`", ""),
        x=0.01,
        ha="left",
        fontsize=14,
        fontweight="bold",
    )
    kinds = kinds_of(summaries)
    rows = [row for row in _FLOOR if row[0] in kinds]
    *others, verdicts = figure.subplots(
        1, 1 + bool(rows), squeeze=False, width_ratios=(1, 1.2)[-1 - bool(rows) :]
    )[0]
    for floor in others:
        _draw_rows(
            floor,
            [label for *_, label in rows],
            lambda row, sensor: getattr(summaries[rows[row][0], sensor], rows[row][1]),
        )
        floor.set_title("Share of the floor that is mapped", loc="left", fontsize=11)
    _draw_rows(
        verdicts,
        [TITLES[map_].removeprefix("a ").removeprefix("an ") for map_ in kinds],
        lambda row, sensor: summaries[kinds[row], sensor].success,
    )
    verdicts.set_title(
        "Share of drives with a right verdict and no touch", loc="left", fontsize=11
    )
    _draw_false_verdicts(verdicts, summaries)
    samples = [Line2D([], [], **_style(sensor)) for sensor in SENSORS]
    figure.legend(
        samples, SENSORS, loc="outside lower center", ncols=len(SENSORS), frameon=False
    )
    return figure


def _draw_rows(
    axes: Axes, labels: list[str], find: Callable[[int, str], Estimate | None]
) -> None:
    """Draw a row for each label, and in it a dot for each sensor."""
    for row, _ in enumerate(labels):
        if row % 2 == 0:
            axes.axhspan(row - 0.5, row + 0.5, color="#f4f4f6", lw=0)
        for sensor in SENSORS:
            if (estimate := find(row, sensor)) is not None:
                _draw_estimate(axes, estimate, _height(row, sensor), sensor)
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.set_xlim(-0.03, 1.03)
    axes.set_xticks([0, 0.5, 1], ["0", "50 %", "100 %"])
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x", color="#dddddd", lw=0.6)
    axes.spines[["top", "right", "left"]].set_visible(False)


def _draw_estimate(axes: Axes, estimate: Estimate, y: float, sensor: str) -> None:
    colour = _COLOURS[sensor]
    ends = [max(estimate.low, 0.0), min(estimate.high, 1.0)]
    axes.plot(ends, [y, y], color=colour, lw=2.2 if sensor == "radar" else 1.6)
    axes.plot([estimate.value], [y], clip_on=False, **_style(sensor))


def _draw_false_verdicts(axes: Axes, summaries: Summaries) -> None:
    """Write beside the dots how many drives told falsely that there is no path."""
    for row, map_ in enumerate(kinds_of(summaries)):
        for sensor in SENSORS:
            if text := _mistakes(summaries[map_, sensor]):
                value = summaries[map_, sensor].success
                left = value.value < 0.5
                axes.text(
                    value.high + 0.03 if left else value.low - 0.03,
                    _height(row, sensor),
                    text,
                    va="center",
                    ha="left" if left else "right",
                    fontsize=9,
                    color=INK,
                )


def _mistakes(summary: Summary) -> str:
    told = [
        f'{summary.false_no_path} false "no path"' * bool(summary.false_no_path),
        f"{summary.failed} no verdict" * bool(summary.failed),
        f"touches: {summary.touches}" * bool(summary.touches),
    ]
    return ", ".join(filter(None, told))


def _height(row: int, sensor: str) -> float:
    return row + (SENSORS.index(sensor) - (len(SENSORS) - 1) / 2) * _STEP


def _style(sensor: str) -> dict[str, Any]:
    return {
        "marker": _MARKERS[sensor],
        "markersize": 9 if sensor == "radar" else 7,
        "color": _COLOURS[sensor],
        "linestyle": "none",
    }
