"""What the runs of the study add up to, for each map and sensor.

All estimates have intervals of 95 %, see ``evaluation.estimates``.
"""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Final, TypeAlias

from radarsim.autonomy.evaluation.estimates import Estimate, mean, share
from radarsim.lab.study.maps import KINDS, MAPPED, MAPPING, RADAR, SENSORS

Row = Mapping[str, Any]
TITLES: Final = {
    "smoke_corridor": "a corridor full of smoke",
    "hidden_room": "a room behind bushes",
    "dead_end": "a hedge with a dead end",
    "thin_bushes": "thin bushes",
    "forest": "a forest",
    "office": "an office",
}
_STANDING: Final = 0.05  # m; a robot that drives less has stayed where it was


@dataclass(frozen=True, slots=True)
class Summary:
    """The runs of one sensor on one kind of map.

    Attributes:
        map: Kind of the map.
        sensor: Name of the sensor.
        success: Share of the drives that ended rightly and touched nothing.
        false_no_path: Number of drives that told there is no path where there is one.
        failures: How many drives ended without a verdict, by the reason in words.
        touches: How often the robot began to touch something, in all runs.
        detour: Path divided by the shortest one, of drives that arrived; None if none
            did.
        detour_difference: ``detour`` less that of the radar on the same map, where both
            arrived; None for the radar itself, and if they never did.
        time: Simulated time of drives that arrived, s; None if none did.
        reachable: Known share of the floor that the robot can get to; None where
            nothing was mapped.
        hidden: Known share of the floor that it sees at most; None as above, or where
            there is none.
        in_place: Share of the mapped obstacles within two cells of a true one; None as
            above.
        explorations: Number of explorations.
        timed_out: Number of those that ended at the time limit.
        shut_in: Known share of the floor that the robot can get to, by seed, where an
            exploration ended before the time limit and the drive on the same map told
            falsely, where it stood, that there is no path.
    """

    map: str
    sensor: str
    success: Estimate
    false_no_path: int
    failures: Mapping[str, int]
    touches: int
    detour: Estimate | None
    detour_difference: Estimate | None
    time: Estimate | None
    reachable: Estimate | None
    hidden: Estimate | None
    in_place: Estimate | None
    explorations: int
    timed_out: int
    shut_in: Mapping[int, float]

    @property
    def failed(self) -> int:
        """Number of drives that ended without a verdict."""
        return sum(self.failures.values())


Summaries: TypeAlias = Mapping[tuple[str, str], Summary]  # by map and sensor


@dataclass(frozen=True, slots=True)
class Measure:
    """One thing that sensors are compared by.

    Attributes:
        name: Its name, in words.
        of: Returns the estimate of a summary; None where there is none.
        more_is_better: Whether a larger value is better.
        maps: Kinds of maps that it is of.
    """

    name: str
    of: Callable[[Summary], Estimate | None]
    more_is_better: bool
    maps: tuple[str, ...]


MEASURES: Final = (
    Measure("right verdicts", lambda each: each.success, True, KINDS),
    Measure("path / shortest path", lambda each: each.detour, False, KINDS),
    Measure("reachable floor mapped", lambda each: each.reachable, True, MAPPED),
    Measure("hidden floor mapped", lambda each: each.hidden, True, ("hidden_room",)),
    Measure("obstacles in place", lambda each: each.in_place, True, MAPPED),
)


def summarise(rows: Sequence[Row]) -> dict[tuple[str, str], Summary]:
    """Return the summary of each kind of map and sensor that was run."""
    summaries = {}
    for map_, sensor in product(KINDS, SENSORS):
        own = [row for row in rows if (row["map"], row["sensor"]) == (map_, sensor)]
        radar = [row for row in rows if (row["map"], row["sensor"]) == (map_, RADAR)]
        if own:
            summaries[map_, sensor] = _summary(map_, sensor, own, _detours(radar))
    return summaries


def bare_title(kind: str) -> str:
    """Return the title of a kind of maps without its article."""
    return TITLES[kind].removeprefix("a ").removeprefix("an ")


def kinds_of(summaries: Summaries) -> list[str]:
    """Return the kinds of maps that were run, in the order of the study."""
    run = {map_ for map_, _ in summaries}
    return [map_ for map_ in KINDS if map_ in run]


def _summary(
    map_: str, sensor: str, rows: Sequence[Row], radar: Mapping[int, float]
) -> Summary:
    drives = [row for row in rows if row["method"] != MAPPING]
    maps = [row for row in rows if row["method"] == MAPPING]
    # Its hull may pass where the disc does not.
    right = [row for row in drives if row["outcome"] in (row["expected"], "reached")]
    arrived = [row for row in right if row["outcome"] == "reached"]
    told_falsely = [
        row
        for row in drives
        if (row["outcome"], row["expected"]) == ("no_path", "reached")
    ]
    detours = _detours(rows)
    # Pairs of the same map: maps differ among themselves far more than sensors do on
    # one.
    both = sorted(detours.keys() & radar.keys()) if sensor != RADAR else []
    # told falsely where it stood: the robot was shut in from the start
    standing = {r["seed"] for r in told_falsely if r["path_length"] < _STANDING}
    return Summary(
        map=map_,
        sensor=sensor,
        success=share(sum(not row["collisions"] for row in right), len(drives)),
        false_no_path=len(told_falsely),
        failures=Counter(filter(None, map(_failure, drives))),
        touches=sum(row["collisions"] for row in rows),
        detour=_mean(list(detours.values())),
        detour_difference=_mean(
            # Rounded, so that equal paths differ by 0 and not by an error of the
            # division.
            [round(detours[each] - radar[each], 6) for each in both]
        ),
        time=_mean([row["time"] for row in arrived]),
        reachable=_mean_share(maps, "reachable_coverage"),
        hidden=_mean_share(maps, "hidden_coverage"),
        in_place=_mean_share(maps, "within_two_cells"),
        explorations=len(maps),
        timed_out=sum(row["outcome"] == "time_limit" for row in maps),
        shut_in={
            row["seed"]: row["reachable_coverage"]
            for row in maps
            if row["seed"] in standing
            and row["outcome"] == "explored"
            and row["reachable_coverage"] is not None
        },
    )


def _detours(rows: Sequence[Row]) -> dict[int, float]:
    """Return path / shortest path of the drives that arrived, by seed."""
    return {
        row["seed"]: row["path_length"] / row["shortest_path"]
        for row in rows
        if row["method"] != MAPPING and row["outcome"] == "reached" == row["expected"]
    }


def _failure(row: Row) -> str | None:
    """Return why a drive has no verdict, in words; None if it has one."""
    if row["outcome"] in ("reached", "no_path"):
        return None
    if row["outcome"] == "too_near":
        return "would not start"
    if row["note"].startswith("not there after"):
        return "was not there in time"
    stays = row["note"].startswith("the robot stays")
    return "got stuck" if stays else "failed otherwise"


def _mean_share(rows: Sequence[Row], key: str) -> Estimate | None:
    estimate = _mean([row[key] for row in rows if row[key] is not None])
    return None if estimate is None else estimate.within(0.0, 1.0)


def _mean(values: Sequence[float]) -> Estimate | None:
    return mean(values) if values else None
