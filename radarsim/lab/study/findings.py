"""What the study has found, in sentences: where the radar wins, and where it loses."""

from collections.abc import Callable, Iterator, Sequence
from typing import Final

from radarsim.lab.study.maps import RADAR, SENSORS
from radarsim.lab.study.results import (
    MEASURES,
    TITLES,
    Estimate,
    Measure,
    Summaries,
    Summary,
)

LASERS: Final = tuple(sensor for sensor in SENSORS if sensor != RADAR)
_ROUNDING: Final = 1e-9  # errors of shares


def summary_sentences(summaries: Summaries) -> list[str]:
    """Return the study's summary: smoke, hidden floor, the dead end, and losses."""
    smoke = _listed(summaries, "smoke_corridor", _arrivals)
    hidden = _listed(summaries, "hidden_room", lambda each: _told(each.hidden))
    found = (
        ("Through smoke, these arrive without a touch", smoke),
        ("Of the floor behind bushes that no robot can pass, these map", hidden),
    )
    told = [f"{text}: {numbers}." for text, numbers in found if numbers]
    return [*told, *_hedge_sentences(summaries), *_loss_sentences(summaries)]


def headline(summaries: Summaries) -> str:
    """Return what the figure shows first, names in backquotes, in one line or two."""
    through = f"hrough smoke {_smoke_arrivals(summaries)}"
    radar, laser = (_most_hidden(summaries, each) for each in ((RADAR,), LASERS))
    if radar is None or laser is None:
        return f"T{through}"
    if laser.value == 0 < radar.value:
        behind = (
            f"Only the radar maps the floor behind bushes ({percent(radar)},"
            f" lasers {percent(laser)})"
        )
    else:
        behind = (
            f"Behind bushes the radar maps {percent(radar)} of the floor, the best"
            f" laser {percent(laser)}"
        )
    return f"{behind};\nt{through}"


def _smoke_arrivals(summaries: Summaries) -> str:
    """Return who arrives how often through smoke, most often first."""
    groups: dict[str, list[str]] = {}
    drives = {sensor: summaries["smoke_corridor", sensor].success for sensor in SENSORS}
    for sensor in sorted(drives, key=lambda each: -drives[each].value):
        share = drives[sensor]
        told = "none" if share.value == 0 else successes(share)
        groups.setdefault(told, []).append(sensor)
    (most, first), *rest = groups.items()
    verb = "arrives" if len(first) == 1 else "arrive"
    others = (f"{named(sensors)} in {told}" for told, sensors in rest)
    return ", ".join((f"{named(first)} {verb} in {most}", *others))


def _hedge_sentences(summaries: Summaries) -> Iterator[str]:
    """Yield how long the paths are where a gap leads nowhere; nothing if it was not."""
    numbers = _listed(summaries, "dead_end", detour_text)
    if not numbers:
        return
    text = "Where the nearer gap in a hedge leads nowhere, "
    if told := _against_lasers(summaries):
        text += f"the radar's path is {told}; "
    yield f"{text}path / shortest path: {numbers}."


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
    """Return names in backquotes as ``a``, ``b`` and ``c``."""
    *others, last = (f"`{sensor}`" for sensor in sensors)
    return f"{', '.join(others)} and {last}" if others else last


def _listed(summaries: Summaries, map_: str, tell: Callable[[Summary], str]) -> str:
    """Return what there is to tell of each sensor on a map; empty if nothing."""
    texts = (
        (sensor, tell(summaries[map_, sensor]))
        for sensor in SENSORS
        if (map_, sensor) in summaries
    )
    return ", ".join(f"`{sensor}` {text}" for sensor, text in texts if text)


def _arrivals(summary: Summary) -> str:
    text = f"{successes(summary.success)}{_in_brackets(summary.success)}"
    if summary.false_no_path:
        text += f' with a false "no path" in {summary.false_no_path}'
    return text


def _loss_sentences(summaries: Summaries) -> Iterator[str]:
    """Yield where a laser does better, clearly or perhaps."""
    losses = list(find_losses(summaries))
    if not any(summary.success.has_interval for summary in summaries.values()):
        told = [loss for _, loss in losses]
        behind = "; ".join(told) if told else "nowhere"
        yield f"In this one run of each, the radar is behind the best laser: {behind}."
        return
    for clearly, text in (
        (True, "The radar loses where the intervals do not overlap"),
        (False, "It is behind the best laser, within the intervals"),
    ):
        told = [loss for is_clear, loss in losses if is_clear is clearly]
        yield f"{text}: {'; '.join(told) if told else 'nowhere'}."


def find_losses(summaries: Summaries) -> Iterator[tuple[bool, str]]:
    """Yield where the best laser does better than the radar.

    Yields:
        Whether their intervals do not overlap, and the place with both values.
    """
    for measure in MEASURES:
        for map_ in (map_ for map_ in measure.maps if (map_, RADAR) in summaries):
            radar = measure.of(summaries[map_, RADAR])
            best = _best_lasers(summaries, measure, map_)
            if radar is None or best is None:
                continue
            lasers, laser = best
            if not _is_better(measure, laser, radar):
                continue
            runs = summaries[map_, RADAR].success.count
            yield (
                _apart(laser, radar),
                f"{measure.name} in {TITLES[map_]}, {_written(measure, radar, runs)}"
                f" against {_written(measure, laser, runs)} with {lasers}",
            )


def _best_lasers(
    summaries: Summaries, measure: Measure, map_: str
) -> tuple[str, Estimate] | None:
    """Return the names of all lasers that seem the best, and the best estimate."""
    found = {
        sensor: estimate
        for sensor in LASERS
        if (estimate := measure.of(summaries[map_, sensor])) is not None
    }
    if not found:
        return None
    sign = 1 if measure.more_is_better else -1
    best = max(found.values(), key=lambda each: sign * each.value)
    ties = [s for s in found if round(found[s].value - best.value, 2) == 0]
    return ("every laser" if len(ties) == len(LASERS) else named(ties)), best


def _written(measure: Measure, estimate: Estimate, runs: int) -> str:
    if measure.more_is_better:
        return percent(estimate)
    return f"{estimate.value:.2f}{_of_fewer(estimate, runs)}"


def _is_better(measure: Measure, one: Estimate, other: Estimate) -> bool:
    """Return whether an estimate is better by what is told of it, two digits."""
    sign = 1 if measure.more_is_better else -1
    return round(sign * (one.value - other.value), 2) > 0


def _apart(one: Estimate, other: Estimate) -> bool:
    if not (one.has_interval and other.has_interval):
        return False
    return one.low > other.high or one.high < other.low


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


def detour_text(summary: Summary) -> str:
    """Return path / shortest path with its interval; empty if no drive arrived.

    The number of drives is told where not all of them arrived.
    """
    return number_text(summary.detour, summary, "{:.2f}")


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


def _told(estimate: Estimate | None) -> str:
    return "" if estimate is None else f"{percent(estimate)}{_in_brackets(estimate)}"


def _in_brackets(estimate: Estimate) -> str:
    """Return the interval of a share after a blank; empty if there is none."""
    text = percent_interval(estimate)
    return f" ({text})" if text else ""


def percent_interval(estimate: Estimate) -> str:
    """Return the interval of a share as ``72 to 100 %``; empty if there is none."""
    if estimate.is_exact:
        return ""
    return f"{_hundredths(estimate.low)} to {_hundredths(estimate.high)} %"
