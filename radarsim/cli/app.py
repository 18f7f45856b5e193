"""The commands and what they take; what they do is in the modules beside this one.

Nothing heavy is imported before a command runs: ``radarsim --help`` answers at once.
"""

import atexit
import os
import signal
import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from radarsim import __version__
from radarsim.cli.mapping import map_
from radarsim.cli.moving import navigate, trials
from radarsim.cli.options import DriveUnit, DriveUnitOption, JsonOption, SeedOption
from radarsim.cli.signals import end_unfinished
from radarsim.errors import RadarsimError

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="A USARSim server without Unreal: a P3AT whose radar sees through foliage.",
)


class DialectName(StrEnum):
    """How the server speaks."""

    COMPAT = "compat"
    UDK = "udk"


class ScanFormat(StrEnum):
    """What a scan is written as."""

    JSON = "json"
    CSV = "csv"
    PNG = "png"


class TextFormat(StrEnum):
    """What an explanation is written as."""

    TEXT = "text"
    JSON = "json"


class Ray(StrEnum):
    """A ray of a beam."""

    DRAWN = "drawn"
    RIGHT = "right"
    CENTRE = "centre"
    LEFT = "left"


MapArgument = Annotated[
    str,
    typer.Argument(
        metavar="MAP",
        help="A map file, or the name of a shipped map; @VARIANT after it.",
    ),
]
SensorOption = Annotated[
    str, typer.Option("--sensor", help="A preset: see 'radarsim sensors'.")
]
PoseOption = Annotated[
    str | None,
    typer.Option(
        "--pose",
        metavar="X,Y,YAW_DEG",
        help="The sensor's pose in the map frame; or X,Y,Z,ROLL,PITCH,YAW_DEG.",
    ),
]
StartOption = Annotated[
    str | None,
    typer.Option("--start", help="The sensor's place on a P3AT at this start pose."),
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change a setting of the sensor."),
]
NamesArgument = Annotated[
    list[str] | None,
    typer.Argument(metavar="NAME", help="Only these; all by default."),
]


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"radarsim {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    *,
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help="And exit."),
    ] = False,
) -> None:
    pass


@app.command()
def serve(
    map_: MapArgument,
    *,
    host: Annotated[str, typer.Option(help="Address to listen on.")] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="0 takes a free one.")
    ] = 3000,
    seed: SeedOption = 0,
    speed: Annotated[
        float, typer.Option(help="Simulated seconds in one second.")
    ] = 1.0,
    dialect: Annotated[
        DialectName, typer.Option(help="What clients need, or the original's bytes.")
    ] = DialectName.COMPAT,
    drive_unit: Annotated[
        DriveUnit | None, typer.Option(help="Of DRIVE; the dialect's by default.")
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="ITEM.KEY=VALUE",
            help="Change a setting of the robots' items, such as lms200.max_range=20.",
        ),
    ] = None,
    verbose: Annotated[
        bool, typer.Option("--verbose", "-v", help="Log connections too.")
    ] = False,
) -> None:
    """Serve a map to USARSim clients until interrupted."""
    from radarsim.cli.serve import run_server

    code = run_server(
        map_,
        address=(host, port),
        seed=seed,
        speed=speed,
        conditions=(dialect.value, drive_unit and drive_unit.value, settings or []),
        verbose=verbose,
    )
    raise typer.Exit(code)


@app.command()
def check(map_: MapArgument) -> None:
    """Read a map and print what is in it, or all its errors."""
    from radarsim.cli.check import check_map

    raise typer.Exit(check_map(map_))


@app.command()
def scan(
    map_: MapArgument,
    *,
    sensor: SensorOption,
    start: StartOption = None,
    pose: PoseOption = None,
    settings: SetOption = None,
    seed: SeedOption = 0,
    count: Annotated[int, typer.Option(min=1, help="More than 1 gives a list.")] = 1,
    format_: Annotated[
        ScanFormat | None,
        typer.Option("--format", help="What -o ends in, or json, by default."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Instead of stdout.")
    ] = None,
) -> None:
    """Scan a map without a server."""
    from radarsim.cli.scan import Request, write_scans

    request = Request(map_, sensor, start, pose, settings or [], seed)
    form = format_ or _format_of(output)
    write_scans(request, count=count, form=form.value, output=output)


def _format_of(output: Path | None) -> ScanFormat:
    suffix = "" if output is None else output.suffix.lower().lstrip(".")
    return ScanFormat(suffix) if suffix in list(ScanFormat) else ScanFormat.JSON


@app.command()
def explain(
    map_: MapArgument,
    *,
    sensor: SensorOption,
    beam: Annotated[int, typer.Option(min=0, help="Counted from 0, from the right.")],
    start: StartOption = None,
    pose: PoseOption = None,
    settings: SetOption = None,
    seed: SeedOption = 0,
    ray: Annotated[
        Ray, typer.Option(help="The one that 'scan' draws with this seed, or another.")
    ] = Ray.DRAWN,
    format_: Annotated[TextFormat, typer.Option("--format")] = TextFormat.TEXT,
) -> None:
    """Tell everything that one beam meets."""
    from radarsim.cli.explain import write_explanation
    from radarsim.cli.scan import Request

    request = Request(map_, sensor, start, pose, settings or [], seed)
    write_explanation(request, beam=beam, ray=ray.value, form=format_.value)


@app.command()
def sensors(
    names: NamesArgument = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """List the sensor presets: their numbers, sources and confidence."""
    from radarsim.cli.presets import list_sensors

    list_sensors(names or (), as_json=as_json)


@app.command()
def materials(
    names: NamesArgument = None,
    *,
    as_json: JsonOption = False,
) -> None:
    """List the library of materials: their numbers, sources and confidence."""
    from radarsim.cli.presets import list_materials

    list_materials(names or (), as_json=as_json)


@app.command()
def drive(
    *,
    host: Annotated[str, typer.Option(help="Of the server.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=1, max=65535)] = 3000,
    robot: Annotated[str, typer.Option(help="Class of the robot.")] = "P3AT",
    start: Annotated[
        str | None, typer.Option(help="A start of the map; its first by default.")
    ] = None,
    scanner: Annotated[
        str | None, typer.Option(help="The one to look at; the first by default.")
    ] = None,
    speed: Annotated[
        float, typer.Option(metavar="M_PER_S", help="That the keys set; + and - too.")
    ] = 0.4,
    drive_unit: DriveUnitOption = DriveUnit.RAD_PER_S,
) -> None:
    """Drive a robot from the keyboard, and see what it senses."""
    from radarsim.cli.drive import run_driver
    from radarsim.teleop.teleop import Wish

    wish = Wish(robot, start, scanner, speed, drive_unit.value)
    raise typer.Exit(run_driver(host, port, wish))


app.command()(navigate)
app.command()(trials)
app.command("map")(map_)


@app.command()
def figures(
    out: Annotated[
        Path, typer.Argument(metavar="OUT", help="A folder; made if it is not there.")
    ],
    *,
    seed: SeedOption = 0,
    only: Annotated[
        str | None, typer.Option(metavar="N,...", help="Figures; all by default.")
    ] = None,
) -> None:
    """Draw the thesis' figures from runs of the program, and a page with all."""
    end_unfinished()
    from radarsim.cli.figures import make_figures

    make_figures(out, seed=seed, only=only)


@app.command()
def bench(
    *,
    as_json: JsonOption = False,
) -> None:
    """Measure the engine and the server on this machine, in under two minutes."""
    end_unfinished()
    from radarsim.cli.bench import run_benchmarks

    run_benchmarks(as_json=as_json)


def _turn_deaf() -> None:
    # Python gives up its handlers before it is gone, and a second signal would kill it;
    # what is ignored stays ignored.
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def main() -> None:
    """Run a command and exit with its code."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    atexit.register(_turn_deaf)
    try:
        app()
    except RadarsimError as error:
        sys.stderr.write(f"radarsim: {error}\n")
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)
    except OSError as error:
        sys.stderr.write(f"radarsim: cannot write: {error.strerror or error}\n")
        # Python would try to flush stdout again, and complain again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(1)
