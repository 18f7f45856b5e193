"""What the study has found: where the radar wins, and where it loses.

It is told in sentences, and drawn as a dot with its interval for each sensor and map.
"""

import textwrap
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from radarsim.autonomy.evaluation.estimates import Estimate
from radarsim.lab.study.maps import RADAR, SENSORS
from radarsim.lab.study.results import (
    MEASURES,
    TITLES,
    Summaries,
    Summary,
    bare_title,
    kinds_of,
)
from radarsim.plotting import palette

LASERS: Final = tuple(
    name for name, sensor in SENSORS.items() if sensor.preset != SENSORS[RADAR].preset
)
_ROUNDING: Final = 1e-9  # errors of shares
_STEP: Final = 0.15  # rows between two sensors
_TITLE_WIDTH: Final = 92  # characters
# By preset; a variant of a preset has hollow markers.
_PRESETS: Final = tuple(dict.fromkeys(each.preset for each in SENSORS.values()))
_COLOURS: Final = dict(zip(_PRESETS, (palette.RADAR, *palette.LASERS), strict=True))
_MARKERS: Final = dict(zip(_PRESETS, "Dos^", strict=True))
# Shares of the floor that the figure shows: the map, the estimate, and its label.
_FLOOR: Final = (
    ("hidden_room", "hidden", "hidden\nbehind bushes"),
    ("hidden_room", "reachable", "this side\nof the bushes"),
    ("office", "reachable", "reachable\nin the office"),
)


def summary_sentences(summaries: Summaries) -> list[str]:
    """Return the study's summary: smoke, hidden floor, the dead end, and losses."""
    sentences = []
    for map_, text, tell in (
        ("smoke_corridor", "Through smoke, these arrive without a touch", _arrivals),
        (
            "hidden_room",
            "Of the floor behind bushes that no robot can pass, these map",
            lambda each: share_text(each.hidden),
        ),
    ):
        if numbers := _listed(summaries, map_, tell):
            sentences.append(f"{text}: {numbers}.")
    detours = _listed(
        summaries, "dead_end", lambda each: number_text(each.detour, each, "{:.2f}")
    )
    if detours:
        compared = _against_lasers(summaries)
        sentences.append(
            "Where the nearer gap in a hedge leads nowhere, "
            + (f"the radar's path is {compared}; " if compared else "")
            + f"path / shortest path: {detours}."
        )
    if len(kinds := kinds_of(summaries)) > 1:
        sentences.append(
            "Of all drives, these end with a right verdict and no touch:"
            f" {_right_verdicts(summaries, kinds)}."
        )
    losses = list(find_losses(summaries))
    # With one seed nothing can be told from chance, so no intervals are claimed.
    if not any(summary.success.has_interval for summary in summaries.values()):
        behind = "; ".join(loss for _, loss in losses) or "nowhere"
        sentences.append(
            f"In this one run of each, the radar is behind the best laser: {behind}."
        )
        return sentences
    for clearly, text in (
        (True, "The radar loses where the intervals do not overlap"),
        (False, "It is behind the best laser, within the intervals"),
    ):
        told = "; ".join(loss for is_clear, loss in losses if is_clear is clearly)
        sentences.append(f"{text}: {told or 'nowhere'}.")
    return sentences


def headline(summaries: Summaries) -> str:
    """Return what the figure shows first, in a sentence without a full stop."""
    # Who arrives how often through smoke, most often first.
    groups: dict[str, list[str]] = {}
    drives = {sensor: summaries["smoke_corridor", sensor].success for sensor in SENSORS}
    # The order is stable: among equals the radar, which is the first sensor, comes
    # first.
    for sensor in sorted(drives, key=lambda each: -drives[each].value):
        share = drives[sensor]
        told = "none" if share.value == 0 else successes(share)
        groups.setdefault(told, []).append(sensor)
    (most, first), *rest = groups.items()
    others = [(named(sensors), told) for told, sensors in rest]
    if len(others) == 1 and len(first) > len(SENSORS) / 2:
        arrivals = "all but {} ({}) arrive in {}".format(*others[0], most)
    else:
        verb = "arrives" if len(first) == 1 else "arrive"
        texts = [f"{sensors} in {told}" for sensors, told in others]
        arrivals = ", ".join([f"{named(first)} {verb} in {most}", *texts])
    through = f"hrough smoke {arrivals}"
    radar, laser = (_most_hidden(summaries, each) for each in ((RADAR,), LASERS))
    if radar is None or laser is None:
        return f"T{through}"
    best = f"the best laser {percent(laser)}" if laser.value else "no laser any"
    mapped = f"Behind bushes the radar maps {percent(radar)} of the floor, {best}"
    return f"{mapped}; t{through}"


def _against_lasers(summaries: Summaries) -> str:
    """Return how the radar's path behind the dead end compares with lasers' paths.

    That is by the differences on the same maps.
    """
    groups: dict[str, list[str]] = {}
    for sensor in LASERS:
        difference = summaries["dead_end", sensor].detour_difference
        if difference is None or not difference.has_interval:
            continue
        word = "as good as with"
        if difference.low > 0:
            word = "shorter than with"
        elif difference.high < 0:
            word = "longer than with"
        groups.setdefault(word, []).append(sensor)
    return ", and ".join(f"{word} {named(names)}" for word, names in groups.items())


def named(sensors: Sequence[str]) -> str:
    """Return names as ``a, b and c``."""
    *others, last = sensors
    return f"{', '.join(others)} and {last}" if others else last


def _listed(summaries: Summaries, map_: str, tell: Callable[[Summary], str]) -> str:
    """Return what there is to tell of each sensor on a map; empty if nothing."""
    texts = (
        (sensor, tell(summaries[map_, sensor]))
        for sensor in SENSORS
        if (map_, sensor) in summaries
    )
    return ", ".join(f"{sensor} {text}" for sensor, text in texts if text)


def _right_verdicts(summaries: Summaries, kinds: Sequence[str]) -> str:
    """Return how many drives on all kinds of maps end rightly, for each sensor."""
    totals = {}
    for sensor in SENSORS:
        drives = [summaries[map_, sensor].success for map_ in kinds]
        right = sum(round(each.value * each.count) for each in drives)
        totals[sensor] = f"{right} of {sum(each.count for each in drives)}"
    return ", ".join(f"{sensor} {total}" for sensor, total in totals.items())


def _arrivals(summary: Summary) -> str:
    text = share_text(summary.success, successes)
    if summary.false_no_path:
        text += f' with a false "no path" in {summary.false_no_path}'
    return text


def find_losses(summaries: Summaries) -> Iterator[tuple[bool, str]]:
    """Yield where the best laser does better than the radar.

    Yields:
        Whether their intervals do not overlap, and the place with both values.
    """
    for measure in MEASURES:
        sign = 1 if measure.more_is_better else -1
        for map_ in (map_ for map_ in measure.maps if (map_, RADAR) in summaries):
            radar = measure.of(summaries[map_, RADAR])
            found = {
                sensor: estimate
                for sensor in LASERS
                if (estimate := measure.of(summaries[map_, sensor])) is not None
            }
            if radar is None or not found:
                continue
            laser = max(found.values(), key=lambda each: sign * each.value)
            # better, or the same, is what is by the two digits that are told
            if round(sign * (laser.value - radar.value), 2) <= 0:
                continue
            best = [s for s in found if round(found[s].value - laser.value, 2) == 0]
            lasers = "every laser" if len(best) == len(LASERS) else named(best)
            runs = summaries[map_, RADAR].success.count
            one, other = (
                percent(each)
                if measure.more_is_better
                else f"{each.value:.2f}{_of_fewer(each, runs)}"
                for each in (radar, laser)
            )
            yield (
                laser.has_interval
                and radar.has_interval
                and (laser.low > radar.high or laser.high < radar.low),
                f"{measure.name} in {TITLES[map_]}, {one} against {other} with"
                f" {lasers}",
            )


def _most_hidden(summaries: Summaries, sensors: tuple[str, ...]) -> Estimate | None:
    keys = (("hidden_room", sensor) for sensor in sensors)
    found = [summaries[key].hidden for key in keys if key in summaries]
    known = [estimate for estimate in found if estimate is not None]
    return max(known, key=lambda each: each.value, default=None)


def successes(estimate: Estimate) -> str:
    """Return a share as ``9 of 10``."""
    return f"{round(estimate.value * estimate.count)} of {estimate.count}"


def percent(estimate: Estimate) -> str:
    """Return an estimate as ``93 %``."""
    return f"{_hundredths(estimate.value)} %"


def number_text(estimate: Estimate | None, summary: Summary, form: str) -> str:
    """Return a mean of some drives with its interval; empty if there is none.

    Args:
        estimate: The mean, of the summary's drives or of fewer, whose number is told.
        summary: The summary.
        form: How numbers are written, as for ``str.format``.
    """
    if estimate is None:
        return ""
    text = form.format(estimate.value)
    if not estimate.is_exact:
        text += f" ({form.format(estimate.low)} to {form.format(estimate.high)})"
    return text + _of_fewer(estimate, summary.success.count)


def _of_fewer(estimate: Estimate, runs: int) -> str:
    """Return the number of values; empty if it is that of the runs."""
    return f" [n = {estimate.count}]" if estimate.count < runs else ""


def _hundredths(value: float) -> str:
    """Return a share in percent, with one decimal if it would else seem to be exact."""
    text = f"{100 * value:.0f}"
    if text in ("0", "100") and abs(value - round(value)) > _ROUNDING:
        return f"{100 * value:.1f}"
    return text


def share_text(
    estimate: Estimate | None, write: Callable[[Estimate], str] = percent
) -> str:
    """Return a share with its interval; empty if there is none."""
    if estimate is None:
        return ""
    interval = percent_interval(estimate)
    return write(estimate) + (f" ({interval})" if interval else "")


def percent_interval(estimate: Estimate) -> str:
    """Return the interval of a share as ``72 to 100 %``; empty if there is none."""
    if estimate.is_exact:
        return ""
    return f"{_hundredths(estimate.low)} to {_hundredths(estimate.high)} %"


def draw_study(summaries: Summaries) -> Figure:
    """Draw the verdicts of all maps, and what is known of the floor.

    Args:
        summaries: The runs of each sensor on each kind of map.
    """
    figure = Figure((11.0, 7.6), layout="constrained")
    figure.suptitle(
        textwrap.fill(headline(summaries), _TITLE_WIDTH, break_on_hyphens=False),
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
        [bare_title(map_) for map_ in kinds],
        lambda row, sensor: summaries[kinds[row], sensor].success,
    )
    verdicts.set_title(
        "Share of drives with a right verdict and no touch", loc="left", fontsize=11
    )
    # Beside the dots: how many drives told falsely that there is no path.
    for row, map_ in enumerate(kinds):
        for sensor in SENSORS:
            summary = summaries[map_, sensor]
            mistakes = (
                (summary.false_no_path, '{} false "no path"'),
                (summary.failed, "{} no verdict"),
                (summary.touches, "touches: {}"),
            )
            text = ", ".join(form.format(n) for n, form in mistakes if n)
            value = summary.success
            is_after = 1 - value.high >= value.low  # where there is more room
            if text:
                verdicts.text(
                    value.high + 0.03 if is_after else value.low - 0.03,
                    _height(row, sensor),
                    text,
                    va="center",
                    ha="left" if is_after else "right",
                    fontsize=9,
                    color=palette.INK,
                )
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
            axes.axhspan(row - 0.5, row + 0.5, color=palette.BAND, lw=0)
        for sensor in SENSORS:
            if (estimate := find(row, sensor)) is not None:
                y = _height(row, sensor)
                ends = [max(estimate.low, 0.0), min(estimate.high, 1.0)]
                width = 2.2 if sensor == RADAR else 1.6
                axes.plot(ends, [y, y], color=_colour(sensor), lw=width)
                axes.plot([estimate.value], [y], clip_on=False, **_style(sensor))
    axes.set_yticks(range(len(labels)), labels)
    axes.set_ylim(len(labels) - 0.5, -0.5)
    axes.set_xlim(-0.03, 1.03)
    axes.set_xticks([0, 0.5, 1], ["0", "50 %", "100 %"])
    axes.tick_params(axis="y", length=0)
    axes.grid(axis="x", color=palette.GRID, lw=0.6)
    axes.spines[["top", "right", "left"]].set_visible(False)


def _height(row: int, sensor: str) -> float:
    return row + (list(SENSORS).index(sensor) - (len(SENSORS) - 1) / 2) * _STEP


def _style(name: str) -> dict[str, Any]:
    sensor = SENSORS[name]
    is_variant = bool(sensor.settings or sensor.plan)
    colour = _colour(name)
    return {
        "marker": _MARKERS[sensor.preset],
        "markersize": 8 if name == RADAR else 6.5,
        "color": colour,
        "markerfacecolor": palette.PAPER if is_variant else colour,
        "linestyle": "none",
    }


def _colour(name: str) -> str:
    return _COLOURS[SENSORS[name].preset]
