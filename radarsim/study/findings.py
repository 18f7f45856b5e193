"""What the study has found, in sentences: where the radar wins, and where it loses."""

from collections.abc import Callable, Iterator
from typing import Final

from radarsim.study.results import MEASURES, TITLES, Measure, Summaries, Summary
from radarsim.study.statistics import Estimate
from radarsim.study.tasks import SENSORS

RADAR: Final = "radar"
LASERS: Final = tuple(sensor for sensor in SENSORS if sensor != RADAR)


def summary_sentences(summaries: Summaries) -> list[str]:
    """Return the study's summary: smoke, hidden floor, the dead end, and losses."""
    smoke = _listed(summaries, "smoke_corridor", _arrivals)
    hidden = _listed(summaries, "hidden_room", lambda each: _told(each.hidden))
    path = _listed(summaries, "dead_end", lambda each: ratio(each.detour))
    found = (
        ("Through smoke, these arrive without a touch", smoke),
        ("Of the floor behind bushes that no robot can pass, these map", hidden),
        (
            "Where a gap in a hedge leads nowhere, the path is longer than the shortest"
            " by these factors",
            path,
        ),
    )
    told = [f"{text}: {numbers}." for text, numbers in found if numbers]
    return [*told, *_loss_sentences(summaries)]


def headline(summaries: Summaries) -> str:
    """Return what the figure shows first."""
    smoke = summaries["smoke_corridor", RADAR].success
    through = f"hrough smoke the radar arrives in {successes(smoke)} runs"
    radar, laser = (_most_hidden(summaries, each) for each in ((RADAR,), LASERS))
    if radar is None or laser is None:
        return f"T{through}"
    return (
        f"Behind bushes the radar maps {percent(radar)} of the floor, lasers map"
        f" {percent(laser)};\nt{through}"
    )


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
            best = _best_laser(summaries, measure, map_)
            if radar is None or best is None:
                continue
            sensor, laser = best
            if not _is_better(measure, laser, radar):
                continue
            write = percent if measure.more_is_better else ratio_value
            yield (
                _apart(laser, radar),
                f"{measure.name} in {TITLES[map_]}, {write(radar)} against"
                f" {write(laser)} with `{sensor}`",
            )


def _best_laser(
    summaries: Summaries, measure: Measure, map_: str
) -> tuple[str, Estimate] | None:
    found = [
        (sensor, estimate)
        for sensor in LASERS
        if (estimate := measure.of(summaries[map_, sensor])) is not None
    ]
    sign = 1 if measure.more_is_better else -1
    return max(found, key=lambda each: sign * each[1].value) if found else None


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
    return f"{100 * estimate.value:.0f} %"


def ratio_value(estimate: Estimate) -> str:
    """Return an estimate as ``1.08``."""
    return f"{estimate.value:.2f}"


def ratio(estimate: Estimate | None) -> str:
    """Return a ratio with its interval; empty if there is none."""
    if estimate is None:
        return ""
    if not estimate.has_interval:
        return ratio_value(estimate)
    return f"{estimate.value:.2f} ({estimate.low:.2f} to {estimate.high:.2f})"


def _told(estimate: Estimate | None) -> str:
    return "" if estimate is None else f"{percent(estimate)}{_in_brackets(estimate)}"


def _in_brackets(estimate: Estimate) -> str:
    """Return the interval of a share after a blank; empty if there is none."""
    text = percent_interval(estimate)
    return f" ({text})" if text else ""


def percent_interval(estimate: Estimate) -> str:
    """Return the interval of a share as ``72 to 100 %``; empty if there is none."""
    if not estimate.has_interval:
        return ""
    return f"{100 * estimate.low:.0f} to {100 * estimate.high:.0f} %"
