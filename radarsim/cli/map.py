"""``radarsim map``."""

from typing import Final

import typer

from radarsim.cli.map_options import MapWish
from radarsim.cli.map_progress import progress
from radarsim.cli.map_report import MapFiles, MapRun, as_json, as_text, keep
from radarsim.cli.navigate_options import ServerWish
from radarsim.cli.signals import ending_at_once
from radarsim.client import Client
from radarsim.evaluation.map_score import judge_mapper
from radarsim.evaluation.trials import GroundTruthMonitor
from radarsim.exploration.exploration import (
    Exploration,
    ExplorationPlan,
    ExplorationStep,
    Outcome,
    warm_up,
)
from radarsim.host import Host
from radarsim.host.lockstep import InProcessTransport
from radarsim.mapping.export import NavMode
from radarsim.rng import generator_for

INTERRUPTED: Final = "interrupted"


def run_survey(
    out: str, mode: NavMode, wish: MapWish, server: ServerWish, *, told_as_json: bool
) -> int:
    """Make a map, write it, print how that went, and give the exit code.

    Args:
        out: Where it is to be.
        mode: Of the map for nav2.
        wish: What to map.
        server: Where.
        told_as_json: For programs.

    Raises:
        ClientError: If the server does not say what is needed.
        MapError: If the map file is wrong.
        NavigationError: If the robot cannot do what is asked of it.
        typer.BadParameter: If an option is wrong.
    """
    server.check()
    wish.check()
    files = MapFiles(out, mode)
    wish.check_seed(served=server.map_ is not None)
    if wish.through is not None:
        return _overhear(wish, server, files, told_as_json=told_as_json)
    files.check(served=server.map_)
    host = server.open()
    with ending_at_once():
        warm_up()
    plan = wish.read(None if host is None else host.simulation.scene)
    run = MapRun("way" if plan.way else plan.strategy.value, plan.seed)
    survey = Exploration(plan, generator_for(wish.seed or 0, "exploring"))
    try:
        _explore(survey, _connect(run, host, server))
    except BaseException as error:
        run.error = str(error) if isinstance(error, Exception) else INTERRUPTED
        raise
    finally:  # however it ends, what there is of the map is kept and told of
        _take_stock(run, survey)
        keep(run, files)
        _judge(run, host, plan)
        _tell(run, told_as_json=told_as_json)
    return int(bool(run.error))


def _overhear(
    wish: MapWish, server: ServerWish, files: MapFiles, *, told_as_json: bool
) -> int:
    """Map what another client drives."""
    from radarsim.cli.map_proxy import overhear

    if server.map_ is not None:
        text = "expected no --serve with it"
        raise typer.BadParameter(text, param_hint="--through")
    run, code = overhear(wish, server, files)
    _tell(run, told_as_json=told_as_json)
    return code


def _connect(run: MapRun, host: Host | None, server: ServerWish) -> Client:
    if host is None:
        return Client.connect(*server.address)
    run.referee = GroundTruthMonitor(host)
    return Client(InProcessTransport(host, after_tick=run.referee.watch))


def _explore(survey: Exploration, client: Client) -> None:
    """Explore, and tell on stderr how it goes."""
    with client, progress(survey) as teller:

        def observe(moment: ExplorationStep) -> None:
            teller.tell(moment.doing)

        survey.run(client, observe)


def _take_stock(run: MapRun, survey: Exploration) -> None:
    """Note how a survey went, as far as it came."""
    run.outcome, run.course = survey.outcome.value, survey.course
    run.mapper, run.safety_distance = survey.mapper, survey.safety_distance
    run.unreached = survey.unreached
    if run.error not in ("", INTERRUPTED) and survey.outcome is Outcome.BROKEN_OFF:
        run.outcome = Outcome.FAILED.value


def _judge(run: MapRun, host: Host | None, plan: ExplorationPlan) -> None:
    """Compare the map with the scene, if both are there."""
    mapper, start = run.mapper, run.course.start
    if host is None or mapper is None or start is None:
        return
    run.score = judge_mapper(
        mapper, host.simulation.scene, robot_class=plan.robot_class, start=start
    )


def _tell(run: MapRun, *, told_as_json: bool) -> None:
    """Print how it was; a run that failed before its first scan has only JSON."""
    if told_as_json:
        typer.echo(as_json(run))
    elif run.course.start is not None or not run.error:
        typer.echo("\n".join(as_text(run)))
