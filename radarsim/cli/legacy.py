"""The typer application: all commands, and how the process ends.

Modules of commands import what is heavy inside their functions, so that
``radarsim --help`` answers at once.
"""

from typing import Annotated

import typer

from radarsim import __version__
from radarsim.addons.fmcw.commands import spectrum
from radarsim.addons.imports.commands import import_
from radarsim.addons.recording.commands import recording, replay
from radarsim.addons.ros.commands import ros
from radarsim.addons.web.commands import commander
from radarsim.cli.check import check
from radarsim.cli.compile_progress import with_compile_progress
from radarsim.cli.demo import demo
from radarsim.cli.docs import docs
from radarsim.cli.drive import drive
from radarsim.cli.explain import explain
from radarsim.cli.legacy_usage import PlainGroup
from radarsim.cli.new import new
from radarsim.cli.presets import materials, sensors
from radarsim.cli.serve import serve

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


app.command()(with_compile_progress(demo))
app.command()(serve)
app.command()(with_compile_progress(check))
app.command()(new)
app.command("import")(import_)
app.command()(with_compile_progress(spectrum))
app.command()(with_compile_progress(explain))
app.command()(sensors)
app.command()(materials)
app.command()(drive)
app.command()(commander)
app.command()(with_compile_progress(replay))
app.add_typer(recording, name="recording")
app.command()(ros)
app.command()(docs)
