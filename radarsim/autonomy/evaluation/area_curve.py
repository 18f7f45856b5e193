"""Known area over time and path: how fast an exploration is.

The map itself tells the area that is sensed. With a scene it is also known which floor
the robot can get to, and when some share of that was known.
"""

import math
from typing import Any, Final, NamedTuple

from radarsim.autonomy.evaluation.map_score import FloorPart
from radarsim.autonomy.mapping.occupancy_grid import OccupancyGrid
from radarsim.autonomy.navigation.runner import TripMeter

INTERVAL: Final = 1.0  # s between two samples
MOST_SAMPLES: Final = 200  # that are kept; beyond it every second one
SHARES: Final = (0.5, 0.9, 0.99)  # of the floor within reach


class Sample(NamedTuple):
    """What was known at one moment of a run.

    Attributes:
        time: s.
        path_length: Length of the estimated path, m.
        area: Area that is sensed, m².
        reachable: Known share of the floor that the robot can get to; nan if it is not
            known which that is.
    """

    time: float
    path_length: float
    area: float
    reachable: float


class AreaCurve:
    """Samples of a run.

    Attributes:
        samples: In the order of time.
        reached: The first sample at which each of ``SHARES`` was known.
        floor: The floor that the robot can get to; None if that is not known.
    """

    def __init__(self) -> None:
        self.samples: list[Sample] = []
        self.reached: dict[float, Sample] = {}
        self.floor: FloorPart | None = None
        self._interval = INTERVAL
        self._due = -math.inf

    def add(self, trip: TripMeter, grid: OccupancyGrid, *, last: bool = False) -> None:
        """Add a sample, if it is time to.

        Args:
            trip: Time and path so far.
            grid: The map.
            last: Whether it is the last one, which is always added.
        """
        if trip.time < self._due and not last:
            return
        self._due = trip.time + INTERVAL - 1e-9  # times are sums
        cells = int(grid.sensed_cells().sum())
        share = None if self.floor is None else self.floor.coverage(grid)
        sample = Sample(
            trip.time,
            trip.length,
            cells * grid.frame.resolution**2,
            math.nan if share is None else share,
        )
        for each in SHARES:
            if sample.reachable >= each:
                self.reached.setdefault(each, sample)
        if last and self.samples and self.samples[-1].time == sample.time:
            del self.samples[-1]  # what was known at that scan before the run ended
        # all are looked at, but not all are kept
        before = self.samples[-1].time if self.samples else -math.inf
        if last or sample.time >= before + self._interval - 1e-9:
            self.samples.append(sample)
        if len(self.samples) > MOST_SAMPLES:
            self.samples = self.samples[::2]
            self._interval *= 2

    def to_dict(self) -> dict[str, list[float]]:
        """Return the samples for JSON, by columns; that of shares if they are known."""
        columns: dict[str, list[float]] = {
            "time": [round(each.time, 2) for each in self.samples],
            "path_length": [round(each.path_length, 2) for each in self.samples],
            "area": [round(each.area, 2) for each in self.samples],
        }
        if any(math.isfinite(each.reachable) for each in self.samples):
            shares = [round(each.reachable, 4) for each in self.samples]
            columns["reachable_coverage"] = shares
        return columns

    def reached_to_dict(self) -> dict[str, dict[str, Any] | None]:
        """Return for JSON when each share was known; None for those that were not."""
        found: dict[str, dict[str, Any] | None] = {}
        for share in SHARES:
            sample = self.reached.get(share)
            found[f"{share:g}"] = sample and {
                "time": round(sample.time, 2),
                "path_length": round(sample.path_length, 2),
            }
        return found
