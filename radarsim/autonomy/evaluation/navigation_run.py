"""One run of a navigator: its server, its mission, its log and its result.

The true path, collisions and distances of the robot come from the simulation.
"""

import json
import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from radarsim.autonomy.navigation.mission import run_mission
from radarsim.autonomy.navigation.run_log import Row, RunLog, rounded
from radarsim.autonomy.navigation.runner import NavigationStep, Result
from radarsim.autonomy.plans import Mission
from radarsim.client import Client
from radarsim.geometry import Floats, Point, Pose2
from radarsim.scene.scene import Scene
from radarsim.server.host import Host, HostObserver
from radarsim.server.host.lockstep import InProcessTransport

STEP: Final = 0.02  # m between two positions of the true path
INTERRUPTED: Final = "interrupted"


class GroundTruthMonitor(HostObserver):
    """Records the true path and the collisions of the first robot at every tick.

    As an observer of the host, the monitor reads the state after each tick, at the
    beginning of the next tick.

    Attributes:
        collisions: Number of contacts with obstacles or robots.
        path_length: Length of the true path of the robot's centre, m.
        path: The true path, in steps of at least ``STEP``, m, map frame.
    """

    def __init__(self, host: Host) -> None:
        self.collisions = 0
        self.path_length = 0.0
        self.path: list[Point] = []
        self._host = host
        self._number: int | None = None  # number of the robot
        self._touches = False
        self._pose: Pose2 | None = None

    def open_client(self) -> Client:
        """Connect to the host in lockstep, so that every tick is recorded."""
        return Client(InProcessTransport(self._host, after_tick=self.watch))

    def step(self, *, passes: bool) -> None:  # noqa: ARG002 - it watches all ticks
        """Advance the host; see ``HostObserver.step``."""
        self.watch()

    def watch(self) -> None:
        """Record the robot's state in the simulation; call this after every tick."""
        for vehicle in self._host.simulation.vehicles:
            if self._number is None:
                self._number = vehicle.number
            if vehicle.number == self._number:
                self._add(vehicle.robot.pose, touches=vehicle.robot.touched)

    def _add(self, pose: Pose2, *, touches: bool) -> None:
        # A contact over several ticks counts as one collision.
        self.collisions += touches and not self._touches
        previous = self._pose or pose
        self.path_length += math.hypot(pose.x - previous.x, pose.y - previous.y)
        self._pose, self._touches = pose, touches
        x, y = self.path[-1] if self.path else (math.inf, math.inf)
        if math.hypot(pose.x - x, pose.y - y) >= STEP:
            self.path.append((pose.x, pose.y))

    @property
    def positions(self) -> Floats:
        """The true path of the robot up to its latest position, (N, 2) m, map frame."""
        ends = [] if self._pose is None else [(self._pose.x, self._pose.y)]
        return np.array([*self.path, *ends]).reshape(-1, 2)

    def off_goal(self, mission: Mission) -> float:
        """Return the robot's true distance from the last goal of its mission, m.

        For a mission that returns to its start, the true start is the last goal.
        """
        goal = mission.goals[-1]
        if mission.return_to_start and self.path:
            goal = self.path[0]
        return self.distance(goal)

    def distance(self, goal: Point) -> float:
        """Return the robot's true distance from a point, m; ``inf`` without a robot."""
        if self._pose is None:
            return math.inf
        return math.hypot(self._pose.x - goal[0], self._pose.y - goal[1])


class NavigationRun:
    """One run of a mission, complete or aborted.

    Attributes:
        mission: The mission.
        host: The server, if it is in this process.
        monitor: Ground truth monitor, if the server is in this process.
        run_log: One row for each scan so far.
        result: None until the run ends, and after an aborted run.
        error: Error message; empty without an error.
    """

    def __init__(self, mission: Mission, host: Host | None) -> None:
        self.mission = mission
        self.host = host
        self.monitor = None if host is None else GroundTruthMonitor(host)
        self.run_log = RunLog()
        self.result: Result | None = None
        self.error = ""

    @property
    def scene(self) -> Scene | None:
        """The scene of the server, if the server runs in this process; else None."""
        return None if self.host is None else self.host.simulation.scene

    @property
    def outcome(self) -> str:
        """The outcome of the run: ``reached``, ``no_path`` or ``failed``."""
        return "failed" if self.result is None else self.result.outcome

    @property
    def goals(self) -> tuple[Point, ...]:
        """All goals in order, ending with the start if the robot returns there."""
        first = self.run_log.rows[:1] if self.mission.return_to_start else []
        return (*self.mission.goals, *((row.x, row.y) for row in first))

    @property
    def goals_left(self) -> int:
        """Number of goals that the robot has not reached."""
        if self.result is not None:
            return self.result.goals_left
        # Each goal ends a leg, so only the goal of the last leg is not yet reached.
        goals = len(self.mission.goals) + self.mission.return_to_start
        return goals - max(len(self.run_log.legs) - 1, 0)

    @property
    def circuits(self) -> int:
        """Number of complete circuits around obstacles."""
        return self.run_log.circuits if self.result is None else self.result.circuits

    def execute(
        self,
        on_scan: Callable[[Row], None] = lambda _: None,
        connect: Callable[[], Client] = Client.connect,
    ) -> None:
        """Connect, and drive until the mission ends; set ``result`` and ``error``.

        Args:
            on_scan: Called after every scan with its row of the log.
            connect: Connects to the server, unless it is in this process.

        Raises:
            ClientError: If the server does not send required reports.
            NavigationError: If the robot cannot carry out the mission.
        """

        def observe(step: NavigationStep) -> None:
            on_scan(self.run_log.add(step))

        monitor = self.monitor
        client = connect() if monitor is None else monitor.open_client()
        with client:
            self.result = run_mission(client, self.mission, observe)
        if self.outcome == "failed":
            distance = self.run_log.rows[-1].goal_distance
            limit = f"within {self.mission.time_limit:g} s"
            count = len(self.goals)
            which = f" {count - self.goals_left + 1} of {count}" if count > 1 else ""
            self.error = f"goal{which} not reached {limit}, {distance:.2f} m from it"

    def summary(self) -> dict[str, Any]:
        """Return all results of the run by name; numbers are not rounded.

        An aborted run has the values up to its end.
        """
        run_log, result, mission = self.run_log, self.result, self.mission
        values: dict[str, Any] = {
            "outcome": self.outcome,
            "algorithm": mission.algorithm.value,
            "goals": self.goals,
            "goals_left": self.goals_left,
            "path_length": run_log.path_length,
            "time": run_log.time,
            "hit_points": run_log.hit_points,
            "leave_points": run_log.leave_points,
            "circuits": self.circuits,
            "legs": self.legs(),
            "nearest_obstacle": run_log.nearest,
            "safety_distance": mission.safety_distance
            if result is None
            else result.safety_distance,
            "error": self.error or None,
        }
        if self.monitor is not None:
            values["judge"] = {
                "path_length": self.monitor.path_length,
                "collisions": self.monitor.collisions,
                "goal_distance": self.monitor.off_goal(mission),
            }
        return values

    def legs(self) -> list[dict[str, Any]]:
        """Return a result for each goal that the robot reached or drove towards."""
        legs = self.run_log.legs
        return [
            {
                "goal": leg.goal,
                "outcome": "reached" if number < len(legs) else self.outcome,
                "path_length": leg.path_length,
                "time": leg.ended - leg.began,
                "hit_points": leg.hit_points,
                "leave_points": leg.leave_points,
            }
            for number, leg in enumerate(legs, 1)
        ]

    def to_json(self) -> str:
        """Return the summary as one line of JSON: lengths to 1 mm, times to 1 ms."""
        return json.dumps(rounded(self.summary(), 3), allow_nan=False)
