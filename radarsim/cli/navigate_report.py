"""One run of a navigator: its server, its judge, and what is known of it."""

import json
import math
from collections.abc import Sequence
from typing import Any

from radarsim.cli.progress import progress
from radarsim.client import Client
from radarsim.evaluation.trials import GroundTruthMonitor
from radarsim.host import Host
from radarsim.host.lockstep import InProcessTransport
from radarsim.navigation.bug import Point
from radarsim.navigation.mission import Mission, run_mission
from radarsim.navigation.run_log import RunLog
from radarsim.navigation.runner import NavigationStep, Result
from radarsim.scene.scene import Scene


class Run:
    """One run: what was wished, what is known of it, and how it ended.

    Attributes:
        mission: What to do.
        host: The server, if it is in this process.
        referee: Watches the true robot, if that can be.
        record: What it was like.
        result: None while it lasts, and where it broke off.
        error: What went wrong; empty if nothing did.
    """

    def __init__(self, mission: Mission, host: Host | None) -> None:
        self.mission = mission
        self.host = host
        self.referee = None if host is None else GroundTruthMonitor(host)
        self.record = RunLog()
        self.result: Result | None = None
        self.error = ""

    @property
    def scene(self) -> Scene | None:
        """The map, where the server is in this process."""
        return None if self.host is None else self.host.simulation.scene

    @property
    def outcome(self) -> str:
        """``reached``, ``no_path`` or ``failed``."""
        return "failed" if self.result is None else self.result.outcome

    def drive(self, address: tuple[str, int]) -> None:
        """Connect and drive, and tell on stderr how it goes.

        Args:
            address: Of the server, unless it is in this process.

        Raises:
            ClientError: If the server does not say what is needed.
            NavigationError: If the robot cannot do what is asked of it.
        """
        with self._connect(address) as client, progress(self.record) as teller:

            def observe(moment: NavigationStep) -> None:
                teller.tell(self.record.add(moment))

            self.result = run_mission(client, self.mission, observe)
        if self.outcome == "failed":
            left = self.record.rows[-1].goal_distance
            limit = f"within {self.mission.time_limit:g} s"
            self.error = f"goal not reached {limit}, {left:.2f} m from it"

    def _connect(self, address: tuple[str, int]) -> Client:
        """Connect to the server, wherever it is."""
        if self.host is None or self.referee is None:
            return Client.connect(*address)
        return Client(InProcessTransport(self.host, after_tick=self.referee.watch))


# Section from cli.outcomes.
# What is said of a run once it is over.

ENDINGS = {"reached": "goal reached", "no_path": "no path"}


def summary(run: Run) -> dict[str, Any]:
    """Give all that is known of a run, for JSON; lengths to mm.

    A run that broke off is told of as far as it came.
    """
    told = _told(run)
    rounded: dict[str, Any] = _rounded(told)
    return rounded


def _told(run: Run) -> dict[str, Any]:
    record, result, mission = run.record, run.result, run.mission
    told: dict[str, Any] = {
        "outcome": run.outcome,
        "algorithm": mission.algorithm.value,
        "goals": mission.goals,
        "goals_left": _goals_left(run),
        "path_length": record.length,
        "time": record.time,
        "hit_points": record.hits,
        "leave_points": record.leaves,
        "circuits": record.circuits if result is None else result.circuits,
        "nearest_obstacle": record.nearest,
        "safety_distance": mission.safety_distance
        if result is None
        else result.safety_distance,
        "error": run.error or None,
    }
    if run.referee is not None:
        told["judge"] = {
            "path_length": run.referee.path_length,
            "collisions": run.referee.collisions,
            "goal_distance": run.referee.distance(mission.goals[-1]),
        }
    return told


def as_json(run: Run) -> str:
    """Give that as one line."""
    return json.dumps(summary(run), allow_nan=False)


def as_text(run: Run) -> list[str]:
    """Give that for people, in lines."""
    told = _told(run)
    nearest = told["nearest_obstacle"]
    met = math.isfinite(nearest)
    near = f"nearest obstacle {nearest:.2f} m" if met else "nothing was met"
    lines = [
        f"{ending_of(run)} by {told['algorithm']}: {_places(run.mission.goals)}",
        f"path          {told['path_length']:.2f} m in {told['time']:.1f} s; {near}",
        f"hit points    {_places(told['hit_points'])}",
        f"leave points  {_places(told['leave_points'])}",
        f"circuits      {told['circuits']}",
    ]
    if judge := told.get("judge"):
        lines.append(
            f"in truth      {judge['path_length']:.2f} m,"
            f" collisions: {judge['collisions']},"
            f" {judge['goal_distance']:.2f} m from the goal"
        )
    return lines


def ending_of(run: Run) -> str:
    """Say how a run ended; one that neither ended nor failed was broken off."""
    return ENDINGS.get(run.outcome, "failed" if run.error else "broken off")


def title_of(run: Run) -> str:
    """Give two lines to stand above a picture."""
    record, told = run.record, summary(run)
    name = run.mission.algorithm.value.capitalize()
    where = "" if run.scene is None else f" in {run.scene.name}"
    rounds = f"{told['circuits']} circuit{'s' * (told['circuits'] != 1)}"
    return (
        f"{name}{where}: {ending_of(run)}\n"
        f"{record.length:.2f} m in {record.time:.1f} s, {rounds}"
    )


def _goals_left(run: Run) -> int:
    if run.result is not None:
        return run.result.goals_left
    return len(run.mission.goals) - max(len(run.record.legs) - 1, 0)


def _places(points: Sequence[Point]) -> str:
    return ", ".join(f"{x:.2f} {y:.2f}" for x, y in points) or "none"


def _rounded(value: Any) -> Any:
    """Round all numbers in something; None for what is not finite."""
    if isinstance(value, dict):
        return {key: _rounded(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(each) for each in value]
    if isinstance(value, float):
        return round(value, 3) + 0.0 if math.isfinite(value) else None
    return value
