"""The typer application: all commands, and how the process ends.

Modules of commands import what is heavy inside their functions, so that
``radarsim --help`` answers at once.
"""

import os
import platform
import sys
import traceback
from pathlib import Path
from typing import Annotated

import typer

from radarsim import __version__
from radarsim.addons.fmcw.commands import spectrum
from radarsim.addons.imports.commands import import_
from radarsim.addons.recording.commands import recording, replay
from radarsim.addons.ros.commands import ros
from radarsim.addons.web.commands import commander
from radarsim.autonomy.commands.map import map_
from radarsim.autonomy.commands.navigate import navigate
from radarsim.autonomy.commands.trials import trials
from radarsim.cli.check import check
from radarsim.cli.compile_progress import with_compile_progress
from radarsim.cli.demo import demo
from radarsim.cli.docs import docs
from radarsim.cli.drive import drive
from radarsim.cli.explain import explain
from radarsim.cli.new import new
from radarsim.cli.output import print_message
from radarsim.cli.presets import materials, sensors
from radarsim.cli.scan import scan
from radarsim.cli.serve import serve
from radarsim.cli.usage import PlainGroup
from radarsim.errors import RadarsimError, describe_os_error
from radarsim.lab.bench.commands import bench
from radarsim.lab.figures.commands import figures
from radarsim.lab.study.commands import study
from radarsim.lab.sweep.commands import sweep
from radarsim.processes import INTERRUPTED, ignore_signals

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
app.command()(with_compile_progress(scan))
app.command()(with_compile_progress(spectrum))
app.command()(with_compile_progress(explain))
app.command()(sensors)
app.command()(materials)
app.command()(drive)
app.command()(commander)
app.command()(with_compile_progress(navigate))
app.command()(with_compile_progress(trials))
app.command()(with_compile_progress(study))
app.command()(with_compile_progress(sweep))
app.command("map")(with_compile_progress(map_))
app.command()(with_compile_progress(figures))
app.command()(with_compile_progress(replay))
app.add_typer(recording, name="recording")
app.command()(ros)
app.command()(docs)
app.command()(with_compile_progress(bench))


def _replace_closed_streams() -> None:
    """Open the null device for each stream that the parent process has closed.

    Else Python has None for it, and the next file that is opened gets its number.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            stream = Path(os.devnull).open(mode, encoding="utf-8")  # noqa: SIM115
            setattr(sys, name, stream)


def _report_text() -> str:
    """Return what is to be reported of a bug."""
    return (
        "this is an error in radarsim itself; please report the lines above, the"
        " command with its files, and these versions:"
        f" radarsim {__version__}, Python {platform.python_version()},"
        f" {platform.platform()}"
    )


def main() -> None:
    """Run a command and exit with its code."""
    _replace_closed_streams()
    try:
        app()
    except RadarsimError as error:
        print_message(str(error))
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
    except OSError as error:
        name = "" if error.filename is None else f" {error.filename}"
        reason = describe_os_error(error)
        print_message(f"cannot write{name}: {reason}")
        # Python flushes stdout once more at exit, and would report the error again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
    except Exception as error:  # noqa: BLE001 - a bug: all of it is told
        traceback.print_exception(error)
        print_message(_report_text())
        sys.exit(1)
    finally:
        ignore_signals()
