"""``radarsim map``: explore with a robot that builds a map."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import click
from annotated_types import Interval

from radarsim.autonomy.cli.run_files import check_start, make_recording
from radarsim.autonomy.plans import ExplorationPlan, StrategyName
from radarsim.cli.fields import (
    LOCAL_SERVER,
    Json,
    RunFiles,
    Simulation,
    check_robot,
)
from radarsim.cli.output import MESSAGE_FORM, start_log, without_empty_folder
from radarsim.plans import RARE, Option


@dataclass(frozen=True, slots=True, kw_only=True)
class MappedPlace(Simulation):
    """The simulation, the server, or the watched robot that provides the scans.

    Attributes:
        watch: Map the scans of this robot of another client.
        seed: Seed of simulation and turn_away.
    """

    one_required: ClassVar = ()  # a watched robot may be on the default server
    at_most_one: ClassVar = (
        ("map", "connect"),
        ("map", "watch"),
    )

    watch: Annotated[str | None, Option(metavar="ROBOT")] = None
    seed: Annotated[int, Interval(ge=0)] = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class MapFileOptions(RunFiles):
    """Options for the map files that ``radarsim map`` writes.

    Attributes:
        output: Folder (ends in a slash) or prefix of files; by default the map's name.
        plot: Plot the known area over time as a .png, .svg or .pdf file.
        mode: Cells of the nav2 map: occupied, free and unknown, or probabilities.
    """

    output: Annotated[str | None, Option(names=("-o", "--output"), metavar="OUT")] = (
        None
    )
    plot: Path | None = None
    mode: Annotated[Literal["trinary", "scale"], RARE] = "trinary"


def map_(
    where: MappedPlace,
    plan: ExplorationPlan,
    files: MapFileOptions,
    *,
    as_json: Json = False,
) -> int:
    """Explore with a robot that builds a map.

    Writes OUT.png, OUT.pgm and OUT.yaml for nav2, the trajectory OUT.tum, and
    OUT_view.png with path, scale and legend.

    Args:
        where: The simulation, the server, or the robot to watch.
        plan: How to explore.
        files: What to write.
        as_json: Print JSON instead of text.

    Returns:
        The exit code.
    """
    _check_combination(where, plan, files)

    # Importing numpy and the plots is slow, so it happens
    # only after invalid options have been reported.
    from radarsim.autonomy.cli.map_output import MapFiles, explore, follow
    from radarsim.autonomy.evaluation.mapping_run import MappingRun

    recording = make_recording(files.record, plan.drive_unit, robots_map=True)
    # The name of a map ends before the ``@`` that precedes its variant.
    written = MapFiles(files, Path((where.map or "map").partition("@")[0]).stem)
    address = where.connect or LOCAL_SERVER
    with without_empty_folder(written.stem.parent):
        if where.watch is not None:
            robot = where.watch
            return follow(plan, written, recording, address, robot, as_json=as_json)
        written.check(served=where.map)
        served = where.load_host(plan.drive_unit)
        if served is not None and where.map is not None:
            recording.attach(served, where.map)
        check_start(None if served is None else served.simulation.scene, plan.start)
        check_robot(plan.robot_class, served)
        start_log(logging.WARNING, MESSAGE_FORM)
        run = MappingRun(plan, served, seed=where.seed)
        explore(run, written, recording, address, as_json=as_json)
        return int(bool(run.error))


def _check_combination(
    where: MappedPlace, plan: ExplorationPlan, files: MapFileOptions
) -> None:
    """Reject options that exclude each other, and options without any effect."""
    if where.map is None and where.connect is None and where.watch is None:
        raise click.UsageError("missing: one of MAP and --connect")
    is_random = plan.strategy is StrategyName.TURN_AWAY
    if where.seed and where.map is None and not is_random:
        text = "needs MAP or --strategy turn_away"
        raise click.BadParameter(text, param_hint="--seed")
    if where.watch is not None:
        default = ExplorationPlan()
        driving = {
            "--strategy": plan.strategy is not default.strategy,
            "--way": plan.waypoints,
            "--start": plan.start,
            "--pose": plan.pose,
            "--robot": plan.robot_class != default.robot_class,
            "--safety-distance": plan.safety_distance,
            "--plot": files.plot,
            "--foliage-density": plan.foliage_density,
        }
        text = "cannot be combined with --watch, where another client drives"
        for name, value in driving.items():
            if value:
                raise click.BadParameter(text, param_hint=name)
