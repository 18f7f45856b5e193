"""``radarsim map``: explore with a robot and map what it senses."""

from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING, Final

import typer

from radarsim.addons.recording.run_recording import RunRecording
from radarsim.autonomy.commands.map_options import (
    DensityOption,
    EchoesOption,
    MapRangeOption,
    MaxRangeOption,
    Mode,
    ModeOption,
    MotionOption,
    MotionSourceName,
    MountOption,
    OutArgument,
    RadiusOption,
    ResolutionOption,
    RobotOption,
    RobotsOption,
    ScannerOption,
    SeedOption,
    ServeOption,
    SpeedOption,
    StrategyOption,
    ThroughOption,
    WatchOption,
    WayOption,
)
from radarsim.autonomy.exploration.options import StrategyName
from radarsim.autonomy.navigation.algorithms import ROBOT
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
    RecordOption,
    SafetyOption,
    ServedSettingsOption,
    StartOption,
    TimeLimitOption,
    TimeoutOption,
    check_robot,
    check_server_options,
    check_start,
    given_options,
    read_item_settings,
    read_point,
    read_pose,
    refuse_options,
    server_address,
)
from radarsim.cli.output import MESSAGE_FORM, start_log

if TYPE_CHECKING:
    from radarsim.autonomy.commands.map_files import MapOutput
    from radarsim.autonomy.exploration.exploration import ExplorationPlan
    from radarsim.server.host import Host

# Options that only apply to a robot that is driven, and to one that is followed.
DRIVING: Final = (
    *("serve", "strategy", "way", "start", "pose", "robot", "robots"),
    *("safety_distance", "foliage_density"),
)
FOLLOWING: Final = ("mount", "max_range")
# Options that only apply to one robot.
SINGLE: Final = ("way", "pose", "film", "record")


def map_(
    context: typer.Context,
    out: OutArgument,
    *,
    strategy: StrategyOption = None,
    way: WayOption = None,
    through: ThroughOption = None,
    watch: WatchOption = None,
    host: HostOption = None,
    port: PortOption = None,
    start: StartOption = None,
    pose: PoseOption = None,
    robot: RobotOption = None,
    robots: RobotsOption = 1,
    scanner: ScannerOption = None,
    seed_from: MotionOption = MotionSourceName.INS,
    echoes: EchoesOption = True,
    safety_distance: SafetyOption = None,
    foliage_density: DensityOption = None,
    penetration_power: PowerOption = 1.0,
    radius: RadiusOption = 12.0,
    speed: SpeedOption = 0.4,
    drive_unit: DriveUnitOption = DriveUnit.RAD_PER_S,
    timeout: TimeoutOption = 2.0,
    time_limit: TimeLimitOption = 3600.0,
    mount: MountOption = None,
    max_range: MaxRangeOption = None,
    resolution: ResolutionOption = 0.05,
    map_range: MapRangeOption = None,
    mode: ModeOption = Mode.TRINARY,
    as_json: JsonOption = False,
    serve: ServeOption = None,
    seed: SeedOption = None,
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
    check_server_options(serve, host=host, port=port, seed=None, settings=settings)
    _check_combination(context, seed=seed, strategy=strategy)

    from radarsim.autonomy.commands.map_files import MapFiles, MapOutput
    from radarsim.autonomy.commands.map_proxy import FollowedMapping
    from radarsim.autonomy.exploration.exploration import ExplorationPlan

    recording = RunRecording(record, drive_unit.value)
    files = MapFiles(out, mode.value, robots)
    output = MapOutput(files, recording, film, film_speed, as_json)
    address = server_address(host, port)
    if through is not None or watch is not None:
        followed = FollowedMapping(
            output,
            address,
            motion_source=seed_from.value,
            resolution=resolution,
            map_range=map_range or math.inf,
            scanner=scanner,
            mount=mount,
            max_range=max_range,
        )
        raise typer.Exit(followed.run(through, watch, echoes=echoes))
    plan = ExplorationPlan(
        strategy=strategy or StrategyName.AUTO,
        waypoints=tuple(read_point(text, "--way") for text in way or ()),
        motion_source=seed_from.value,
        echoes=echoes,
        resolution=resolution,
        map_range=map_range or math.inf,
        robot_class=robot or ROBOT,
        start=start,
        pose=None if pose is None else read_pose(pose, "--pose"),
        scanner=scanner,
        safety_distance=safety_distance,
        foliage_density=foliage_density,
        penetration_power=penetration_power,
        speed=speed,
        radius=radius,
        time_limit=time_limit,
        timeout=timeout,
        drive_unit=drive_unit.value,
    )
    output.check(served=serve)
    items = read_item_settings(settings or [])
    served = recording.load_host(serve, seed=seed, settings=items)
    check_start(start, pose, None if served is None else served.simulation.scene)
    raise typer.Exit(_explore(plan, output, address, served, seed or 0, robots))


def _explore(
    plan: ExplorationPlan,
    output: MapOutput,
    address: tuple[str, int],
    served: Host | None,
    seed: int,
    robots: int,
) -> int:
    """Explore by a plan with some robots, on a server or on a host in this process.

    Returns:
        The exit code.
    """
    from radarsim.autonomy.commands.map_run import explore, explore_together
    from radarsim.autonomy.evaluation.mapping_run import MappingRun, MultiRobotRun
    from radarsim.autonomy.exploration.compilation import warm_up

    check_robot(plan.robot_class, served)
    start_log(logging.WARNING, MESSAGE_FORM)
    warm_up()
    if robots > 1:
        together = MultiRobotRun(plan, robots, served)
        explore_together(together, output, address)
        return int(bool(together.result.error))
    run = MappingRun(plan, served, seed=seed)
    run.connect = output.recording.connect
    explore(run, output, address)
    return int(bool(run.result.error))


def _check_combination(
    context: typer.Context, *, seed: int | None, strategy: StrategyName | None
) -> None:
    """Refuse options that exclude each other, or that nothing would use."""
    given = given_options(context)
    if {"strategy", "way"} <= given.keys():
        raise typer.BadParameter("expected only one of --strategy and --way")
    if "serve" not in given and strategy is not StrategyName.TURN_AWAY:
        text = "expected --serve or --strategy turn_away with it"
        refuse_options({"--seed": seed}, text)
    if context.params["robots"] > 1:
        text = "expected one robot with it"
        refuse_options({given[k]: k for k in SINGLE if k in given}, text)
        if strategy not in (None, StrategyName.AUTO, StrategyName.FRONTIERS):
            text = f"{strategy.value!r} with several robots, expected auto or frontiers"
            raise typer.BadParameter(text, param_hint="--strategy")
    follows = given.keys() & {"through", "watch"}
    if len(follows) > 1:
        raise typer.BadParameter("expected only one of --through and --watch")
    where = "where another client drives"
    if follows:
        text = f"expected no --{follows.pop()} with it, {where}"
        refuse_options({given[k]: k for k in DRIVING if k in given}, text)
    else:
        text = f"expected --through or --watch with it, {where}"
        refuse_options({given[k]: k for k in FOLLOWING if k in given}, text)
