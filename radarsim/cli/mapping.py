"""The command that makes maps, and what it takes.

Nothing heavy is imported before it runs, as in ``commands``.
"""

from enum import StrEnum
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
    ServedSettingsOption,
    StartOption,
    TimeLimitOption,
    TimeoutOption,
)
from radarsim.cli.signals import exit_143_on_sigterm
from radarsim.exploration.options import StrategyName


class SeedFrom(StrEnum):
    """What tells the robot's motion between scans."""

    INS = "ins"
    ODOMETRY = "odometry"
    NONE = "none"


class Mode(StrEnum):
    """What the map for nav2 tells."""

    TRINARY = "trinary"
    SCALE = "scale"


def map_(
    out: Annotated[
        str,
        typer.Argument(
            metavar="OUT", help="A folder, or what the names of the files begin with."
        ),
    ],
    *,
    strategy: Annotated[
        StrategyName | None,
        typer.Option(help="How to explore.", show_default="auto"),
    ] = None,
    way: Annotated[
        list[str] | None,
        typer.Option(
            metavar="X,Y",
            help="Drive here instead of exploring, m, map frame; again for more"
            " places in turn.",
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
    host: HostOption = None,
    port: PortOption = None,
    start: StartOption = None,
    pose: PoseOption = None,
    robot: Annotated[
        str | None,
        typer.Option(
            help="Class; to explore it has to see all around.",
            show_default="P3AT_Radar360",
        ),
    ] = None,
    scanner: Annotated[
        str | None, typer.Option(help="The one to map with; the first by default.")
    ] = None,
    seed_from: Annotated[
        SeedFrom, typer.Option(help="What tells the motion between scans.")
    ] = SeedFrom.INS,
    echoes: Annotated[
        bool,
        typer.Option(help="Ask the server what its beams meet, or go by ranges alone."),
    ] = True,
    safety_distance: SafetyOption = None,
    foliage_density: Annotated[
        float | None,
        typer.Option(
            metavar="PER_M",
            help="Of the thinnest foliage that it may meet; for servers that tell no"
            " echoes, as the radar sees into it.",
        ),
    ] = None,
    penetration_power: PowerOption = 1.0,
    radius: Annotated[
        float,
        typer.Option(
            metavar="M", help="From the start, where there is no border to end at."
        ),
    ] = 12.0,
    speed: Annotated[float, typer.Option(metavar="M_PER_S", help="At most.")] = 0.4,
    drive_unit: DriveUnitOption = DriveUnit.RAD_PER_S,
    timeout: TimeoutOption = 2.0,
    time_limit: TimeLimitOption = 3600.0,
    mount: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,YAW_DEG",
            help="With --through, of the scanner on a robot whose client does not ask.",
        ),
    ] = None,
    max_range: Annotated[
        float | None,
        typer.Option(
            metavar="M", help="With --through, of the scanner, if nobody asks."
        ),
    ] = None,
    resolution: Annotated[
        float, typer.Option(metavar="M", help="Side of a cell.")
    ] = 0.05,
    mode: Annotated[
        Mode, typer.Option(help="Occupied, free and unknown, or how likely.")
    ] = Mode.TRINARY,
    as_json: JsonOption = False,
    serve: Annotated[
        str | None,
        typer.Option(
            metavar="MAP",
            help="Simulate this map here, as fast as can be, instead of connecting,"
            " and judge the result by it.",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Of the simulation of --serve, and of turn_away's chance.",
            show_default="0",
        ),
    ] = None,
    settings: ServedSettingsOption = None,
) -> None:
    """Explore with a robot and map what it senses, or map what another client drives.

    Writes OUT.png in UsarCommander's colours, OUT.pgm with OUT.yaml for nav2's
    map_server, and the way of the robot as OUT.tum.
    """
    exit_143_on_sigterm()
    from radarsim.cli.map import run_survey
    from radarsim.cli.map_options import MapWish
    from radarsim.cli.navigate_options import ServerWish

    served = None if serve is None else seed
    server = ServerWish(host, port, serve, served, settings or [], drive_unit.value)
    wish = MapWish(
        strategy=None if strategy is None else strategy.value,
        way=way or [],
        through=through,
        seed=seed,
        start=start,
        pose=pose,
        robot=robot,
        scanner=scanner,
        seed_from=seed_from.value,
        echoes=echoes,
        safety_distance=safety_distance,
        foliage_density=foliage_density,
        penetration_power=penetration_power,
        radius=radius,
        speed=speed,
        drive_unit=drive_unit.value,
        timeout=timeout,
        time_limit=time_limit,
        mount=mount,
        max_range=max_range,
        resolution=resolution,
    )
    raise typer.Exit(run_survey(out, mode.value, wish, server, told_as_json=as_json))
