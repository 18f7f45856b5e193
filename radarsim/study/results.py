"""What the runs of the study add up to, for each map and sensor."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Final, TypeAlias

from radarsim.study.maps import KINDS
from radarsim.study.statistics import Estimate, mean, share
from radarsim.study.tasks import MAPPED, MAPPING, SENSORS

Row = Mapping[str, Any]

TITLES: Final = {
    "smoke_corridor": "a corridor full of smoke",
    "hidden_room": "a room behind bushes",
    "dead_end": "a hedge with a dead end",
    "thin_bushes": "thin bushes",
    "forest": "a forest",
    "office": "an office",
}


@dataclass(frozen=True, slots=True)
class Summary:
    """The runs of one sensor on one kind of map.

    Attributes:
        map: Kind of the map.
        sensor: Sensor preset.
        success: Share of the drives that ended rightly and touched nothing.
        false_no_path: Number of drives that told there is no path where there is one.
        failed: Number of drives that ended without a verdict.
        touches: How often the robot began to touch something, in all runs.
        detour: Path divided by the shortest one, of drives that arrived; None if none
            did.
        reachable: Known share of the floor that the robot can get to; None where
            nothing was mapped.
        hidden: Known share of the floor that it sees at most; None as above, or where
            there is none.
        walls: Share of the mapped obstacles within two cells of a true one; None as
            above.
    """

    map: str
    sensor: str
    success: Estimate
    false_no_path: int
    failed: int
    touches: int
    detour: Estimate | None
    reachable: Estimate | None
    hidden: Estimate | None
    walls: Estimate | None


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
    Measure("path by shortest", lambda each: each.detour, False, KINDS),
    Measure("reachable floor mapped", lambda each: each.reachable, True, MAPPED),
    Measure("hidden floor mapped", lambda each: each.hidden, True, ("hidden_room",)),
    Measure("walls in place", lambda each: each.walls, True, MAPPED),
)


def is_right(row: Row) -> bool:
    """Return whether a drive told what is true, and touched nothing."""
    return bool(row["outcome"] == row["expected"] and not row["collisions"])


def summarise(rows: Sequence[Row]) -> dict[tuple[str, str], Summary]:
    """Return the summary of each kind of map and sensor that was run."""
    summaries = {}
    for map_, sensor in product(KINDS, SENSORS):
        own = [row for row in rows if (row["map"], row["sensor"]) == (map_, sensor)]
        if own:
            summaries[map_, sensor] = _summary(map_, sensor, own)
    return summaries


def kinds_of(summaries: Summaries) -> list[str]:
    """Return the kinds of maps that were run, in the order of the study."""
    run = {map_ for map_, _ in summaries}
    return [map_ for map_ in KINDS if map_ in run]


def _summary(map_: str, sensor: str, rows: Sequence[Row]) -> Summary:
    drives = [row for row in rows if row["method"] != MAPPING]
    maps = [row for row in rows if row["method"] == MAPPING]
    arrived = [row for row in drives if row["outcome"] == "reached" == row["expected"]]
    return Summary(
        map=map_,
        sensor=sensor,
        success=share(sum(map(is_right, drives)), len(drives)),
        false_no_path=sum(_verdict(r) == ("no_path", "reached") for r in drives),
        failed=sum(row["outcome"] not in ("reached", "no_path") for row in drives),
        touches=sum(row["collisions"] for row in rows),
        detour=_mean([row["path_length"] / row["shortest_path"] for row in arrived]),
        reachable=_mean_of(maps, "reachable_coverage"),
        hidden=_mean_of(maps, "hidden_coverage"),
        walls=_mean_of(maps, "within_two_cells"),
    )


def _verdict(row: Row) -> tuple[str, str]:
    return row["outcome"], row["expected"]


def _mean_of(rows: Sequence[Row], key: str) -> Estimate | None:
    """Estimate the mean of shares."""
    estimate = _mean([row[key] for row in rows if row[key] is not None])
    return None if estimate is None else estimate.within(0.0, 1.0)


def _mean(values: Sequence[float]) -> Estimate | None:
    return mean(values) if values else None
