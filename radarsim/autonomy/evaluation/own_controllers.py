"""Trials of a controller written by the user, which drives a simulated robot.

Its runs are evaluated like those of the built-in navigators: with the ground truth, on
the same maps. Shares have Wilson's score interval (Wilson 1927), which also holds for
few runs and for shares of 0 and 1. Means have Student's t interval.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np
from scipy import stats

from radarsim.autonomy.evaluation.navigation_run import GroundTruthMonitor
from radarsim.autonomy.evaluation.task_runner import in_order, run_tasks
from radarsim.autonomy.evaluation.trials import (
    MAPS,
    TrialResult,
    config_with_sensor,
    judge_drive,
    load_trial,
    shortest_for,
)
from radarsim.autonomy.plans import ROBOT
from radarsim.errors import ClientError, NavigationError
from radarsim.geometry import Point
from radarsim.local import LocalRobot, LocalSimulation
from radarsim.rng import generator_for
from radarsim.scene.scene import Scene
from radarsim.validation import check_number

OwnController: TypeAlias = Callable[[LocalRobot, Point], object]

CONFIDENCE: Final = 0.95
ALL: Final = "all"  # key of the estimate over all maps
TIME_LIMIT: Final = 600.0  # s
MOST_COMMANDS: Final = 20_000  # most commands without a time step


@dataclass(frozen=True, slots=True)
class Estimate:
    """An estimated value with its 95 % confidence interval.

    Attributes:
        value: The share, or the mean.
        low: Lower end of the interval; the value itself without an interval.
        high: Upper end of the interval; the value itself without an interval.
        count: Number of runs.
    """

    value: float
    low: float
    high: float
    count: int


def share(successes: int, count: int) -> Estimate:
    """Estimate a share of successes, with Wilson's score interval.

    Args:
        successes: Number of runs with the property.
        count: Number of all runs, at least 1; a single run has no interval.

    >>> estimate = share(10, 10)
    >>> round(estimate.low, 4), round(estimate.high, 4)
    (0.7225, 1.0)
    """
    p = successes / count
    if count < 2:
        return Estimate(p, p, p, count)
    test = stats.binomtest(successes, count)
    interval = test.proportion_ci(CONFIDENCE, method="wilson")
    return Estimate(p, float(interval.low), float(interval.high), count)


def mean(values: Sequence[float]) -> Estimate:
    """Estimate the mean of values, with Student's t interval.

    Args:
        values: At least one value. If all are equal, or there is only one, both ends of
            the interval are the value itself.
    """
    count, value = len(values), float(np.mean(values))
    if min(values) == max(values):
        # Rounding may make the mean of equal values differ
        # slightly from them, so the first value is returned.
        return Estimate(values[0], values[0], values[0], count)
    low, high = stats.t.interval(CONFIDENCE, count - 1, value, stats.sem(values))
    return Estimate(value, float(low), float(high), count)


class _TimeIsUp(Exception):
    """Raised at the time limit of a trial."""


class _TrialSimulation(LocalSimulation):
    """A simulation that ends at a given time."""

    def __init__(self, scene: Scene, sensor: str, seed: int, end: float) -> None:
        super().__init__(scene, seed=seed, config=config_with_sensor(sensor))
        self._end = end
        self._commands = 0  # commands since the last step

    def receive(self, number: int, data: bytes) -> list[str]:
        """Process a command; see ``LocalSimulation.receive``.

        Raises:
            ValueError: If a controller sends too many commands without a time step.
        """
        self._commands += 1
        if self._commands > MOST_COMMANDS:
            raise ValueError(
                f"{MOST_COMMANDS} commands at the same simulated time, expected a call"
                " of robot.simulation.step"
            )
        return super().receive(number, data)

    def step(self, duration: float) -> None:
        """Advance the simulation; see ``LocalSimulation.step``.

        Raises:
            _TimeIsUp: At the time limit.
        """
        self._commands = 0
        super().step(min(duration, max(self._end - self.time, 0.0)))
        if self.time >= self._end:
            raise _TimeIsUp


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The results of a user's controller on all maps and seeds.

    Attributes:
        rows: The result of each run, map by map and seed by seed.
    """

    rows: tuple[TrialResult, ...]

    @property
    def success(self) -> Mapping[str, Estimate]:
        """Share of runs on each map with the correct outcome and without collisions.

        The key ``all`` holds the share over all maps. The intervals are Wilson's at 95
        %; for a single run, both ends are the value.
        """
        return {
            name: share(sum(row.is_correct for row in rows), len(rows))
            for name, rows in self._by_map()
        }

    @property
    def detour(self) -> Mapping[str, Estimate]:
        """Ratio of path length to shortest path by map, over runs that reach the goal.

        Maps without such a run are missing. The intervals are Student's at 95 %.
        """
        detours = {
            name: [
                row.path_length / row.shortest_path
                for row in rows
                if row.outcome == "reached" and row.shortest_path
            ]
            for name, rows in self._by_map()
        }
        return {name: mean(values) for name, values in detours.items() if values}

    def __str__(self) -> str:
        lines = []
        is_one_map = len({row.map for row in self.rows}) == 1
        for name, estimate in self.success.items():
            if name == ALL and is_one_map:
                continue
            text = f"{name}: {estimate.value:.0%}"
            if estimate.count > 1:
                text += f" ({estimate.low:.0%} to {estimate.high:.0%})"
            text += f" of {estimate.count} right"
            if name in self.detour:
                text += f", path / shortest {self.detour[name].value:.2f}"
            lines.append(text)
        return "\n".join(lines)

    def _by_map(self) -> Iterator[tuple[str, list[TrialResult]]]:
        for name in dict.fromkeys(row.map for row in self.rows):
            yield name, [row for row in self.rows if row.map == name]
        yield ALL, list(self.rows)


def evaluate(
    controller: OwnController,
    *,
    maps: Sequence[str | Path] = MAPS,
    seeds: int | Sequence[int] = 10,
    sensor: str = "radar",
    time_limit: float = TIME_LIMIT,
    pictures: str | Path | None = None,
    workers: int = 1,
) -> Evaluation:
    """Let a controller drive on maps, and judge its runs by the ground truth.

    The controller is called with a robot, a P3AT whose scanner ``lms200`` covers a full
    circle, and with the goal, x and y in m. It drives in a loop of its own and returns
    when the robot is at the goal, or returns False if it finds that no path exists::

        def straight_ahead(robot, goal):
            while math.dist((robot.ins.pose.x, robot.ins.pose.y), goal) > 0.2:
                robot.drive(0.3)
                robot.simulation.step(0.1)

    The robot has sent its first reports before the call. A ``ClientError`` or
    ``NavigationError`` of the controller fails the run; any other error ends the
    evaluation.

    Args:
        controller: The controller.
        maps: Names of maps that have a ``trial``, or paths of their files.
        seeds: Seeds of the simulations, or their number, counted from 0.
        sensor: Name of the preset of the scanner.
        time_limit: Simulated time after which a run fails, s.
        pictures: Folder for a picture of each run, ``map-seed.png``; None for none.
        workers: Number of processes.

    Raises:
        MapError: If a map is invalid, or defines no trial.
        PresetError: If the sensor does not exist.
        TypeError: If an argument has the wrong type.
        ValueError: If there are no maps or no seeds, or a number is too small.
    """
    # Arguments are checked before any trial, so that mistakes are reported at once.
    if not callable(controller):
        text = "expected a function of a robot and a goal"
        raise TypeError(f"controller {controller!r}, {text}")
    if workers < 1:
        raise ValueError(f"workers {workers!r}, expected at least 1")
    check_number("time_limit in s", time_limit, above=0.0)
    numbers = _check_seeds(seeds)
    if isinstance(maps, str):
        raise TypeError(f"maps {maps!r}, expected a list of names or paths")
    if not maps or not len(numbers):
        raise ValueError("no runs, expected at least one map and one seed")
    for map_ in maps:
        load_trial(str(map_) if isinstance(map_, Path) else map_)
    config_with_sensor(sensor)
    tasks = [(str(map_), seed) for map_ in maps for seed in numbers]
    folder = None if pictures is None else Path(pictures)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    run = partial(run_own_trial, controller, sensor, time_limit, folder)
    if workers == 1:  # errors of the controller are raised unchanged
        return Evaluation(tuple(run(*task) for task in tasks))
    with closing(run_tasks(run, tasks, workers=workers)) as running:
        return Evaluation(tuple(in_order(running)))


def _check_seeds(seeds: int | Sequence[int]) -> Sequence[int]:
    """Return the seeds; a number n stands for the seeds 0 to n - 1.

    Raises:
        TypeError: If it is neither a number nor a sequence, or a seed is not an
            integer.
        ValueError: If a seed is negative.
    """
    if isinstance(seeds, int):
        return range(seeds)
    if not isinstance(seeds, Sequence | np.ndarray):
        text = "expected a number of seeds, or a list of seeds"
        raise TypeError(f"seeds {seeds!r}, {text}")
    for seed in seeds:
        generator_for(seed)
    return seeds


def run_own_trial(
    controller: OwnController,
    sensor: str,
    time_limit: float,
    folder: Path | None,
    map_: str,
    seed: int,
) -> TrialResult:
    """Run one trial; see ``evaluate`` for the arguments."""
    scene, trial = load_trial(map_)
    sim = _TrialSimulation(scene, sensor, seed, time_limit)
    monitor = GroundTruthMonitor(sim.host)
    robot = sim.spawn(ROBOT, start=trial.start)
    sim.host.add_observer(monitor)
    outcome, note = "failed", ""
    try:
        sim.step(0.1)
        ended = controller(robot, trial.goal)
        outcome = "no_path" if ended is False else "reached"
    except _TimeIsUp:
        note = f"not there after {time_limit:g} s"
    except (ClientError, NavigationError) as error:
        note = str(error)
    except Exception as error:
        error.add_note(f"on map {map_}, seed {seed}, at {sim.time:.2f} s")
        raise
    monitor.watch()
    off = monitor.distance(trial.goal)
    result = judge_drive(sim.host, monitor, off, outcome, note)
    if folder is not None:
        sim.render(folder / f"{Path(map_).stem}-{seed}.png")
    return replace(
        result,
        map=map_,
        algorithm=getattr(controller, "__name__", type(controller).__name__),
        sensor=sensor,
        seed=seed,
        shortest_path=shortest_for(scene, trial),
    )
