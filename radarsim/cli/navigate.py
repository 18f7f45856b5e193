"""``radarsim navigate``: drive a robot to a goal."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from radarsim.cli.options import (
    PICTURE_FORMS,
    DriveUnit,
    DriveUnitOption,
    FilmOption,
    FilmSpeedOption,
    HostOption,
    JsonOption,
    PortOption,
    PoseOption,
    PowerOption,
    SafetyOption,
    ServedSeedOption,
    ServedSettingsOption,
    StartOption,
    TimeLimitOption,
    TimeoutOption,
    check_ending,
    check_positive,
    check_robot,
    check_server_options,
    check_start,
    check_writable,
    penetration_depth,
    read_point,
    read_pose,
    server_address,
    write_file,
)
from radarsim.cli.output import print_lines, print_message
from radarsim.cli.recorded_host import RecordOption
from radarsim.cli.run_recording import RunRecording
from radarsim.navigation.options import ROBOT, Algorithm, GiveUp, PoseSource, Rule
from radarsim.signal_handlers import raise_on_signals

if TYPE_CHECKING:
    from radarsim.evaluation.navigation_run import NavigationRun
    from radarsim.navigation.run_log import Row
    from radarsim.scene.scene import Trial

EXIT_CODES: Final = {"reached": 0, "no_path": 3}


class Side(StrEnum):
    """Side of the robot on which boundaries are followed."""

    LEFT = "left"
    RIGHT = "right"


def _check_share(value: float) -> float:
    if not 0 < value <= 1:
        raise typer.BadParameter(f"{value!r}, expected above 0 and at most 1")
    return value


def navigate(
    *,
    algorithm: Annotated[Algorithm, typer.Option(help="How to get around obstacles.")],
    goal: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y",
            help="Goal in m, map frame; repeat it for waypoints to reach in turn.",
        ),
    ] = None,
    host: HostOption = None,
    port: PortOption = None,
    start: StartOption = None,
    pose: PoseOption = None,
    robot: Annotated[
        str, typer.Option(help="Class of the robot; it has to see all the way round.")
    ] = ROBOT,
    scanner: Annotated[
        str | None, typer.Option(help="Scanner to steer by; the first by default.")
    ] = None,
    safety_distance: SafetyOption = None,
    foliage_density: Annotated[
        float | None,
        typer.Option(
            metavar="PER_M",
            callback=check_positive,
            help="Density of the thinnest foliage that the robot may meet, for servers"
            " that send no echoes: the radar sees into it.",
        ),
    ] = None,
    penetration_power: PowerOption = 1.0,
    bumpers: Annotated[int, typer.Option(min=4, max=36, help="Number of bumpers.")] = 8,
    share: Annotated[
        float,
        typer.Option(
            callback=_check_share, help="Share of a bumper's beams that press it."
        ),
    ] = 0.1,
    rule: Annotated[
        Rule,
        typer.Option(
            help="A bumper is pressed if a share of its beams is near, or if all are in"
            " the band."
        ),
    ] = Rule.SHARE,
    side: Annotated[
        Side, typer.Option(help="Side on which the robot keeps boundaries.")
    ] = Side.LEFT,
    give_up: Annotated[
        GiveUp, typer.Option(help="Where Bug2 decides that there is no path.")
    ] = GiveUp.HIT_POINT,
    pose_from: Annotated[
        PoseSource, typer.Option(help="Sensor from which the pose is read.")
    ] = PoseSource.INS,
    echoes: Annotated[
        bool,
        typer.Option(
            help="Ask the server for the echoes of each beam, or use ranges alone."
        ),
    ] = True,
    speed: Annotated[
        float,
        typer.Option(
            metavar="M_PER_S",
            callback=check_positive,
            help="Maximum speed; the robot's own limit holds as well.",
        ),
    ] = 0.3,
    drive_unit: DriveUnitOption = DriveUnit.RAD_PER_S,
    timeout: TimeoutOption = 2.0,
    time_limit: TimeLimitOption = 3600.0,
    as_json: JsonOption = False,
    trace: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a CSV file with a row for each scan."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw the run into a .png, .svg or .pdf."),
    ] = None,
    serve: Annotated[
        str | None,
        typer.Option(
            metavar="MAP",
            help="Simulate this map here, as fast as possible, instead of connecting to"
            " a server; its trial provides start, goal and safety distance where no"
            " option does.",
        ),
    ] = None,
    seed: ServedSeedOption = None,
    settings: ServedSettingsOption = None,
    record: RecordOption = None,
    film: FilmOption = None,
    film_speed: FilmSpeedOption = 6.0,
) -> None:
    """Drive a robot to a goal; exit with 3 if there is no path."""
    from radarsim.cli.film import check_film
    from radarsim.evaluation.navigation_run import NavigationRun
    from radarsim.navigation.control import SpeedLimits
    from radarsim.navigation.mission import Mission

    check_server_options(serve, host=host, port=port, seed=seed, settings=settings)
    _check_files(trace, plot)
    check_film(film)
    recording = RunRecording(record, drive_unit)
    served = recording.load_host(serve, seed=seed, settings=settings)
    scene = None if served is None else served.simulation.scene
    trial = None if scene is None else scene.trial
    check_robot(robot, served)
    check_start(start, pose, scene)
    if trial is not None:
        if start is None and pose is None:
            start = trial.start
        if safety_distance is None and foliage_density is None:
            safety_distance = trial.safety_distance
    mission = Mission(
        algorithm=algorithm,
        goals=_read_goals(goal or [], trial, serve),
        robot_class=robot,
        start=start,
        pose=None if pose is None else read_pose(pose, "--pose"),
        scanner=scanner,
        safety_distance=safety_distance,
        penetration_depth=penetration_depth(foliage_density, penetration_power),
        bumpers=bumpers,
        share=share,
        rule=rule,
        wall_on_left=side is Side.LEFT,
        give_up=give_up,
        pose_source=pose_from,
        echoes=echoes,
        speed_limits=SpeedLimits(speed=speed),
        time_limit=time_limit,
        timeout=timeout,
        drive_unit=drive_unit.value,
    )
    run = NavigationRun(mission, served)
    run.connect = recording.connect
    address = server_address(host, port)
    with (
        raise_on_signals(),
        recording,
        _write_files(run, trace, plot),
        _print_result(run, as_json=as_json),
    ):
        _execute(run, address, film, film_speed)
    if run.error:
        print_message(run.error)
    raise typer.Exit(EXIT_CODES.get(run.outcome, 1))


def _execute(
    run: NavigationRun, address: tuple[str, int], film: Path | None, film_speed: float
) -> None:
    """Drive, show the progress, and film it if a file is given."""
    from radarsim.cli.film import filmed
    from radarsim.cli.navigate_report import run_progress
    from radarsim.cli.navigate_view import RunCamera

    with (
        filmed(film, RunCamera(run).draw, film_speed) as update_film,
        run_progress(run.run_log) as update,
    ):

        def observe(row: Row) -> None:
            update(row)
            update_film(row.time)

        run.execute(address, observe)


def _read_goals(
    goals: list[str], trial: Trial | None, served_map: str | None
) -> tuple[tuple[float, float], ...]:
    if goals:
        return tuple(read_point(text, "--goal") for text in goals)
    if trial is None:
        text = "nowhere to go, expected X,Y, or --serve with a map that has a trial"
        if served_map is not None:
            text = f"nowhere to go, expected X,Y: the map {served_map!r} has no trial"
        raise typer.BadParameter(text, param_hint="--goal")
    return (trial.goal,)


def _check_files(trace: Path | None, plot: Path | None) -> None:
    """Check before the run that its files can be written after it."""
    for hint, path in (("--trace", trace), ("--plot", plot)):
        if path is not None:
            check_writable(path, hint)
    if plot is not None:
        check_ending(plot, PICTURE_FORMS, "--plot")


@contextmanager
def _print_result(run: NavigationRun, *, as_json: bool) -> Iterator[None]:
    """Print the result of a run, also of an interrupted one; else failures as JSON."""
    from radarsim.cli.navigate_report import as_json as result_as_json
    from radarsim.cli.navigate_report import as_text
    from radarsim.evaluation.navigation_run import INTERRUPTED

    try:
        yield
    except BaseException as error:
        failed = isinstance(error, Exception)
        run.error = run.error or (str(error) if failed else INTERRUPTED)
        if as_json:
            print_lines([result_as_json(run)])
        elif not failed and run.run_log.rows:
            print_lines(as_text(run))
        raise
    print_lines([result_as_json(run)] if as_json else as_text(run))


@contextmanager
def _write_files(
    run: NavigationRun, trace: Path | None, plot: Path | None
) -> Iterator[None]:
    """Write the files after a run, however it ends."""
    try:
        yield
    finally:
        if trace is not None:
            write_file(trace, run.run_log.as_csv().encode(), "--trace")
            print_message(f"wrote {trace}")
        if plot is not None and run.run_log.rows:
            form = check_ending(plot, PICTURE_FORMS, "--plot")
            write_file(plot, _draw(run, form), "--plot")
            print_message(f"wrote {plot}")


def _draw(run: NavigationRun, form: str) -> bytes:
    from radarsim.cli.navigate_view import view_of
    from radarsim.plotting.runs import draw_run

    return draw_run(view_of(run), form=form)
