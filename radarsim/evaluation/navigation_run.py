"""One run of a navigator: its server, its mission, its log and its result."""

import math
from collections.abc import Callable
from typing import Any, Final

from radarsim.client import Client
from radarsim.evaluation.ground_truth import GroundTruthMonitor
from radarsim.host import Host
from radarsim.host.lockstep import InProcessTransport
from radarsim.navigation.mission import Mission, run_mission
from radarsim.navigation.run_log import Row, RunLog
from radarsim.navigation.runner import NavigationStep, Result
from radarsim.scene.scene import Scene

INTERRUPTED: Final = "interrupted"


class NavigationRun:
    """One run of a mission, complete or broken off.

    Attributes:
        mission: The mission.
        host: The server, if it runs in this process.
        monitor: Watches the true robot, if the server runs in this process.
        run_log: One row for each scan so far.
        result: None until the run ends, and after one that broke off.
        error: What went wrong; empty if nothing did.
        connect: Connects to a server that is not in this process, at a host and port.
    """

    def __init__(self, mission: Mission, host: Host | None) -> None:
        self.mission = mission
        self.host = host
        self.monitor = None if host is None else GroundTruthMonitor(host)
        self.run_log = RunLog()
        self.result: Result | None = None
        self.error = ""
        self.connect: Callable[[str, int], Client] = Client.connect

    @property
    def scene(self) -> Scene | None:
        """The map, if the server runs in this process."""
        return None if self.host is None else self.host.simulation.scene

    @property
    def outcome(self) -> str:
        """``reached``, ``no_path`` or ``failed``."""
        return "failed" if self.result is None else self.result.outcome

    @property
    def goals_left(self) -> int:
        """Number of goals that the robot has not reached."""
        if self.result is not None:
            return self.result.goals_left
        return len(self.mission.goals) - max(len(self.run_log.goal_lines) - 1, 0)

    @property
    def circuits(self) -> int:
        """Number of complete circuits around obstacles."""
        return self.run_log.circuits if self.result is None else self.result.circuits

    def execute(
        self,
        address: tuple[str, int],
        on_scan: Callable[[Row], None] = lambda _: None,
    ) -> None:
        """Connect, and drive until the mission ends; set ``result`` and ``error``.

        Args:
            address: Host and port of the server, unless it runs in this process.
            on_scan: Called after every scan with its row of the log.

        Raises:
            ClientError: If the server does not send what is needed.
            NavigationError: If the robot cannot do what the mission asks for.
        """

        def observe(step: NavigationStep) -> None:
            on_scan(self.run_log.add(step))

        try:
            with self._connect(address) as client:
                self.result = run_mission(client, self.mission, observe)
        except (KeyboardInterrupt, SystemExit):
            self.error = INTERRUPTED
            raise
        if self.outcome == "failed":
            distance = self.run_log.rows[-1].goal_distance
            limit = f"within {self.mission.time_limit:g} s"
            self.error = f"goal not reached {limit}, {distance:.2f} m from it"

    def summary(self) -> dict[str, Any]:
        """Return all values of the run by name, numbers unrounded.

        A run that broke off is described as far as it came.
        """
        run_log, result, mission = self.run_log, self.result, self.mission
        values: dict[str, Any] = {
            "outcome": self.outcome,
            "algorithm": mission.algorithm.value,
            "goals": mission.goals,
            "goals_left": self.goals_left,
            "path_length": run_log.path_length,
            "time": run_log.time,
            "hit_points": run_log.hit_points,
            "leave_points": run_log.leave_points,
            "circuits": self.circuits,
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
                "goal_distance": self.monitor.distance(mission.goals[-1]),
            }
        return values

    def to_dict(self) -> dict[str, Any]:
        """Return the summary for JSON: lengths to 1 mm, times to 1 ms."""
        rounded: dict[str, Any] = _rounded(self.summary())
        return rounded

    def _connect(self, address: tuple[str, int]) -> Client:
        if self.host is None or self.monitor is None:
            return self.connect(*address)
        return Client(InProcessTransport(self.host, after_tick=self.monitor.watch))


def _rounded(value: Any) -> Any:
    """Round all numbers in a value; None stands for what is not finite."""
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(each) for each in value]
    if isinstance(value, float):
        return round(value, 3) + 0.0 if math.isfinite(value) else None
    return value
