"""One mapping run: a robot explores on a server, and its map is judged.

The server is either in this process, in lockstep with the client, so that the map can
be compared with the scene, or it listens on a TCP port.

A curve of the known area over time shows the speed of the exploration. The sensed area
comes from the map itself. With a scene, the curve also shows the known share of the
reachable floor, and the result shows when given shares were known.
"""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from radarsim.autonomy.evaluation.map_score import (
    FloorPart,
    Score,
    robot_and_sensor,
    score_map,
)
from radarsim.autonomy.evaluation.navigation_run import INTERRUPTED, GroundTruthMonitor
from radarsim.autonomy.exploration.exploration import Exploration, Outcome
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.occupancy_grid import CellClass, OccupancyGrid
from radarsim.autonomy.mapping.trajectory import trajectory_errors
from radarsim.autonomy.navigation.run_log import rounded
from radarsim.autonomy.navigation.runner import TripMeter
from radarsim.autonomy.plans import ExplorationPlan
from radarsim.autonomy.watching import WatchMapper
from radarsim.client import Client
from radarsim.rng import generator_for
from radarsim.server.host import Host

INTERVAL: Final = 1.0  # s between two samples of the known area
MOST_SAMPLES: Final = 200  # samples; if there are more, every second one is dropped
SHARES: Final = (0.5, 0.9, 0.99)  # shares of the reachable floor to report
MANY_SEEN_ONCE: Final = 0.3  # share of walls above which a doubt is reported


class Sample(NamedTuple):
    """The size of the area that a mapping run knows at one time.

    Attributes:
        time: Time since the first scan, s.
        path_length: Length of the estimated path, m.
        area: Sensed area, m².
        reachable: Known share of the reachable floor; nan if the reachable floor is
            unknown.
    """

    time: float
    path_length: float
    area: float
    reachable: float


class AreaCurve:
    """The size of the known area over the time and the path length of a mapping run.

    Attributes:
        samples: Samples in the order of time.
        reached: Time and path length at which each of ``SHARES`` was known, for JSON;
            None for shares that were not reached.
        floor: The reachable floor; None if it is unknown.
    """

    def __init__(self) -> None:
        self.samples: list[Sample] = []
        self.reached: dict[str, dict[str, float] | None] = dict.fromkeys(
            f"{share:g}" for share in SHARES
        )
        self.floor: FloorPart | None = None
        self._interval = INTERVAL
        self._due = -math.inf

    def add(self, trip: TripMeter, grid: OccupancyGrid, *, last: bool = False) -> None:
        """Add a sample of the known area, if one is due.

        Args:
            trip: Time and path so far.
            grid: The map.
            last: Whether it is the last sample, which is always added.
        """
        if trip.time < self._due and not last:
            return
        self._due = trip.time + INTERVAL - 1e-9  # tolerance, since times are sums
        area = int(grid.sensed_cells().sum()) * grid.frame.resolution**2
        share = math.nan if self.floor is None else self.floor.coverage(grid)
        sample = Sample(trip.time, trip.length, area, share)
        for each in SHARES:
            if sample.reachable >= each and self.reached[f"{each:g}"] is None:
                time, length = round(sample.time, 2), round(sample.path_length, 2)
                self.reached[f"{each:g}"] = {"time": time, "path_length": length}
        if last and self.samples and self.samples[-1].time == sample.time:
            del self.samples[-1]  # the sample of the same scan before the run ended
        # The times above are updated by every sample. Only some samples are stored,
        # which limits the size of the result.
        before = self.samples[-1].time if self.samples else -math.inf
        if last or sample.time >= before + self._interval - 1e-9:
            self.samples.append(sample)
        if len(self.samples) > MOST_SAMPLES:
            self.samples = self.samples[::2]
            self._interval *= 2

    def to_dict(self) -> dict[str, list[float]]:
        """Return the samples as columns for JSON, without shares if none is known."""
        digits = {"time": 2, "path_length": 2, "area": 2, "reachable": 4}
        columns = {
            name: [round(getattr(each, name), places) for each in self.samples]
            for name, places in digits.items()
        }
        shares = columns.pop("reachable")
        if any(map(math.isfinite, shares)):
            columns["reachable_coverage"] = shares
        return columns


class MappingRun:
    """A mapping run and its result, which remains available after an error.

    Attributes:
        source: The source of the map: an exploration, or the watcher of a robot that
            another client drives.
        strategy: Name of the strategy; ``way`` for waypoints, None where another client
            drives.
        robot_class: Class of the robot; None where another client drives.
        scene: The scene, if the server is in this process.
        monitor: Ground truth monitor, if the server is in this process.
        score: Comparison of the map with the scene, if the scene is known.
        area_curve: Known area over time and path.
        files: Written files.
        error: Error message; empty without an error.
    """

    def __init__(
        self,
        plan: ExplorationPlan,
        host: Host | None = None,
        *,
        seed: int = 0,
        watched: WatchMapper | None = None,
    ) -> None:
        """Create a run.

        Args:
            plan: The plan of the exploration, or of the map of a watched robot.
            host: Server in this process; None for a server that listens on a port.
            seed: Seed of strategies that use chance.
            watched: The watcher that maps a robot of another client; None to explore.
        """
        self.source: Exploration | WatchMapper
        self.source = watched or Exploration(plan, generator_for(seed, "exploring"))
        self.strategy, self.robot_class = None, None
        if watched is None:
            self.strategy = "way" if plan.waypoints else plan.strategy.value
            self.robot_class = plan.robot_class
        self.scene = None if host is None else host.simulation.scene
        self.monitor = None if host is None else GroundTruthMonitor(host)
        self.score: Score | None = None
        self.area_curve = AreaCurve()
        self.files: tuple[Path, ...] = ()
        self.error = ""
        self._motion_source = plan.motion_source

    def run(
        self,
        observe: Callable[[str], None] = lambda _: None,
        connect: Callable[[], Client] = Client.connect,
    ) -> None:
        """Connect and explore; complete the result even after an error.

        Args:
            observe: Called at every scan with the activity of the strategy in one word.
            connect: Connects to the server, unless it is in this process.

        Raises:
            ClientError: If the server does not send required reports.
            MappingError: If no map can be made from the reports.
            NavigationError: If the robot cannot carry out the plan, or gets stuck.
        """
        exploration, monitor = self.source, self.monitor
        assert isinstance(exploration, Exploration)

        def note(activity: str) -> None:
            self._note_area()
            observe(activity)

        try:
            with connect() if monitor is None else monitor.open_client() as client:
                exploration.run(client, note)
        except BaseException as error:
            is_failure = isinstance(error, Exception)
            self.error = str(error) if is_failure else INTERRUPTED
            raise
        finally:
            self._note_area(last=True)
            # The outcome does not include errors before the exploration started, such
            # as connection errors.
            is_interrupted = self.error in ("", INTERRUPTED)
            if exploration.outcome == Outcome.BROKEN_OFF and not is_interrupted:
                exploration.outcome = Outcome.FAILED

    def judge(self) -> None:
        """Compare the map with the scene, if both are available."""
        mapper, scene, robot = self.source.mapper, self.scene, self.robot_class
        start = self.source.trip.start
        if scene is None or mapper is None or robot is None or start is None:
            return
        place = start.x, start.y
        radius, height = robot_and_sensor(mapper, scene, robot, place)
        self.score = score_map(mapper.grid, scene, place, radius, height)

    def _note_area(self, *, last: bool = False) -> None:
        """Update the curve of known area; called at every scan."""
        mapper, trip, curve = self.source.mapper, self.source.trip, self.area_curve
        if mapper is None or trip.start is None:
            return
        scene, robot_class = self.scene, self.robot_class
        if scene is not None and robot_class is not None and curve.floor is None:
            start = (trip.start.x, trip.start.y)
            curve.floor = FloorPart("reachable", mapper, scene, robot_class, start)
        curve.add(trip, mapper.grid, last=last)

    @property
    def doubts(self) -> list[str]:
        """Reasons why the map may be wrong, found without the ground truth."""
        mapper = self.source.mapper
        if mapper is None or not mapper.scans:
            return []
        doubts = []
        share = mapper.seen_from_one_place
        if share > MANY_SEEN_ONCE:
            seen = f"{share:.0%} of the walls were seen from only one place"
            doubts.append(f"{seen}: some may be images in mirrors or glass")
        if self._motion_source == "none":
            known = "poses are known from scans alone"
            doubts.append(f"{known}, which round halls and long corridors mislead")
        return doubts

    def to_dict(self) -> dict[str, Any]:
        """Return the result of the run for JSON, with lengths rounded to 1 mm.

        Errors of poses have five digits. A run that ended early has the values up to
        its end.
        """
        source, mapper = self.source, self.source.mapper
        left_out = {"no_pose": 0, "no_echoes": 0}
        left_out |= {} if mapper is None else mapper.left_out
        result: dict[str, Any] = {
            "outcome": source.outcome,
            "doubts": self.doubts,
            "strategy": self.strategy,
            "seed_from": self._motion_source,
            "time": round(source.trip.time, 3),
            "path_length": round(source.trip.length, 3),
            "left_out": [[round(x, 3), round(y, 3)] for x, y in source.unreached],
            "safety_distance": rounded(source.safety_distance, 3),
            "scans": 0 if mapper is None else mapper.scans,
            "scans_left_out": left_out | {"late": 0},  # dropped by the server
            "loop_closures": 0 if mapper is None else mapper.slam.closures,
            "cells": _cell_counts(mapper),
            "pose_errors": _pose_errors(mapper),
            "area_over_time": self.area_curve.to_dict(),
            "files": [str(file) for file in self.files],
            "error": self.error or None,
        }
        if self.monitor is not None:
            result["judge"] = {
                "path_length": round(self.monitor.path_length, 3),
                "collisions": self.monitor.collisions,
            }
            if self.score is not None:
                result["judge"] |= rounded(self.score, 4)
            if self.area_curve.floor is not None:
                result["judge"]["reached"] = self.area_curve.reached
        return result

    def to_json(self) -> str:
        """Return the result as one line of JSON."""
        return json.dumps(self.to_dict(), allow_nan=False)


def _pose_errors(mapper: Mapper | None) -> dict[str, float | None] | None:
    if mapper is None:
        return None
    truth, alone = mapper.truth, mapper.slam.dead_reckoning
    try:
        errors = trajectory_errors(mapper.trajectory, truth)
    except ValueError:
        return None
    motion = trajectory_errors(alone, truth)["ate"] if len(alone) else math.nan
    plain = {**errors, "motion_ate": motion}
    for name in ("yaw", "yaw_max", "rpe_yaw"):
        plain[f"{name}_deg"] = math.degrees(plain.pop(name))
    values: dict[str, float | None] = rounded(plain, 5)
    return values


def _cell_counts(mapper: Mapper | None) -> dict[str, float] | None:
    if mapper is None or not mapper.scans:
        return None
    counts = np.bincount(mapper.grid.classes().ravel(), minlength=len(CellClass))
    known = [each for each in CellClass if each is not CellClass.UNKNOWN]
    named = {each.name.lower(): int(counts[each]) for each in known}
    return {"resolution": mapper.grid.frame.resolution, **named}
