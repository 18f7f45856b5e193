"""``radarsim navigate``: drive a robot to a goal."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Final

import typer

from radarsim.addons.recording.run_recording import RunRecording
from radarsim.autonomy.commands.navigate_options import NavigateOptions
from radarsim.cli.option_class import with_options
from radarsim.cli.options import (
    PICTURE_FORMS,
    check_ending,
    check_server_options,
    check_writable,
    server_address,
    write_file,
)
from radarsim.cli.output import MESSAGE_FORM, print_lines, print_message, start_log
from radarsim.processes import raise_on_signals

if TYPE_CHECKING:
    from radarsim.autonomy.evaluation.navigation_run import NavigationRun
    from radarsim.autonomy.navigation.run_log import Row

EXIT_CODES: Final = {"reached": 0, "no_path": 3}


@with_options(NavigateOptions)
def navigate(options: NavigateOptions) -> None:
    """Drive a robot to a goal; exit with 3 if there is no path."""
    from radarsim.autonomy.commands.film import check_film
    from radarsim.autonomy.evaluation.navigation_run import NavigationRun

    check_server_options(
        options.serve,
        host=options.host,
        port=options.port,
        seed=options.seed,
        settings=options.settings,
    )
    _check_files(options.trace, options.plot)
    check_film(options.film)
    recording = RunRecording(options.record, options.drive_unit)
    served = recording.load_host(
        options.serve, seed=options.seed, settings=options.settings
    )
    run = NavigationRun(options.mission(served), served)
    run.connect = recording.connect
    start_log(logging.WARNING, MESSAGE_FORM)
    with (
        raise_on_signals(),
        recording,
        _write_files(run, options.trace, options.plot),
        _print_result(run, as_json=options.as_json),
    ):
        address = server_address(options.host, options.port)
        _execute(run, address, options.film, options.film_speed)
    if run.error:
        print_message(run.error)
    raise typer.Exit(EXIT_CODES.get(run.outcome, 1))


def _execute(
    run: NavigationRun, address: tuple[str, int], film: Path | None, film_speed: float
) -> None:
    """Drive, show the progress, and film it if a file is given."""
    from radarsim.autonomy.commands.film import filmed
    from radarsim.autonomy.commands.navigate_report import run_progress
    from radarsim.autonomy.commands.navigate_view import RunCamera

    with (
        filmed(film, RunCamera(run).draw, film_speed) as update_film,
        run_progress(run.run_log) as update,
    ):

        def observe(row: Row) -> None:
            update(row)
            update_film(row.time)

        run.execute(address, observe)


def _check_files(trace: Path | None, plot: Path | None) -> None:
    """Check before the run that its files can be written after it."""
    for hint, path in (("--trace", trace), ("--plot", plot)):
        if path is not None:
            check_writable(path, hint)
    if trace is not None and trace.exists() and not _is_trace(trace):
        text = f"{trace} is not a trace by radarsim, expected another file"
        raise typer.BadParameter(text, param_hint="--trace")
    if plot is not None:
        check_ending(plot, PICTURE_FORMS, "--plot")


@contextmanager
def _print_result(run: NavigationRun, *, as_json: bool) -> Iterator[None]:
    """Print the result of a run, also of an interrupted one; else failures as JSON."""
    from radarsim.autonomy.commands.navigate_report import as_json as result_as_json
    from radarsim.autonomy.commands.navigate_report import as_text
    from radarsim.autonomy.evaluation.navigation_run import INTERRUPTED

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
    from radarsim.autonomy.commands.navigate_view import view_of
    from radarsim.autonomy.plotting.runs import draw_run

    return draw_run(view_of(run), form=form)


def _is_trace(path: Path) -> bool:
    """Return whether a file is empty or a trace of a run, by its first line."""
    from radarsim.autonomy.navigation.run_log import trace_header

    header = trace_header().encode()
    try:
        with path.open("rb") as file:
            head = file.readline(len(header) + 1)
    except OSError:
        return False
    return not head or head == header
