"""One mapping run: the exploration of one robot or several, its server, its result.

The server is either one in this process, which runs in lockstep with the clients and
whose scene the map is compared with, or one that listens on a TCP port.
"""

import json
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from radarsim.autonomy.evaluation.area_curve import AreaCurve
from radarsim.autonomy.evaluation.map_score import (
    FloorPart,
    MapScore,
    robot_and_sensor,
    score_mapper,
)
from radarsim.autonomy.evaluation.navigation_run import (
    INTERRUPTED,
    GroundTruthMonitor,
    rounded,
)
from radarsim.autonomy.exploration.exploration import (
    Exploration,
    ExplorationStep,
    Outcome,
)
from radarsim.autonomy.exploration.multi_robot import MultiRobotExploration, Observer
from radarsim.autonomy.exploration.plans import ExplorationPlan
from radarsim.autonomy.mapping.mapper import Mapper
from radarsim.autonomy.mapping.occupancy_grid import CellClass
from radarsim.autonomy.mapping.trajectory import (
    Trajectory,
    TrajectoryErrors,
    trajectory_errors,
)
from radarsim.autonomy.navigation.runner import TripMeter
from radarsim.client import Client
from radarsim.geometry import Pose2
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
        area_curve: Known area over time and path.
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
    area_curve: AreaCurve = field(default_factory=AreaCurve)
    files: tuple[Path, ...] = ()
    error: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON, with lengths in mm precision.

        Errors of poses have five digits. A run that ended early is described as far as
        it came.
        """
        left_out = {"no_pose": 0, "no_echoes": 0}
        left_out |= {} if self.mapper is None else self.mapper.left_out
        result: dict[str, Any] = {
            "outcome": self.outcome,
            "strategy": self.strategy,
            "seed_from": self.motion_source,
            "time": round(self.trip.time, 3),
            "path_length": round(self.trip.length, 3),
            "left_out": [[round(x, 3), round(y, 3)] for x, y in self.unreached],
            "safety_distance": rounded(self.safety_distance, 3),
            "scans": 0 if self.mapper is None else self.mapper.scans,
            "scans_left_out": left_out | {"late": self.dropped},
            "loop_closures": 0 if self.mapper is None else self.mapper.slam.closures,
            "cells": _cell_counts(self.mapper),
            "pose_errors": self._pose_errors(),
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
                result["judge"] |= self.score.to_dict()
            if self.area_curve.floor is not None:
                result["judge"]["reached"] = self.area_curve.reached_to_dict()
        return result

    @property
    def robots(self) -> int:
        """Number of robots that explored."""
        return 1

    @property
    def trajectories(self) -> dict[int, Trajectory]:
        """The estimated trajectory of each robot on the map, map frame, from 1."""
        return {} if self.mapper is None else {1: self.mapper.trajectory}

    def _pose_errors(self) -> dict[str, float | None] | None:
        if self.mapper is None:
            return None
        truth, alone = self.mapper.truth, self.mapper.slam.dead_reckoning
        try:
            errors = trajectory_errors(self.mapper.trajectory, truth)
        except ValueError:
            return None
        motion = trajectory_errors(alone, truth).ate if len(alone) else None
        return _describe_errors(errors, motion)

    def to_json(self) -> str:
        """Return the result as one line of JSON."""
        return json.dumps(self.to_dict(), allow_nan=False)


@dataclass(slots=True)
class MultiRobotResult(MappingResult):
    """How a map was made by several robots; ``mapper`` is that of the first one.

    Attributes:
        exploration: The robots, where their maps are, and their errors.
    """

    exploration: MultiRobotExploration | None = None

    @property
    def robots(self) -> int:
        """Number of robots that explored, on the map or not."""
        return len(self._placed())

    @property
    def trajectories(self) -> dict[int, Trajectory]:
        """The trajectory of each robot that is on the map, map frame, from 1."""
        return {
            number: robot.mapper.trajectory.moved_by(frame)
            for number, (robot, frame) in enumerate(self._placed(), 1)
            if robot.mapper is not None and frame is not None
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the result for JSON; counts and paths are those of all robots."""
        # ``super`` without arguments does not work in classes with slots
        result = MappingResult.to_dict(self)
        robots = [
            self._describe(number, robot, frame)
            for number, (robot, frame) in enumerate(self._placed())
        ]
        mappers = [r.mapper for r, _ in self._placed() if r.mapper is not None]
        result["scans"] = sum(mapper.scans for mapper in mappers)
        result["loop_closures"] = sum(mapper.slam.closures for mapper in mappers)
        result["scans_left_out"] |= {
            key: sum(mapper.left_out[key] for mapper in mappers)
            for key in ("no_pose", "no_echoes")
        }
        return {**result, "robots": robots}

    def _pose_errors(self) -> dict[str, float | None] | None:
        pairs = [_errors(robot.mapper, frame) for robot, frame in self._placed()]
        known = [pair for pair in pairs if pair is not None]
        if not known:
            return None
        motions = [motion for _, motion in known if motion is not None]
        motion = _combined(motions).ate if motions else None
        return _describe_errors(_combined([errors for errors, _ in known]), motion)

    def _placed(self) -> list[tuple[Exploration, Pose2 | None]]:
        """Return each robot, and where its map is on the shared one."""
        if self.exploration is None:
            return []
        maps = self.exploration.maps
        # Those that failed before they joined have no map.
        frames = [each.frame for each in maps]
        frames += [None] * (len(self.exploration.robots) - len(frames))
        return list(zip(self.exploration.robots, frames, strict=True))

    def _describe(
        self, number: int, robot: Exploration, frame: Pose2 | None
    ) -> dict[str, Any]:
        assert self.exploration is not None
        pair = _errors(robot.mapper, frame)
        x_y_yaw = None
        if frame is not None:
            x_y_yaw = [round(frame.x, 4), round(frame.y, 4)]
            x_y_yaw.append(round(math.degrees(frame.yaw), 3))
        return {
            "start": robot.plan.start,
            "outcome": robot.outcome.value,
            "path_length": round(robot.trip.length, 3),
            "scans": 0 if robot.mapper is None else robot.mapper.scans,
            "aligned": x_y_yaw,
            "ate": None if pair is None else round(pair[0].ate, 5),
            "error": self.exploration.errors[number] or None,
        }


class _Run:
    """What runs of one robot and of several have in common.

    Attributes:
        connect: Connects to a server that is not in this process, at a host and port.
    """

    def __init__(
        self,
        plan: ExplorationPlan,
        host: Host | None,
        exploration: Exploration | MultiRobotExploration,
        result: MappingResult,
    ) -> None:
        self.connect: Callable[[str, int], Client] = Client.connect
        self._host, self._exploration, self._result = host, exploration, result
        result.robot_class = plan.robot_class
        result.scene = None if host is None else host.simulation.scene

    def judge(self) -> None:
        """Compare the map with the scene, if both are known."""
        result, start = self._result, self._result.trip.start
        mapper, scene, robot = result.mapper, result.scene, result.robot_class
        if scene is None or mapper is None or robot is None or start is None:
            return
        result.score = score_mapper(mapper, scene, robot_class=robot, start=start)

    @contextmanager
    def _completing(self) -> Iterator[None]:
        """Complete the result, however the run ends."""
        result, exploration = self._result, self._exploration
        try:
            yield
        except BaseException as error:
            is_failure = isinstance(error, Exception)
            result.error = str(error) if is_failure else INTERRUPTED
            raise
        finally:
            result.outcome, result.trip = exploration.outcome.value, exploration.trip
            result.mapper, result.unreached = exploration.mapper, exploration.unreached
            result.safety_distance = exploration.safety_distance
            self._note_area(last=True)

    def _note_area(self, *, last: bool = False) -> None:
        """Add to the curve of known area; to be called at every scan."""
        result, exploration = self._result, self._exploration
        mapper, trip = exploration.mapper, exploration.trip
        if mapper is None or trip.start is None:
            return
        curve, scene, robot_class = result.area_curve, result.scene, result.robot_class
        if scene is not None and robot_class is not None and curve.floor is None:
            start = (trip.start.x, trip.start.y)
            radius, height = robot_and_sensor(mapper, scene, robot_class, start)
            curve.floor = FloorPart(
                "reachable",
                scene,
                mapper.grid.frame.resolution,
                start=start,
                robot_radius=radius,
                height=height,
            )
        curve.add(trip, mapper.grid, last=last)

    def _open_client(self, address: tuple[str, int]) -> Client:
        if self._host is None:
            return self.connect(*address)
        result = self._result
        # one monitor for all robots, as it counts what any of them touches
        result.monitor = result.monitor or GroundTruthMonitor(self._host)
        transport = InProcessTransport(self._host, after_tick=result.monitor.watch)
        return Client(transport)


class MappingRun(_Run):
    """Runs an exploration and keeps its result, also of a run that fails.

    Attributes:
        exploration: The exploration.
        result: Result of the run so far; complete once ``run`` has returned or raised.
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
        super().__init__(plan, host, self.exploration, self.result)

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
        result = self.result

        def note(step: ExplorationStep) -> None:
            self._note_area()
            observe(step)

        try:
            with self._completing(), self._open_client(address) as client:
                self.exploration.run(client, note)
        finally:
            # An error before the exploration began, as of the connection, is not told.
            is_interrupted = result.error in ("", INTERRUPTED)
            if result.outcome == Outcome.BROKEN_OFF and not is_interrupted:
                result.outcome = Outcome.FAILED.value


class MultiRobotRun(_Run):
    """Runs several robots and keeps the result, also of a run that fails.

    Attributes:
        exploration: The robots.
        result: Result of the run so far; complete once ``run`` has returned or raised.
    """

    def __init__(
        self, plan: ExplorationPlan, robots: int, host: Host | None = None
    ) -> None:
        """Create a run that has not begun.

        Args:
            plan: The plan of each robot.
            robots: Number of robots.
            host: Server in this process; None for one that listens on a port.

        Raises:
            ValueError: If several robots cannot do what the plan says.
        """
        self.exploration = MultiRobotExploration(plan, robots)
        self.result = MultiRobotResult(plan.strategy.value, plan.motion_source)
        self.result.exploration = self.exploration
        super().__init__(plan, host, self.exploration, self.result)

    def run(
        self, address: tuple[str, int], observe: Observer = lambda *_: None
    ) -> None:
        """Connect, explore, and complete the result, as ``MappingRun.run`` does.

        Args:
            address: Host and port of the server, unless it is in this process.
            observe: Called at every scan with the number of the robot.
        """

        def note(number: int, step: ExplorationStep) -> None:
            self._note_area()
            observe(number, step)

        with self._completing(), ExitStack() as stack:
            robots = self.exploration.robots
            clients = [stack.enter_context(self._open_client(address)) for _ in robots]
            self.exploration.run(clients, note)


def _cell_counts(mapper: Mapper | None) -> dict[str, float] | None:
    if mapper is None or not mapper.scans:
        return None
    counts = np.bincount(mapper.grid.classes().ravel(), minlength=len(CellClass))
    known = [each for each in CellClass if each is not CellClass.UNKNOWN]
    named = {each.name.lower(): int(counts[each]) for each in known}
    return {"resolution": mapper.grid.frame.resolution, **named}


def _describe_errors(
    errors: TrajectoryErrors, motion_ate: float | None
) -> dict[str, float | None]:
    plain: dict[str, float] = asdict(errors)
    plain["motion_ate"] = math.nan if motion_ate is None else motion_ate
    for name in ("yaw", "yaw_max", "rpe_yaw"):
        plain[f"{name}_deg"] = math.degrees(plain.pop(name))
    errors_of_poses: dict[str, float | None] = rounded(plain, 5)
    return errors_of_poses


def _errors(
    mapper: Mapper | None, frame: Pose2 | None
) -> tuple[TrajectoryErrors, TrajectoryErrors | None] | None:
    """Compare a robot's poses, and those of its motion source, with the true ones."""
    if mapper is None or frame is None:
        return None
    alone = mapper.slam.dead_reckoning
    try:
        found = trajectory_errors(mapper.trajectory.moved_by(frame), mapper.truth)
        motion = trajectory_errors(alone, mapper.truth) if len(alone) else None
    except ValueError:
        return None
    return found, motion


def _combined(errors: Sequence[TrajectoryErrors]) -> TrajectoryErrors:
    poses = np.array([each.poses for each in errors])

    def mean_square(name: str) -> float:
        values = np.array([getattr(each, name) for each in errors])
        known = np.isfinite(values)
        if not known.any():
            return math.nan
        # that of all poses, of which each trajectory has another number
        squares = np.square(values[known])
        return math.sqrt(float(np.average(squares, weights=poses[known])))

    whole = asdict(errors[0])
    whole |= {name: mean_square(name) for name in ("ate", "yaw", "rpe", "rpe_yaw")}
    whole |= {
        name: max(getattr(each, name) for each in errors)
        for name in ("ate_max", "yaw_max")
    }
    whole |= {
        "poses": int(poses.sum()),
        "length": sum(each.length for each in errors),
    }
    return TrajectoryErrors(**whole)
