"""One mapping run: an exploration, its server, and its evaluated result.

The server is either one in this process, which runs in lockstep with the client and
whose scene the map is compared with, or one that listens on a TCP port.
"""

import json
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from radarsim.autonomy.evaluation.map_score import MapScore, score_mapper
from radarsim.autonomy.evaluation.navigation_run import INTERRUPTED, GroundTruthMonitor
from radarsim.autonomy.exploration.exploration import (
    Exploration,
    ExplorationPlan,
    ExplorationStep,
    Outcome,
)
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.occupancy_grid import CellClass
from radarsim.autonomy.mapping.trajectory import (
    Trajectory,
    TrajectoryErrors,
    trajectory_errors,
)
from radarsim.autonomy.navigation.runner import TripMeter
from radarsim.client import Client
from radarsim.rng import generator_for
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport


@dataclass(slots=True)
class MappingResult:
    """How a map was made, and the result.

    Attributes:
        strategy: Name of the strategy; ``way`` for waypoints, None where another client
            drove.
        motion_source: Where the robot's motion between scans was read from.
        trip: Time and path length of the run.
        mapper: The mapper, which holds the map; None if the robot was never known.
        outcome: How the run ended.
        dropped: Number of scans that were left out, as mapping fell behind.
        unreached: Waypoints that the robot could not reach, m; after exploring, places
            where it would fit, but that it did not reach.
        safety_distance: The robot's safety distance, m; None if another client drove.
        monitor: Monitor of the true robot, if the server was in this process.
        robot_class: Class of the robot; None where another client drove.
        scene: The scene, if the server was in this process.
        score: Comparison of the map with the scene, if the scene is known.
        files: Files that were written.
        error: What went wrong; empty if nothing did.
    """

    strategy: str | None
    motion_source: str
    trip: TripMeter = field(default_factory=TripMeter)
    mapper: Mapper | None = None
    outcome: str = Outcome.BROKEN_OFF.value
    dropped: int = 0
    unreached: tuple[tuple[float, float], ...] = ()
    safety_distance: float | None = None
    monitor: GroundTruthMonitor | None = None
    robot_class: str | None = None
    scene: Scene | None = None
    score: MapScore | None = None
    files: tuple[Path, ...] = ()
    error: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON, with lengths in mm precision.

        Errors of poses have five digits. A run that ended early is described as far as
        it came.
        """
        result: dict[str, Any] = {
            "outcome": self.outcome,
            "strategy": self.strategy,
            "seed_from": self.motion_source,
            "time": round(self.trip.time, 3),
            "path_length": round(self.trip.length, 3),
            "left_out": [[round(x, 3), round(y, 3)] for x, y in self.unreached],
            "safety_distance": _rounded(self.safety_distance, 3),
            "scans": 0 if self.mapper is None else self.mapper.scans,
            "scans_left_out": self._scans_left_out(),
            "loop_closures": 0 if self.mapper is None else self.mapper.slam.closures,
            "cells": _cell_counts(self.mapper),
            "pose_errors": self._pose_errors(),
            "files": [str(file) for file in self.files],
            "error": self.error or None,
        }
        if self.monitor is not None:
            result["judge"] = {
                "path_length": round(self.monitor.path_length, 3),
                "collisions": self.monitor.collisions,
            }
            if self.score is not None:
                result["judge"] |= self.score.to_dict()
        return result

    @property
    def robots(self) -> int:
        """Number of robots that explored."""
        return 1

    @property
    def trajectories(self) -> dict[int, Trajectory]:
        """The estimated trajectory of each robot on the map, map frame, from 1."""
        return {} if self.mapper is None else {1: self.mapper.trajectory}

    @contextmanager
    def noting_errors(self) -> Iterator[None]:
        """Note an error that ends the run, or that it was interrupted."""
        try:
            yield
        except BaseException as error:
            is_failure = isinstance(error, Exception)
            self.error = str(error) if is_failure else INTERRUPTED
            raise

    def judge(self) -> None:
        """Compare the map with the scene, if both are known."""
        mapper, robot, start = self.mapper, self.robot_class, self.trip.start
        if self.scene is None or mapper is None or robot is None or start is None:
            return
        self.score = score_mapper(mapper, self.scene, robot_class=robot, start=start)

    def _pose_errors(self) -> dict[str, float | None] | None:
        """Compare the estimated poses with the true ones that the server sends."""
        if self.mapper is None:
            return None
        truth, alone = self.mapper.truth, self.mapper.slam.dead_reckoning
        try:
            errors = trajectory_errors(self.mapper.trajectory, truth)
        except ValueError:
            return None
        motion = trajectory_errors(alone, truth).ate if len(alone) else None
        return describe_errors(errors, motion)

    def _scans_left_out(self) -> dict[str, int]:
        known = {} if self.mapper is None else self.mapper.left_out
        return {"no_pose": 0, "no_echoes": 0, **known, "late": self.dropped}

    def to_json(self) -> str:
        """Return the result as one line of JSON."""
        return json.dumps(self.to_dict(), allow_nan=False)


class MappingRun:
    """Runs an exploration and keeps its result, also of a run that fails.

    Attributes:
        exploration: The exploration.
        result: Result of the run so far; complete once ``run`` has returned or raised.
        connect: Connects to a server that is not in this process, at a host and port.
    """

    def __init__(
        self, plan: ExplorationPlan, host: Host | None = None, *, seed: int = 0
    ) -> None:
        """Create a run that has not begun.

        Args:
            plan: The plan of the exploration.
            host: Server in this process; None for one that listens on a port.
            seed: Seed of strategies that use chance.
        """
        self.exploration = Exploration(plan, generator_for(seed, "exploring"))
        name = "way" if plan.waypoints else plan.strategy.value
        self.result = MappingResult(name, plan.motion_source)
        self.result.robot_class = plan.robot_class
        self.result.scene = None if host is None else host.simulation.scene
        self.connect: Callable[[str, int], Client] = Client.connect
        self._host = host

    def run(
        self,
        address: tuple[str, int],
        observe: Callable[[ExplorationStep], None] = lambda _: None,
    ) -> None:
        """Connect, explore, and complete the result, however the run ends.

        Args:
            address: Host and port of the server, unless it is in this process.
            observe: Called at every scan.

        Raises:
            ClientError: If the server does not send what is needed.
            MappingError: If no map can be made of what it sends.
            NavigationError: If the robot cannot do what is asked of it.
        """
        try:
            with self.result.noting_errors(), self._connect(address) as client:
                self.exploration.run(client, observe)
        finally:
            self._complete_result()

    def judge(self) -> None:
        """Compare the map with the scene, if both are known."""
        self.result.judge()

    def _connect(self, address: tuple[str, int]) -> Client:
        if self._host is None:
            return self.connect(*address)
        monitor = GroundTruthMonitor(self._host)
        self.result.monitor = monitor
        return Client(InProcessTransport(self._host, after_tick=monitor.watch))

    def _complete_result(self) -> None:
        result, exploration = self.result, self.exploration
        result.outcome, result.trip = exploration.outcome.value, exploration.trip
        result.mapper = exploration.mapper
        result.safety_distance = exploration.safety_distance
        result.unreached = exploration.unreached
        is_interrupted = result.error in ("", INTERRUPTED)
        if exploration.outcome is Outcome.BROKEN_OFF and not is_interrupted:
            result.outcome = Outcome.FAILED.value


def _cell_counts(mapper: Mapper | None) -> dict[str, float] | None:
    if mapper is None or not mapper.scans:
        return None
    counts = np.bincount(mapper.grid.classes().ravel(), minlength=len(CellClass))
    known = [each for each in CellClass if each is not CellClass.UNKNOWN]
    named = {each.name.lower(): int(counts[each]) for each in known}
    return {"resolution": mapper.grid.frame.resolution, **named}


def describe_errors(
    errors: TrajectoryErrors, motion_ate: float | None
) -> dict[str, float | None]:
    """Return errors of poses for JSON.

    Args:
        errors: The errors.
        motion_ate: Absolute error by the motion source alone, m; None without one.
    """
    plain: dict[str, float] = asdict(errors)
    plain["motion_ate"] = math.nan if motion_ate is None else motion_ate
    for name in ("yaw", "yaw_max", "rpe_yaw"):
        plain[f"{name}_deg"] = math.degrees(plain.pop(name))
    return {name: _rounded(value, 5) for name, value in plain.items()}


def _rounded(value: float | None, digits: int) -> float | None:
    if value is None or not math.isfinite(value):
        return None
    return round(value, digits)
