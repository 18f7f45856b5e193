"""Trials of a controller of one's own, which drives a robot of a local simulation.

It is judged as the navigators of the package are: by the truth, on the same maps.
Shares have Wilson's score interval (Wilson 1927), which also holds for few runs and for
shares of 0 and 1. Means have Student's t interval.
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
ALL: Final = "all"  # all maps together
TIME_LIMIT: Final = 600.0  # s
MOST_COMMANDS: Final = 20_000  # while no time passes; a controller that forgets to step


@dataclass(frozen=True, slots=True)
class Estimate:
    """An estimate with its interval of 95 %.

    Attributes:
        value: The share, or the mean.
        low: Lower end of its interval; the value itself where there is none.
        high: Upper end, likewise.
        count: Number of runs.
    """

    value: float
    low: float
    high: float
    count: int


def share(successes: int, count: int) -> Estimate:
    """Estimate a share, with Wilson's score interval.

    Args:
        successes: Number of runs that have a property.
        count: Number of all runs, at least 1; of a single one there is no interval.

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
    """Estimate a mean, with Student's t interval.

    Args:
        values: At least one. If all are equal, or there is only one, both ends of the
            interval are the value itself.
    """
    count, value = len(values), float(np.mean(values))
    if min(values) == max(values):
        # The value itself: the mean of equal values can differ from them in the last
        # digit.
        return Estimate(values[0], values[0], values[0], count)
    low, high = stats.t.interval(CONFIDENCE, count - 1, value, stats.sem(values))
    return Estimate(value, float(low), float(high), count)


class _TimeIsUp(Exception):
    """The time limit of a trial has come."""


class _TrialSimulation(LocalSimulation):
    """A simulation that ends at a time."""

    def __init__(self, scene: Scene, sensor: str, seed: int, end: float) -> None:
        super().__init__(scene, seed=seed, config=config_with_sensor(sensor))
        self._end = end
        self._commands = 0  # since the last step

    def receive(self, number: int, data: bytes) -> list[str]:
        """See ``LocalSimulation.receive``.

        Raises:
            ValueError: If a controller sends commands without end, and no time passes.
        """
        self._commands += 1
        if self._commands > MOST_COMMANDS:
            raise ValueError(
                f"{MOST_COMMANDS} commands and no time has passed, expected a call of"
                " robot.simulation.step"
            )
        return super().receive(number, data)

    def step(self, duration: float) -> None:
        """See ``LocalSimulation.step``.

        Raises:
            _TimeIsUp: If the end has come.
        """
        self._commands = 0
        super().step(min(duration, max(self._end - self.time, 0.0)))
        if self.time >= self._end:
            raise _TimeIsUp


@dataclass(frozen=True, slots=True)
class Evaluation:
    """How a controller did.

    Attributes:
        rows: A result of each run, map by map and seed by seed.
    """

    rows: tuple[TrialResult, ...]

    @property
    def success(self) -> Mapping[str, Estimate]:
        """Share of the runs that ended rightly and touched nothing, by map.

        ``all`` is that of all maps. Intervals are Wilson's of 95 %; a single run has
        none, so that both ends are its value.
        """
        return {
            name: share(sum(row.is_correct for row in rows), len(rows))
            for name, rows in self._by_map()
        }

    @property
    def detour(self) -> Mapping[str, Estimate]:
        """Path divided by the shortest one, by map, of runs that ended at the goal.

        Maps on which none did are missing. Intervals are Student's of 95 %.
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
    """Let a controller drive to the goals of maps, and judge it by the truth.

    The controller is called with a robot, a P3AT whose scanner ``lms200`` sees a full
    circle, and its goal, x and y in m. It drives in a loop of its own and returns when
    the robot is there, or False if it finds that there is no path::

        def straight_ahead(robot, goal):
            while math.dist((robot.ins.pose.x, robot.ins.pose.y), goal) > 0.2:
                robot.drive(0.3)
                robot.simulation.step(0.1)

    The robot has reported before the call. A ``ClientError`` or ``NavigationError`` of
    the controller fails the run; any other error ends the evaluation.

    Args:
        controller: The controller.
        maps: Names of maps that have a ``trial``, or paths of their files.
        seeds: Seeds of the simulations, or how many from 0.
        sensor: Name of the preset of the scanner.
        time_limit: Simulated time after which a run has failed, s.
        pictures: Folder for a picture of each run, ``map-seed.png``; None for none.
        workers: Number of processes.

    Raises:
        MapError: If a map is wrong, or defines no trial.
        PresetError: If there is no such sensor.
        TypeError: If an argument is of another type.
        ValueError: If there are no maps, or no seeds, or a number is too small.
    """
    # Before any trial, so that a mistake is not found after minutes.
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
    if workers == 1:  # errors of the controller come as they are
        return Evaluation(tuple(run(*task) for task in tasks))
    with closing(run_tasks(run, tasks, workers=workers)) as running:
        return Evaluation(tuple(in_order(running)))


def _check_seeds(seeds: int | Sequence[int]) -> Sequence[int]:
    """Return the seeds; of a number, as many from 0.

    Raises:
        TypeError: If it is neither a number nor a sequence, or one is no whole number.
        ValueError: If one is negative.
    """
    if isinstance(seeds, int):
        return range(seeds)
    if not isinstance(seeds, Sequence | np.ndarray):
        text = "expected their number, or a list of them"
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
    """Run one trial; arguments as of ``evaluate``."""
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
