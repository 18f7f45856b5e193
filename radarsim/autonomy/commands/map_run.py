"""A run of ``radarsim map`` that explores: its progress, its files, what it prints."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Final, Protocol, TypeAlias

import numpy as np

from radarsim.autonomy.commands.film import filmed
from radarsim.autonomy.commands.map_files import MapCamera, MapOutput, save_map
from radarsim.autonomy.evaluation.mapping_run import (
    MappingResult,
    MappingRun,
    MultiRobotRun,
)
from radarsim.autonomy.exploration.exploration import Exploration, ExplorationStep
from radarsim.autonomy.exploration.multi_robot import MultiRobotExploration
from radarsim.autonomy.proxy.traffic_mapper import TrafficMapper
from radarsim.cli.compile_progress import live_status
from radarsim.cli.output import print_lines
from radarsim.processes import raise_on_signals

CLASSES: Final = ("free", "obstacle", "foliage", "smoke")
ENDINGS: Final = {
    "incomplete": "given up",
    "time_limit": "time is up",
    "broken_off": "interrupted",
    "overheard": "mapped what passed",
    "watched": "mapped what was watched",
}
Source: TypeAlias = Exploration | MultiRobotExploration | TrafficMapper


class ProgressUpdate(Protocol):
    """Shows what a robot is doing."""

    def __call__(self, latest: str, number: int = 0) -> None:
        """Show what the robot of a number is doing now."""


@contextmanager
def map_progress(
    source: Source,
) -> Iterator[ProgressUpdate]:
    """Show the progress of a map on stderr.

    Args:
        source: Holds the map and the distance so far.

    Yields:
        A function to be called after each scan with what the robot is doing, and the
        number of the robot.
    """
    activity = "waiting for a scan"
    latest_of: dict[int, str] = {}
    with live_status(lambda: _describe_status(source, activity)) as log:

        def update(latest: str, number: int = 0) -> None:
            nonlocal activity
            if latest != latest_of.get(number):
                latest_of[number] = activity = latest
                log(_describe_status(source, activity))

        yield update


def _describe_status(source: Source, activity: str) -> str:
    mapper, trip = source.mapper, source.trip
    if mapper is None or not mapper.scans:
        return activity
    cells = int(np.count_nonzero(mapper.grid.sensed_cells()))
    area = f"sensed {cells * mapper.grid.frame.resolution**2:7.1f} m²"
    return f"{trip.time:8.1f} s  {activity:9}  path {trip.length:6.2f} m  {area}"


def print_result(result: MappingResult, *, as_json: bool) -> None:
    """Print a result; one that failed before its first scan only as JSON."""
    if as_json:
        print_lines([result.to_json()])
    elif result.trip.start is not None or not result.error:
        print_lines(as_text(result))


def as_text(result: MappingResult) -> list[str]:
    """Return a result as lines of text."""
    plain = result.to_dict()
    ending = ENDINGS.get(result.outcome, result.outcome)
    how = " by" if result.outcome == "explored" else ", exploring by"
    by = "" if result.strategy is None else f"{how} {result.strategy}"
    path = f"{plain['path_length']:.2f} m in {plain['time']:.1f} s"
    lines = [f"{ending}{by}: {path}, {plain['scans']} scans"]
    if cells := plain["cells"]:
        area = cells["resolution"] ** 2
        areas = [f"{cells[name] * area:.2f} m² {name}" for name in CLASSES]
        lines.append(f"map      {', '.join(areas)}")
    for number, robot in enumerate(plain.get("robots", ()), 1):
        lines.append(f"robot {number}  {_robot_text(robot)}")
    if errors := plain["pose_errors"]:
        lines.append(
            f"pose     {errors['ate']:.3f} m and {errors['yaw_deg']:.2f} degrees off,"
            f" at most {errors['ate_max']:.3f} m and {errors['yaw_max_deg']:.2f}"
        )
    if result.unreached:
        points = ", ".join(f"{x:.4g} {y:.4g}" for x, y in result.unreached)
        why = "no way there" if result.outcome == "explored" else "not reached"
        lines.append(f"left out {points}: {why}")
    if judge := plain.get("judge"):
        lines.append(f"in truth {_judge_text(judge)}")
    if result.files:
        names = ", ".join(file.name for file in result.files)
        lines.append(f"files    {names} in {result.files[0].parent}")
    return lines


def _robot_text(robot: dict[str, Any]) -> str:
    text = f"{robot['path_length']:.2f} m from {robot['start']}"
    if robot["aligned"] is None:
        text += "; not on the map, as no place on it fits what the robot saw"
    return text if robot["error"] is None else f"{text}; {robot['error']}"


def _judge_text(judge: dict[str, Any]) -> str:
    texts = [f"{judge['path_length']:.2f} m"]
    if judge.get("coverage") is not None:
        near = f"{judge['near_coverage']:.1%} at short range"
        texts.append(f"{judge['coverage']:.1%} of the floor sensed, {near}")
    if judge.get("reachable_coverage") is not None:
        texts.append(f"{judge['reachable_coverage']:.1%} of what it can get to")
    if judge.get("hidden_coverage") is not None:
        texts.append(f"{judge['hidden_coverage']:.1%} of what it cannot get to")
    if "right" in judge:
        texts.append(f"{judge['right']} cells right, {judge['wrong']} wrong")
    texts.append(f"collisions: {judge['collisions']}")
    return ", ".join(texts)


def explore(run: MappingRun, output: MapOutput, address: tuple[str, int]) -> None:
    """Let a run explore; write, judge and describe its map however it ends.

    Args:
        run: The run.
        output: What is made of it.
        address: Host and port of the server, unless it is in this process.
    """
    recording, camera = output.recording, MapCamera(run.result, run.exploration)
    with (
        raise_on_signals(),
        recording,
        filmed(output.film, camera.draw, output.film_speed) as update_film,
    ):
        try:
            with map_progress(run.exploration) as update:

                def observe(step: ExplorationStep) -> None:
                    update(step.activity)
                    update_film(step.observation.time)
                    recording.add_map(run.exploration.mapper)

                run.run(address, observe)
        finally:
            recording.add_map(run.exploration.mapper, last=True)
            try:
                run.judge()
            finally:
                save_map(run.result, output.files)
            print_result(run.result, as_json=output.as_json)


def explore_together(
    run: MultiRobotRun, output: MapOutput, address: tuple[str, int]
) -> None:
    """Let several robots explore; write, judge and describe their map.

    Args:
        run: The run.
        output: What is made of it.
        address: Host and port of the server, unless it is in this process.
    """
    with raise_on_signals():
        try:
            with map_progress(run.exploration) as update:

                def observe(number: int, step: ExplorationStep) -> None:
                    update(f"{number + 1} {step.activity}", number)

                run.run(address, observe)
        finally:
            try:
                run.judge()
            finally:
                save_map(run.result, output.files)
            print_result(run.result, as_json=output.as_json)
