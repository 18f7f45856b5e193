"""The typer application: all commands, and how the process ends.

Modules of commands import what is heavy inside their functions, so that
``radarsim --help`` answers at once.
"""

from typing import Annotated

import typer

from radarsim import __version__
from radarsim.autonomy.commands.map import map_
from radarsim.autonomy.commands.trials import trials
from radarsim.cli.compile_progress import with_compile_progress
from radarsim.cli.legacy_usage import PlainGroup
from radarsim.lab.bench.commands import bench
from radarsim.lab.figures.commands import figures
from radarsim.lab.study.commands import study
from radarsim.lab.sweep.commands import sweep

app = typer.Typer(
    no_args_is_help=True,
    cls=PlainGroup,
    pretty_exceptions_enable=False,
    context_settings={
        "help_option_names": ["-h", "--help"],
        "auto_envvar_prefix": "RADARSIM",
    },
    help="A USARSim server without Unreal: a P3AT whose radar sees through foliage.",
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"radarsim {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    *,
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            callback=_print_version,
            is_eager=True,
            help="Print the version and exit.",
        ),
    ] = False,
) -> None:
    pass


app.command()(with_compile_progress(trials))
app.command()(with_compile_progress(study))
app.command()(with_compile_progress(sweep))
app.command("map")(with_compile_progress(map_))
app.command()(with_compile_progress(figures))
app.command()(with_compile_progress(bench))
