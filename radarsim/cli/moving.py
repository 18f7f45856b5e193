"""The commands that send robots to goals, and what they take.

Nothing heavy is imported before a command runs, as in ``commands``.
"""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from radarsim.cli.options import (
    DriveUnit,
    DriveUnitOption,
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
)
from radarsim.cli.signals import exit_143_on_sigterm
from radarsim.navigation.options import ROBOT, Algorithm, GiveUp, PoseSource, Rule


class Side(StrEnum):
    """The hand on which boundaries are kept."""

    LEFT = "left"
    RIGHT = "right"


def navigate(
    *,
    algorithm: Annotated[Algorithm, typer.Option(help="Bug1 or Bug2.")],
    goal: Annotated[
        list[str] | None,
        typer.Option(metavar="X,Y", help="m, map frame; again for way points in turn."),
    ] = None,
    host: HostOption = None,
    port: PortOption = None,
    start: StartOption = None,
    pose: PoseOption = None,
    robot: Annotated[
        str, typer.Option(help="Class; it has to see all around.")
    ] = ROBOT,
    scanner: Annotated[
        str | None, typer.Option(help="The one to steer by; the first by default.")
    ] = None,
    safety_distance: SafetyOption = None,
    foliage_density: Annotated[
        float | None,
        typer.Option(
            metavar="PER_M",
            help="Of the thinnest foliage that it may meet: the radar sees into it.",
        ),
    ] = None,
    penetration_power: PowerOption = 1.0,
    bumpers: Annotated[int, typer.Option(min=4, max=36, help="How many.")] = 8,
    share: Annotated[
        float, typer.Option(help="Of a bumper's beams that press it.")
    ] = 0.1,
    rule: Annotated[
        Rule, typer.Option(help="A share of the beams is near, or all in the band.")
    ] = Rule.SHARE,
    side: Annotated[
        Side, typer.Option(help="The hand on which boundaries are kept.")
    ] = Side.LEFT,
    give_up: Annotated[
        GiveUp, typer.Option(help="Where Bug2 says that there is no path.")
    ] = GiveUp.HIT_POINT,
    pose_from: Annotated[
        PoseSource, typer.Option(help="The reading to take the pose from.")
    ] = PoseSource.INS,
    speed: Annotated[
        float,
        typer.Option(metavar="M_PER_S", help="At most, and the robot's own limit."),
    ] = 0.3,
    drive_unit: DriveUnitOption = DriveUnit.RAD_PER_S,
    timeout: TimeoutOption = 2.0,
    time_limit: TimeLimitOption = 3600.0,
    as_json: JsonOption = False,
    trace: Annotated[
        Path | None, typer.Option(metavar="FILE", help="CSV, a row for each scan.")
    ] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A .png, .svg or .pdf.")
    ] = None,
    serve: Annotated[
        str | None,
        typer.Option(
            metavar="MAP",
            help="Simulate this map here, as fast as can be, instead of connecting;"
            " its trial says start, goal and safety distance where nothing else does.",
        ),
    ] = None,
    seed: ServedSeedOption = None,
    settings: ServedSettingsOption = None,
) -> None:
    """Drive a robot to a goal by its long-range bumpers; exits with 3 for no path."""
    exit_143_on_sigterm()
    from radarsim.cli.navigate import Files, run_navigator
    from radarsim.cli.navigate_options import MissionWish, ServerWish

    server = ServerWish(host, port, serve, seed, settings or [], drive_unit.value)
    mission = MissionWish(
        algorithm=algorithm.value,
        goals=goal or [],
        start=start,
        pose=pose,
        robot=robot,
        scanner=scanner,
        safety_distance=safety_distance,
        foliage_density=foliage_density,
        penetration_power=penetration_power,
        bumpers=bumpers,
        share=share,
        rule=rule.value,
        side=side.value,
        give_up=give_up.value,
        pose_from=pose_from.value,
        speed=speed,
        drive_unit=drive_unit.value,
        timeout=timeout,
        time_limit=time_limit,
    )
    files = Files(trace, plot)
    raise typer.Exit(run_navigator(mission, server, files, as_json=as_json))
