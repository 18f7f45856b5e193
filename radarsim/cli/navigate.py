"""``radarsim navigate``."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import typer

from radarsim.cli.navigate_options import MissionWish, ServerWish
from radarsim.cli.navigate_report import as_json as told_as_json
from radarsim.cli.navigate_report import as_text, title_of
from radarsim.cli.options import check_writable, write_file
from radarsim.cli.progress import progress
from radarsim.evaluation.free_space import floor_plan
from radarsim.evaluation.navigation_run import NavigationRun

EXIT_CODES = {"reached": 0, "no_path": 3}
FORMS = ("png", "svg", "pdf")


@dataclass(frozen=True, slots=True)
class Files:
    """What to write.

    Attributes:
        trace: A row for each scan, or None.
        plot: A picture, or None.
    """

    trace: Path | None
    plot: Path | None

    def check(self) -> None:
        """Find out before the robot drives what could not be written after it.

        Raises:
            typer.BadParameter: If a folder is not there, or a form is not known.
        """
        for hint, path in (("--trace", self.trace), ("--plot", self.plot)):
            if path is not None:
                check_writable(path, hint)
        if self.plot is not None and self.form not in FORMS:
            text = f"{str(self.plot)!r}, expected a name that ends in one of {FORMS}"
            raise typer.BadParameter(text, param_hint="--plot")

    @property
    def form(self) -> str:
        """What the picture is to be."""
        return "" if self.plot is None else self.plot.suffix.lower().lstrip(".")


def run_navigator(
    wish: MissionWish, server: ServerWish, files: Files, *, as_json: bool
) -> int:
    """Drive a robot to its goals, print how it went, and give the exit code.

    Raises:
        ClientError: If the server does not say what is needed.
        MapError: If the map is wrong.
        NavigationError: If the robot cannot do what is asked of it.
        typer.BadParameter: If an option is wrong.
    """
    server.check()
    files.check()
    host = server.open()
    run = NavigationRun(
        wish.read(None if host is None else host.simulation.scene), host
    )
    with (
        _written(run, files),
        _printed(run, as_json=as_json),
        progress(run.run_log) as reporter,
    ):
        run.execute(server.address, reporter.tell)
    if run.error:
        typer.echo(f"radarsim: {run.error}", err=True)
    return EXIT_CODES.get(run.outcome, 1)


@contextmanager
def _printed(run: NavigationRun, *, as_json: bool) -> Iterator[None]:
    """Print how a run went; programs are told of one that broke off, too."""
    try:
        yield
    except BaseException as error:
        said = str(error) if isinstance(error, Exception) else "interrupted"
        run.error = run.error or said
        if as_json:
            typer.echo(told_as_json(run))
        raise
    typer.echo(told_as_json(run) if as_json else "\n".join(as_text(run)))


@contextmanager
def _written(run: NavigationRun, files: Files) -> Iterator[None]:
    """Write the files in the end, however that comes."""
    try:
        yield
    finally:
        if files.trace is not None:
            write_file(files.trace, run.run_log.as_csv().encode(), "--trace")
        if files.plot is not None and run.run_log.rows:
            write_file(files.plot, _picture(run, files.form), "--plot")


def _picture(run: NavigationRun, form: str) -> bytes:
    from radarsim.plotting.runs import (
        NO_LINES,
        draw_run,
    )

    plan = NO_LINES if run.scene is None else floor_plan(run.scene)
    return draw_run(run.run_log, title_of(run), plan=plan, form=form)
