"""A run of ``radarsim map``: it explores, or follows what another client drives.

It shows the progress, writes the files and prints the result.
"""

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Final, TypeAlias

import click
import numpy as np

from radarsim.autonomy.cli.film import filmed
from radarsim.autonomy.cli.map_files import MapFiles, map_camera
from radarsim.autonomy.cli.recording import Recording
from radarsim.autonomy.evaluation.mapping_run import MappingResult, MappingRun
from radarsim.autonomy.exploration.exploration import Exploration
from radarsim.autonomy.plans import ExplorationPlan
from radarsim.autonomy.watching import RobotWatcher, WatchMapper
from radarsim.cli.output import print_lines, print_message, start_log
from radarsim.cli.progress import live_status
from radarsim.processes import raise_on_signals, set_exit_code_of_sigterm

CLASSES: Final = ("free", "obstacle", "foliage", "smoke")
ENDINGS: Final = {
    "incomplete": "given up",
    "time_limit": "time is up",
    "broken_off": "interrupted",
    "watched": "mapped what was watched",
}
Source: TypeAlias = Exploration | WatchMapper


@contextmanager
def map_progress(source: Source) -> Iterator[Callable[[str], None]]:
    """Show the progress of a map on stderr.

    Args:
        source: Holds the map and the distance so far.

    Yields:
        A function to be called after each scan with what the robot is doing.
    """
    activity = "waiting for a scan"
    with live_status(lambda: _describe_status(source, activity)) as log:

        def update(latest: str) -> None:
            nonlocal activity
            if latest != activity:
                activity = latest
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
    lines += [f"doubt    {doubt}" for doubt in plain["doubts"]]
    if cells := plain["cells"]:
        area = cells["resolution"] ** 2
        areas = [f"{cells[name] * area:.2f} m² {name}" for name in CLASSES]
        lines.append(f"map      {', '.join(areas)}")
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
        lines.append(f"files    {_files_text(result.files)}")
    return lines


def _files_text(files: Sequence[Path]) -> str:
    """Return names of files: first the picture that a person looks at."""
    view = next(file for file in files if file.stem.endswith("_view"))
    others = ", ".join(file.name for file in files if file != view)
    return f"{view.name} to look at; for programs {others}; in {view.parent}"


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


def explore(
    run: MappingRun,
    files: MapFiles,
    recording: Recording,
    address: tuple[str, int],
    *,
    as_json: bool,
) -> None:
    """Let a run explore; write, judge and describe its map however it ends.

    Args:
        run: The run.
        files: What is written.
        recording: Records what passes, and the map.
        address: Host and port of the server, unless it is in this process.
        as_json: Whether to print JSON.
    """
    result, source = run.result, run.exploration
    with _making(result, source, files, recording) as making:
        try:
            with making as note:
                run.run(address, note)
        finally:
            # an interrupt of the judge, which takes seconds, must not cost the map
            try:
                run.judge()
            finally:
                files.write(result)
            print_result(result, as_json=as_json)


def follow(
    plan: ExplorationPlan,
    files: MapFiles,
    recording: Recording,
    server: tuple[str, int],
    robot: str,
    *,
    as_json: bool,
) -> int:
    """Map what a robot of another client reports, until it leaves or a signal comes.

    Args:
        plan: The scanner, the source of its motion, and the map's cells.
        files: What is written.
        recording: Records what passes, and the map.
        server: Host and port of the server, which is one of radarsim.
        robot: Name of the robot.
        as_json: Whether to print JSON.

    Returns:
        The exit code.

    Raises:
        click.BadParameter: If an option is wrong.
    """
    if not robot.strip() or "," in robot:
        text = f"{robot[:80]!r}, expected the name of a robot, without commas"
        raise click.BadParameter(text, param_hint="--watch")
    watcher = RobotWatcher(server, robot, echoes=plan.echoes)
    watcher.on_wait = lambda: print_message(f"waiting for the robot {robot[:80]!r}")
    follower = WatchMapper(
        motion_source=plan.motion_source,
        resolution=plan.resolution,
        map_range=plan.map_range,
        scanner=plan.scanner,
    )
    files.check()
    start_log(logging.WARNING, "%(message)s")
    set_exit_code_of_sigterm(0)  # it has no end of its own
    result = MappingResult(
        None, follower.motion_source, trip=follower.trip, outcome="watched"
    )
    with _making(result, follower, files, recording) as making:
        follower.on_data = recording.follow(robot)
        with making as note:
            follower.on_scan = lambda: note("listening")
            code = follower.watch(watcher, echoes=plan.echoes)
        result.mapper = follower.mapper
        files.write(result)
        if follower.error and not result.error:
            result.error = follower.error
            print_message(follower.error)
        print_result(result, as_json=as_json)
    return 1 if result.error else code


@contextmanager
def _making(
    result: MappingResult, source: Source, files: MapFiles, recording: Recording
) -> Iterator[AbstractContextManager[Callable[[str], None]]]:
    """Record and film the making of a map.

    Args:
        result: The result.
        source: Holds the map and the distance so far.
        files: What is written.
        recording: Records what passes, and the map.

    Yields:
        A context that shows the progress on stderr. It is a function to be called after
        each scan with what the robot is doing.
    """
    options, draw = files.options, map_camera(result, source)

    @contextmanager
    def progress() -> Iterator[Callable[[str], None]]:
        def note(activity: str) -> None:
            update(activity)
            update_film(source.trip.time)
            recording.add_map(source.mapper)

        try:
            with map_progress(source) as update:
                yield note
        finally:
            recording.add_map(source.mapper, last=True)

    with (
        raise_on_signals(),
        recording,
        filmed(options.film, draw, options.film_speed) as update_film,
    ):
        yield progress()
