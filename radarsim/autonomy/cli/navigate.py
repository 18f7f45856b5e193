"""``radarsim navigate``: drive a robot to a goal."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click

from radarsim.autonomy.cli.run_files import (
    check_film,
    check_start,
    filmed,
    make_recording,
)
from radarsim.autonomy.plans import Mission
from radarsim.cli.fields import (
    LOCAL_SERVER,
    Json,
    RunFiles,
    Simulation,
    check_robot,
)
from radarsim.cli.output import (
    MESSAGE_FORM,
    check_picture,
    check_writable,
    print_lines,
    print_message,
    start_log,
    write_file,
    write_picture,
)
from radarsim.processes import raise_on_signals

if TYPE_CHECKING:
    from radarsim.autonomy.evaluation.navigation_run import NavigationRun
    from radarsim.scene.scene import Scene

EXIT_CODES: Final = {"reached": 0, "no_path": 3}


@dataclass(frozen=True, slots=True, kw_only=True)
class NavigationFiles(RunFiles):
    """Output files of a navigator run.

    Attributes:
        trace: Write a CSV file with a row for each scan.
        plot: Draw the run as a .png, .svg or .pdf file.
    """

    trace: Path | None = None
    plot: Path | None = None

    def check(self) -> None:
        """Check before a run that the files can be written after the run.

        Raises:
            click.BadParameter: If a file cannot be written.
        """
        if self.trace is not None:
            check_writable(self.trace, "--trace")
            if self.trace.exists() and not _is_trace(self.trace):
                text = f"{self.trace} exists and is not a trace, expected another name"
                raise click.BadParameter(text, param_hint="--trace")
        check_picture(self.plot)
        check_film(self.film)

    @contextmanager
    def written(self, run: NavigationRun) -> Iterator[None]:
        """Write the trace and the plot when a run has ended, even by an error."""
        from radarsim.autonomy.cli.navigate_output import view_of
        from radarsim.autonomy.plotting.runs import run_figure
        from radarsim.plotting.style import render

        try:
            yield
        finally:
            if self.trace is not None:
                write_file(self.trace, run.run_log.as_csv().encode(), "--trace")
                print_message(f"wrote {self.trace}")
            if self.plot is not None and run.run_log.rows:
                form = check_picture(self.plot)
                figure = run_figure([view_of(run)], numbers=True)
                write_picture(self.plot, render(figure, form))


def navigate(
    where: Simulation,
    mission: Mission,
    files: NavigationFiles,
    *,
    as_json: Json = False,
) -> int:
    """Drive a robot to a goal; exit with 3 if there is no path.

    Start, goal and safety distance are by default those of the map's trial.

    Args:
        where: The simulation or the server.
        mission: The mission.
        files: What to write.
        as_json: Print JSON instead of text.

    Returns:
        The exit code.
    """
    from radarsim.autonomy.cli.navigate_output import run_camera, run_progress
    from radarsim.autonomy.evaluation.navigation_run import NavigationRun

    files.check()
    recording = make_recording(files.record, mission.drive_unit)
    served = where.load_host(mission.drive_unit)
    if served is not None and where.map is not None:
        recording.attach(served, where.map)
    check_robot(mission.robot_class, served)
    scene = None if served is None else served.simulation.scene
    run = NavigationRun(complete_mission(mission, scene), served)
    start_log(logging.WARNING, MESSAGE_FORM)
    # The contexts close in reverse order: progress ends before the result is printed.
    with (
        raise_on_signals(),
        recording,
        files.written(run),
        _print_result(run, as_json=as_json),
        filmed(files, run_camera(run)) as update_film,
        run_progress(run.run_log, update_film) as observe,
    ):
        address = where.connect or LOCAL_SERVER
        run.execute(observe, partial(recording.connect, *address))
    if run.error:
        print_message(run.error)
    return EXIT_CODES.get(run.outcome, 1)


def complete_mission(mission: Mission, scene: Scene | None) -> Mission:
    """Return the mission, with missing values filled in from the trial of the map.

    Args:
        mission: The mission as given.
        scene: The map; None for a server.

    Raises:
        click.BadParameter: If there is no goal, or the start does not exist.
    """
    trial = None if scene is None else scene.trial
    check_start(scene, mission.start)
    if not mission.goals and trial is None:
        text = "no goal, expected X,Y, or a map that has a trial"
        if scene is not None:
            text = f"no goal, expected X,Y: the map {scene.name!r} has no trial"
        raise click.BadParameter(text, param_hint="--goal")
    if trial is None:
        return mission
    has_start = mission.start is not None or mission.pose is not None
    # The user sets the safety distance itself, or the density of foliage to compute it.
    is_safe = mission.safety_distance is not None or mission.foliage_density is not None
    return replace(
        mission,
        goals=mission.goals or (trial.goal,),
        start=mission.start if has_start else trial.start,
        safety_distance=mission.safety_distance if is_safe else trial.safety_distance,
    )


@contextmanager
def _print_result(run: NavigationRun, *, as_json: bool) -> Iterator[None]:
    """Print the result of a run, even if interrupted; a failed run prints only JSON."""
    from radarsim.autonomy.cli.navigate_output import as_text
    from radarsim.autonomy.evaluation.navigation_run import INTERRUPTED

    try:
        yield
    except BaseException as error:
        failed = isinstance(error, Exception)
        run.error = run.error or (str(error) if failed else INTERRUPTED)
        if as_json:
            print_lines([run.to_json()])
        elif not failed and run.run_log.rows:
            print_lines(as_text(run))
        raise
    print_lines([run.to_json()] if as_json else as_text(run))


def _is_trace(path: Path) -> bool:
    """Return whether a file is empty or starts with the header of a trace."""
    from radarsim.autonomy.navigation.run_log import TRACE_HEADER

    header = TRACE_HEADER.encode()
    try:
        with path.open("rb") as file:
            head = file.readline(len(header) + 1)
    except OSError:
        return False
    return not head or head == header
