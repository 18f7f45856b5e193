"""Commands made of functions and plans."""

import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, ClassVar, Literal

import click
import pytest
from annotated_types import Gt, Interval, Unit
from click.testing import CliRunner

from radarsim.cli.app import EntryGroup, describe_usage_error
from radarsim.cli.command import PlanCommand
from radarsim.cli.entries import CommandEntry
from radarsim.cli.fields import LOCAL_SERVER, Server, ServerAddress, Simulation
from radarsim.plans import RARE, Option, PointXY

WIDTH = 80


class Gait(StrEnum):
    WALK = "walk"
    RUN = "run"


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A robot.

    Attributes:
        name: Name of the robot,
            in two lines.
        speed: Maximum speed.
        limit: Longest time.
    """

    option_group: ClassVar = "Robot"

    name: str
    speed: Annotated[float, Gt(0), Unit("m/s")] = 0.5
    limit: Annotated[float, Gt(0), Option(may_be_infinite=True), RARE] = 9.0


@dataclass(frozen=True, kw_only=True)
class Walk(Robot):
    """A walk.

    Attributes:
        goals: Where to.
        home: Where from.
        gait: How.
        side: On which side.
        is_fast: Whether it hurries.
        echoes: Whether it listens.
    """

    option_group: ClassVar = "Walk"

    goals: Annotated[tuple[PointXY, ...], Option(names=("--goal", "-g"))] = ()
    home: PointXY | None = None
    gait: Gait = Gait.WALK
    side: Literal["left", "right"] | None = None
    is_fast: bool = False
    echoes: bool = True


def walk(
    out: Annotated[Path, Option(is_argument=True)],
    plan: Walk,
    *,
    times: Annotated[int, Interval(ge=1, le=5)] = 1,
) -> None:
    """Walk around.

    Args:
        out: File to write.
        plan: The walk.
        times: How often.
    """
    click.echo(repr((out.name, plan, times)))


def run(*words: str, function: Callable[..., None] = walk) -> tuple[int, str]:
    command = PlanCommand(function.__name__, function)
    done = CliRunner().invoke(command, words, standalone_mode=False)
    if isinstance(done.exception, click.UsageError):
        return 2, describe_usage_error(done.exception)
    assert done.exception is None
    return 0, done.output


def test_plan_is_built_of_what_is_given() -> None:
    code, text = run("a.txt", "--name", "R1")
    assert (code, text) == (0, f"{('a.txt', Walk(name='R1'), 1)!r}\n")
    given = ("a.txt", "--name=R1", "-g", "-1,2", "--goal", "3,-.5", "--home", "-0,1")
    options = ("--gait", "run", "--no-echoes", "--is-fast", "--times", "5")
    plan = Walk(
        name="R1",
        goals=((-1.0, 2.0), (3.0, -0.5)),
        home=(-0.0, 1.0),
        gait=Gait.RUN,
        is_fast=True,
        echoes=False,
    )
    assert run(*given, *options) == (0, f"{('a.txt', plan, 5)!r}\n")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "missing: OUT, --name; see 'walk --help'"),
        *(
            (("--speed", text), f"--speed: {text!r}, expected a finite number")
            for text in ("nan", "inf", "-inf", "1e999")
        ),
        (("--limit", "nan"), "--limit: 'nan', expected more than 0"),
        (("--limit", "-inf"), "--limit: '-inf', expected more than 0"),
        *(
            (("--goal", text), f"--goal: {text!r}, expected X,Y")
            for text in ("1", "1,nan", "inf,0", "1,2,3", "a,b", "1;2", "")
        ),
        (("--gait", "rn"), "--gait: 'rn' (did you mean 'run'?), expected one of"),
        (("--side", "top"), "--side: 'top', expected one of ['left', 'right']"),
    ],
    ids=str,
)
def test_errors_are_reported(words: tuple[str, ...], message: str) -> None:
    code, text = run(*words)
    assert code == 2
    assert text.startswith(message)


def test_numbers_may_be_infinite_where_it_is_said() -> None:
    _, text = run("a", "--name", "b", "--limit", "inf")
    assert repr(Walk(name="b", limit=math.inf)) in text


def test_help_is_the_documentation_of_the_fields() -> None:
    command = PlanCommand("walk", walk)
    text = CliRunner().invoke(command, ["--help"], terminal_width=WIDTH).output
    assert text == (
        "Usage: walk [OPTIONS] OUT\n\n  Walk around.\n\n"
        "Arguments:\n  OUT  File to write.\n\n"
        "Walk:\n"
        "  --goal, -g X,Y         Where to.\n"
        "  --home X,Y             Where from.\n"
        "  --gait walk|run        How. [default: walk]\n"
        "  --side left|right      On which side.\n"
        "  --is-fast              Whether it hurries.\n"
        "  --echoes, --no-echoes  Whether it listens.\n\n"
        "Robot:\n"
        "  --name NAME  Name of the robot, in two lines. [required]\n"
        "  --speed M/S  Maximum speed. [default: 0.5]\n\n"
        "Options:\n"
        "  --times N   How often. [default: 1]\n"
        "  --help-all  Show all options, including rarely used ones.\n"
        "  --help      Show this message and exit.\n"
    )
    all_of_it = CliRunner().invoke(command, ["--help-all"], terminal_width=WIDTH).output
    assert "--limit NUMBER" in all_of_it


@dataclass(frozen=True, kw_only=True)
class Served:
    """The served map.

    Attributes:
        map: The map.
        port: The port.
        loud: Whether it is loud.
        words: Words.
        config: A file.
    """

    map: Annotated[str, Option(is_argument=True)]
    port: Annotated[int, Interval(ge=0, le=9)] = 3
    loud: bool = False
    words: tuple[str, ...] = ()
    config: Annotated[Path | None, Option(is_config_file=True)] = None


def serve(plan: Served) -> None:
    """Serve."""
    words = (plan.map, str(plan.port), *["loud"] * plan.loud, *plan.words)
    click.echo(" ".join(words))


@pytest.mark.parametrize(
    ("text", "words", "problem"),
    [
        ("map: room\nport: 4\nwords: [a, b c]\n", (), "room 4 a b c\n"),
        ("port: 4\n", ("hall", "--port", "5"), "hall 5\n"),
        ("map: room\nport: 4\n", ("hall",), "hall 4\n"),
        ("# none\n", ("hall",), "hall 3\n"),
        ("map: 44\nloud: true\nwords: [1, 2.5]\n", (), "44 3 loud 1 2.5\n"),
        ("map: a\nloud: 1\n", (), "a 3 loud\n"),
        ("map: a\nwords: one\n", (), "a 3 one\n"),
        ("map: a\nloud: 3", (), "--config: {}:2:7: loud: '3', expected true or false"),
        ("map: a\nloud: [3]", (), "--config: {}:2:7: loud: '[3]', expected true or"),
        ("map: [a]\n", (), "--config: {}:1:6: map: ['a'], expected text"),
        ("port: 44\nmap: a", (), "--config: {}:1:7: port: 44, expected at most 9"),
        ("map: a\nport: x", (), "--config: {}:2:7: port: 'x', expected a whole number"),
        ("port: 44\n", ("a", "--port", "45"), "--port: '45', expected at most 9"),
        ("map: a\npart: 1", (), "--config: {}:2:1: part: unknown key, expected one of"),
    ],
)
def test_options_come_from_a_file_and_errors_have_their_places(
    tmp_path: Path, text: str, words: tuple[str, ...], problem: str
) -> None:
    file = tmp_path / "server.yaml"
    file.write_text(text)
    _, found = run("--config", str(file), *words, function=serve)
    assert found.startswith(problem.format(file))


def test_two_options_of_one_name_are_refused() -> None:
    def twice(first: Robot, second: Robot) -> None: ...

    with pytest.raises(ValueError, match="twice: two options are named name"):
        PlanCommand("twice", twice)


@pytest.mark.parametrize(
    ("words", "plan"),
    [
        (("room",), Simulation(map="room")),
        (("--connect", "[::1]:80"), Simulation(connect=ServerAddress("::1", 80))),
        (
            ("room", "--set", "a.b=1", "--set", "a.c=2,3", "--seed", "4"),
            Simulation(
                map="room", settings=(("a", "b", 1), ("a", "c", [2, 3])), seed=4
            ),
        ),
    ],
)
def test_robots_drive_on_a_map_or_on_a_server(
    words: tuple[str, ...], plan: Simulation
) -> None:
    found: list[Simulation] = []

    def go(where: Simulation) -> None:
        found.append(where)

    run(*words, function=go)
    assert found == [plan]
    assert Server().connect == LOCAL_SERVER == ("127.0.0.1", 3000)


def test_commands_are_imported_when_they_are_used() -> None:
    entries = [
        CommandEntry("walk", f"{__name__}:walk", "Walk around.", "Moves"),
        CommandEntry("fly", "no_such_module:fly", "Fly.", "Moves"),
    ]
    group = EntryGroup("move", entries)
    assert "Moves:\n  walk  Walk around.\n  fly   Fly." in group.get_help(
        click.Context(group)
    )
    with pytest.raises(ModuleNotFoundError):
        group.get_command(click.Context(group), "fly")


def test_help_of_the_program_imports_no_command() -> None:
    code = (
        "import sys; from radarsim.cli.app import app\n"
        "try: app(['--help'])\n"
        "except SystemExit: pass\n"
        "print([name for name in sys.modules if name.startswith('radarsim.cli.scan')"
        " or name in ('matplotlib', 'numpy', 'pydantic', 'rich', 'scipy')])"
    )
    run = subprocess.check_output((sys.executable, "-c", code), text=True)
    assert run.splitlines()[-1] == "[]"


def test_what_is_typed_counts_before_an_exported_variable() -> None:
    def drive(where: Simulation) -> None:
        """Drive.

        Args:
            where: Where.
        """
        click.echo(f"{where.map} {where.connect}")

    command, variables = PlanCommand("drive", drive), {"X_CONNECT": "host:1"}
    runner = CliRunner(env=variables)
    typed = runner.invoke(command, ["room"], auto_envvar_prefix="X")
    assert typed.output == "room None\n"
    exported = runner.invoke(command, [], auto_envvar_prefix="X")
    assert exported.output == "None host:1\n"
    both = runner.invoke(command, ["room", "--connect", "host:1"])
    assert both.exit_code == 2
    assert "expected only one of MAP and --connect" in both.output
