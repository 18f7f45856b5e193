"""One mapping run of several robots, each by a connection of its own.

The server is either one in this process, in which all robots drive in lockstep, or one
that listens on a TCP port.
"""

import math
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from radarsim.autonomy.evaluation.mapping_run import MappingResult, describe_errors
from radarsim.autonomy.evaluation.navigation_run import GroundTruthMonitor
from radarsim.autonomy.exploration.exploration import Exploration, ExplorationPlan
from radarsim.autonomy.exploration.multi_robot import MultiRobotExploration, Observer
from radarsim.autonomy.mapping.trajectory import (
    Trajectory,
    TrajectoryErrors,
    trajectory_errors,
)
from radarsim.client import Client
from radarsim.geometry import Pose2
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport


class MultiRobotMonitor(GroundTruthMonitor):
    """Watches all robots of a simulation, tick by tick.

    Attributes:
        collisions: How often a robot began to touch something, or another robot.
        path_length: Length of all true paths, m.
    """

    def __init__(self, host: Host) -> None:
        super().__init__(host)
        self._poses: dict[int, Pose2] = {}
        self._touches: dict[int, bool] = {}

    def watch(self) -> None:
        """Update from the simulation; to be called after every tick."""
        for vehicle in self._simulation.vehicles:
            number, pose = vehicle.number, vehicle.robot.pose
            touches = vehicle.robot.touched
            self.collisions += touches and not self._touches.get(number, False)
            previous = self._poses.get(number, pose)
            self.path_length += math.hypot(pose.x - previous.x, pose.y - previous.y)
            self._poses[number], self._touches[number] = pose, touches


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
        pairs = [_errors(robot, frame) for robot, frame in self._placed()]
        known = [pair for pair in pairs if pair is not None]
        if not known:
            return None
        motions = [motion for _, motion in known if motion is not None]
        motion = _combined(motions).ate if motions else None
        return describe_errors(_combined([errors for errors, _ in known]), motion)

    def _placed(self) -> list[tuple[Exploration, Pose2 | None]]:
        """Return each robot, and where its map is on the shared one."""
        if self.exploration is None:
            return []
        maps = self.exploration.maps
        frames = [each.frame for each in maps]
        frames += [None] * (len(self.exploration.robots) - len(frames))
        return list(zip(self.exploration.robots, frames, strict=True))

    def _describe(
        self, number: int, robot: Exploration, frame: Pose2 | None
    ) -> dict[str, Any]:
        assert self.exploration is not None
        pair = _errors(robot, frame)
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


class MultiRobotRun:
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
        self.result.robot_class = plan.robot_class
        self.result.exploration = self.exploration
        self.result.scene = None if host is None else host.simulation.scene
        self._host = host

    def run(
        self, address: tuple[str, int], observe: Observer = lambda *_: None
    ) -> None:
        """Connect, explore, and complete the result, however the run ends.

        Args:
            address: Host and port of the server, unless it is in this process.
            observe: Called at every scan with the number of the robot.

        Raises:
            ClientError: If the server does not send what is needed.
            MappingError: If no map can be made of what it sends.
            NavigationError: If no robot can do what is asked of it.
        """
        try:
            with self.result.noting_errors(), ExitStack() as stack:
                clients = [
                    stack.enter_context(client) for client in self._connect(address)
                ]
                self.exploration.run(clients, observe)
        finally:
            self._complete_result()

    def judge(self) -> None:
        """Compare the map with the scene, if both are known."""
        self.result.judge()

    def _connect(self, address: tuple[str, int]) -> list[Client]:
        numbers = range(len(self.exploration.robots))
        if self._host is None:
            return [Client.connect(*address) for _ in numbers]
        monitor = MultiRobotMonitor(self._host)
        self.result.monitor = monitor
        transports = [
            InProcessTransport(self._host, after_tick=monitor.watch) for _ in numbers
        ]
        return [Client(transport) for transport in transports]

    def _complete_result(self) -> None:
        result, exploration = self.result, self.exploration
        result.outcome, result.trip = exploration.outcome.value, exploration.trip
        result.mapper = exploration.mapper
        result.safety_distance = exploration.robots[0].safety_distance
        result.unreached = exploration.unreached


def _errors(
    robot: Exploration, frame: Pose2 | None
) -> tuple[TrajectoryErrors, TrajectoryErrors | None] | None:
    """Compare a robot's poses, and those of its motion source, with the true ones."""
    mapper = robot.mapper
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
    """Return the errors of all poses of several trajectories."""
    poses = np.array([each.poses for each in errors])

    def mean_square(name: str) -> float:
        values = np.array([getattr(each, name) for each in errors])
        known = np.isfinite(values)
        if not known.any():
            return math.nan
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
