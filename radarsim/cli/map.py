"""``radarsim map``: explore with a robot and map what it senses."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from radarsim.cli.options import (
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
    ServedSettingsOption,
    StartOption,
    TimeLimitOption,
    TimeoutOption,
    check_positive,
    check_robot,
    check_server_options,
    check_start,
    penetration_depth,
    read_point,
    read_pose,
    refuse_options,
    server_address,
)
from radarsim.cli.recorded_host import RecordOption
from radarsim.cli.run_recording import RunRecording
from radarsim.exploration.options import StrategyName
from radarsim.navigation.options import ROBOT
from radarsim.signal_handlers import raise_on_signals

if TYPE_CHECKING:
    from radarsim.cli.map_report import MapFiles
    from radarsim.evaluation.mapping_run import MappingRun
    from radarsim.exploration.exploration import ExplorationStep

_RESOLUTION_RANGE: Final = 0.005, 1  # m; finer, a room would have millions of cells


class MotionSourceName(StrEnum):
    """Sensor from which the robot's motion between scans is read."""

    INS = "ins"
    ODOMETRY = "odometry"
    NONE = "none"


class Mode(StrEnum):
    """Contents of the map for nav2."""

    TRINARY = "trinary"
    SCALE = "scale"


def _check_resolution(value: float) -> float:
    finest, coarsest = _RESOLUTION_RANGE
    if not finest <= value <= coarsest:
        text = f"{value!r}, expected {finest:g} to {coarsest:g}"
        raise typer.BadParameter(text)
    return value


def map_(
    out: Annotated[
        str,
        typer.Argument(
            metavar="OUT",
            help="A folder, or what the names of the files begin with.",
        ),
    ],
    *,
    strategy: Annotated[
        StrategyName | None,
        typer.Option(help="Strategy of exploring.", show_default="auto"),
    ] = None,
    way: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y",
            help="Drive to this waypoint instead of exploring, m, map frame; repeat it"
            " for waypoints to reach in turn.",
        ),
    ] = None,
    through: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            metavar="PORT",
            help="Map what another client drives: forward this port to the server"
            " until interrupted; 0 takes a free one.",
        ),
    ] = None,
    watch: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT",
            help="Map this robot, which another client drives, by watching it on a"
            " server of radarsim, until it leaves or you interrupt.",
        ),
    ] = None,
    host: HostOption = None,
    port: PortOption = None,
    start: StartOption = None,
    pose: PoseOption = None,
    robot: Annotated[
        str | None,
        typer.Option(
            help="Class of the robot; to explore, it has to see all the way round.",
            show_default=ROBOT,
        ),
    ] = None,
    scanner: Annotated[
        str | None, typer.Option(help="Scanner to map with; the first by default.")
    ] = None,
    seed_from: Annotated[
        MotionSourceName,
        typer.Option(
            "--seed-from",
            "--motion-from",
            help="Sensor from which the motion between scans is read.",
        ),
    ] = MotionSourceName.INS,
    echoes: Annotated[
        bool,
        typer.Option(
            help="Ask the server for the echoes of each beam, or use ranges alone."
        ),
    ] = True,
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
    radius: Annotated[
        float,
        typer.Option(
            metavar="M",
            callback=check_positive,
            help="Farthest distance from the start, where no walls are nearer.",
        ),
    ] = 12.0,
    speed: Annotated[
        float,
        typer.Option(metavar="M_PER_S", callback=check_positive, help="Maximum speed."),
    ] = 0.4,
    drive_unit: DriveUnitOption = DriveUnit.RAD_PER_S,
    timeout: TimeoutOption = 2.0,
    time_limit: TimeLimitOption = 3600.0,
    mount: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,YAW_DEG",
            help="With --through or --watch, pose of the scanner on the robot, if the"
            " server does not tell it.",
        ),
    ] = None,
    max_range: Annotated[
        float | None,
        typer.Option(
            metavar="M",
            callback=check_positive,
            help="With --through or --watch, maximum range of the scanner, if the"
            " server does not tell it.",
        ),
    ] = None,
    resolution: Annotated[
        float,
        typer.Option(metavar="M", callback=_check_resolution, help="Side of a cell."),
    ] = 0.05,
    mode: Annotated[
        Mode,
        typer.Option(
            help="Cells of the map for nav2: occupied, free and unknown, or"
            " probabilities."
        ),
    ] = Mode.TRINARY,
    as_json: JsonOption = False,
    serve: Annotated[
        str | None,
        typer.Option(
            metavar="MAP",
            help="Simulate this map here, as fast as possible, instead of connecting to"
            " a server, and judge the result by it.",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Seed of the simulation of --serve, and of the strategy turn_away.",
            show_default="0",
        ),
    ] = None,
    settings: ServedSettingsOption = None,
    record: RecordOption = None,
    film: FilmOption = None,
    film_speed: FilmSpeedOption = 6.0,
) -> None:
    """Explore with a robot and map what it senses, or map what another client drives.

    Writes OUT.png in UsarCommander's colours, OUT.pgm with OUT.yaml for
    nav2's map_server, the robot's trajectory as OUT.tum, and OUT_view.png,
    the map with the robot's path, a scale and a legend.
    """
    from radarsim.cli.film import check_film
    from radarsim.cli.map_proxy import FollowedMapping
    from radarsim.cli.map_report import MapFiles
    from radarsim.evaluation.mapping_run import MappingRun
    from radarsim.exploration.exploration import (
        ExplorationPlan,
        warm_up,
    )
    from radarsim.navigation.control import SpeedLimits

    check_server_options(serve, host=host, port=port, seed=None, settings=settings)
    if strategy is not None and way:
        raise typer.BadParameter("expected only one of --strategy and --way")
    if serve is None and strategy is not StrategyName.TURN_AWAY:
        text = "expected --serve or --strategy turn_away with it"
        refuse_options({"--seed": seed}, text)
    files = MapFiles(out, mode.value)
    recording = RunRecording(record, drive_unit)
    if through is not None and watch is not None:
        raise typer.BadParameter("expected only one of --through and --watch")
    if through is not None or watch is not None:
        others = {
            "--serve": serve,
            "--strategy": strategy,
            "--way": way or None,
            "--start": start,
            "--pose": pose,
            "--robot": robot,
            "--safety-distance": safety_distance,
            "--foliage-density": foliage_density,
        }
        option = "--watch" if through is None else "--through"
        text = f"expected no {option} with it, where another client drives"
        refuse_options(others, text)
        check_film(film)
        mapping = FollowedMapping(
            files,
            server_address(host, port),
            recording=recording,
            film=film,
            film_speed=film_speed,
            motion_source=seed_from.value,
            resolution=resolution,
            scanner=scanner,
            mount=mount,
            max_range=max_range,
            as_json=as_json,
        )
        if watch is not None:
            raise typer.Exit(mapping.watch(watch, echoes=echoes))
        raise typer.Exit(mapping.run_proxy(through or 0))
    text = "expected --through or --watch with it, where another client drives"
    refuse_options({"--mount": mount, "--max-range": max_range}, text)
    plan = ExplorationPlan(
        strategy=strategy or StrategyName.AUTO,
        waypoints=tuple(read_point(text, "--way") for text in way or ()),
        motion_source=seed_from.value,
        echoes=echoes,
        resolution=resolution,
        robot_class=robot or ROBOT,
        start=start,
        pose=None if pose is None else read_pose(pose, "--pose"),
        scanner=scanner,
        safety_distance=safety_distance,
        penetration_depth=penetration_depth(foliage_density, penetration_power),
        speed_limits=SpeedLimits(speed=speed),
        radius=radius,
        time_limit=time_limit,
        timeout=timeout,
        drive_unit=drive_unit.value,
    )
    files.check(served=serve)
    check_film(film)
    served = recording.load_host(serve, seed=seed, settings=settings)
    check_robot(plan.robot_class, served)
    check_start(start, pose, None if served is None else served.simulation.scene)
    warm_up()
    run = MappingRun(plan, served, seed=seed or 0)
    run.connect = recording.connect
    _explore(
        run,
        files,
        recording,
        server_address(host, port),
        film=film,
        film_speed=film_speed,
        as_json=as_json,
    )
    raise typer.Exit(int(bool(run.result.error)))


def _explore(
    run: MappingRun,
    files: MapFiles,
    recording: RunRecording,
    address: tuple[str, int],
    *,
    film: Path | None,
    film_speed: float,
    as_json: bool,
) -> None:
    """Let a run explore; write, judge and describe its map however it ends."""
    from radarsim.cli.film import filmed
    from radarsim.cli.map_report import map_progress, print_result, save_map
    from radarsim.cli.map_view import MapCamera

    camera = MapCamera(run.result, run.exploration)
    with (
        raise_on_signals(),
        recording,
        filmed(film, camera.draw, film_speed) as update_film,
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
                save_map(run.result, files)
            print_result(run.result, as_json=as_json)
