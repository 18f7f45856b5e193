"""What the command line keeps, whatever parses it: values, errors, exit codes."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from processes import on_terminal

from radarsim.cli.app import app

from .conftest import RunCommand

PROGRAM = (sys.executable, "-m", "radarsim")
SCAN = ("scan", "empty_room", "--sensor", "laser")
SHORT = ("--set", "fov_deg=2")
HERE = ("--start", "RobotStart1")
GO = ("navigate", "empty_room", "--algorithm", "bug2")
BRIEF = ("--time-limit", "0.2", "--json")
SERVE = ("serve", "empty_room", "--port", "0")
COMMANDS = (
    *("demo", "serve", "check", "new", "import", "scan", "spectrum", "explain"),
    *("sensors", "materials", "drive", "commander", "navigate", "trials", "sweep"),
    *("map", "replay", "recording", "ros", "docs"),
)
ESCAPE = "\x1b["


def as_json(text: str) -> dict[str, object]:
    values = json.loads(text)
    assert isinstance(values, dict)
    return values


@pytest.mark.parametrize(
    ("pose", "expected"),
    [
        pytest.param(["--pose", "-7.8,0,0"], [-7.8, 0], id="minus"),
        pytest.param(["--pose=-7.8,0,0"], [-7.8, 0], id="equals sign"),
        pytest.param(["--pose", "-7.8, 0, 0"], [-7.8, 0], id="spaces"),
        pytest.param(["--pose", "-.5,-1e0,-90"], [-0.5, -1], id="short numbers"),
        pytest.param(["--pose", "-5,1,0.346,0,0,-90"], [-5, 1], id="six numbers"),
        pytest.param(["--pose", "1,1,1", "--pose", "2,2,2"], [2, 2], id="the last"),
    ],
)
def test_poses_may_begin_with_a_minus(
    radarsim: RunCommand, pose: list[str], expected: list[float]
) -> None:
    run = radarsim(*SCAN, *SHORT, *pose)
    assert (run.code, run.err) == (0, "")
    place = as_json(run.text)["pose"]
    assert isinstance(place, list)
    assert place[:2] == expected


@pytest.mark.parametrize(
    ("words", "goals"),
    [
        pytest.param(["--goal", "-3,2"], [[-3, 2]], id="minus"),
        pytest.param(["--goal=-3,-2"], [[-3, -2]], id="equals sign"),
        pytest.param(
            ["--goal", "-3,2", "--goal", "-.5,1"], [[-3, 2], [-0.5, 1]], id="two"
        ),
    ],
)
def test_goals_may_begin_with_a_minus_and_repeat(
    radarsim: RunCommand, words: list[str], goals: list[list[float]]
) -> None:
    run = radarsim(*GO, *BRIEF, *words)
    assert as_json(run.text)["goals"] == goals


def test_settings_repeat(radarsim: RunCommand) -> None:
    run = radarsim(*SCAN, *HERE, *SHORT, "--set", "max_range=3")
    scan = as_json(run.text)
    assert scan["range_max"] == 3
    assert isinstance(scan["ranges"], list)
    assert len(scan["ranges"]) == 3


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "1e999", "x", "1,5", ""])
@pytest.mark.parametrize(
    "words",
    [
        (*SERVE, "--speed"),
        *((*GO, f"--{name}") for name in ("speed", "safety-distance", "timeout")),
        ("replay", "no_folder", "--speed"),
    ],
    ids=" ".join,
)
def test_numbers_are_finite(
    radarsim: RunCommand, words: tuple[str, ...], value: str
) -> None:
    run = radarsim(*words, value)
    assert (run.code, run.out) == (2, b"")
    assert re.fullmatch(f"radarsim: {words[-1]}: .*, expected .*\n", run.err)


@pytest.mark.parametrize("value", ["1,nan", "inf,0", "1", "1,2,3", "a,b", "1;2", ""])
def test_points_are_two_finite_numbers(radarsim: RunCommand, value: str) -> None:
    run = radarsim(*GO, "--goal", value)
    assert (run.code, run.err) == (2, f"radarsim: --goal: {value!r}, expected X,Y\n")


def test_a_run_may_have_no_limit_of_time(radarsim: RunCommand) -> None:
    run = radarsim(*GO, "--time-limit", "inf", "--goal", "-6.5,0")
    assert run.code == 0


@pytest.mark.parametrize(
    ("words", "missing"),
    [
        (("scan",), "MAP, --sensor, one of --start and --pose"),
        (("scan", "empty_room"), "--sensor, one of --start and --pose"),
        (("scan", "--pose", "0,0,0"), "MAP, --sensor"),
        (("explain", "empty_room"), "--sensor, --beam, one of --start and --pose"),
        (("check",), "MAP"),
        (("new",), "FILE"),
    ],
    ids=str,
)
def test_all_that_is_missing_is_named_at_once(
    radarsim: RunCommand, words: tuple[str, ...], missing: str
) -> None:
    run = radarsim(*words)
    assert (run.code, run.out) == (2, b"")
    assert run.err.startswith(f"radarsim: missing: {missing}; see '")
    assert run.err.endswith(f"radarsim {words[0]} --help'\n")


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (("scna",), "scan"),
        (("navigat",), "navigate"),
        (("scan", "--sensr", "laser"), "--sensor"),
        (("scan", "--out", "a.json"), "--output"),
        (("serve", "--prot", "1"), "--port"),
        (("navigate", "--speeed", "1"), "--speed"),
        (("recording", "inf"), "info"),
        (("check", "empty_rom"), "empty_room"),
        (("scan", "empty_room", "--sensor", "lasr", *HERE), "laser"),
        ((*SCAN, "--start", "RobotStrt1"), "RobotStart1"),
        ((*SCAN, *HERE, "--format", "jsn"), "json"),
        ((*GO, "--robot", "P3AT_Rdar360", "--goal", "0,0"), "P3AT_Radar360"),
        (("navigate", "--algorithm", "bugg2"), "bug2"),
    ],
    ids=str,
)
def test_similar_words_are_suggested(
    radarsim: RunCommand, words: tuple[str, ...], meant: str
) -> None:
    run = radarsim(*words)
    assert run.code in (1, 2)
    assert f"did you mean '{meant}'?" in (run.text + run.err).replace("Did", "did")
    assert (run.text + run.err).count("\n") == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((*SCAN, "--count", "0"), "--count: '0', expected at least 1"),
        ((*SCAN, "--count", "1.5"), "--count: '1.5', expected a whole number"),
        ((*SCAN, "--seed"), "--seed: expected a value with it"),
        ((*SCAN, *HERE, "--pose", "0,0,0"), "expected only one of --start and --pose"),
        ((*SCAN, "more"), "'more', expected no more arguments; see"),
        ((*GO, "--json=1"), "--json: expected no value with it"),
        ((*GO, "--bumpers", "40"), "--bumpers: '40', expected at most 36"),
        ((*SCAN, "--format", "bmp"), "--format: 'bmp', expected one of ['json', 'csv'"),
    ],
    ids=str,
)
def test_errors_of_usage_are_one_line(
    radarsim: RunCommand, words: tuple[str, ...], message: str
) -> None:
    run = radarsim(*words)
    assert (run.code, run.out) == (2, b"")
    assert run.err.startswith(f"radarsim: {message}")
    assert run.err.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("port: 0\nprot: 1\n", "2:1: prot: unknown key, expected one of ["),
        ("port: [a\n", "2:1: not YAML"),
        ("port: 1\nport: 2\n", "2:1: port: "),
        ("- 1\n", "1: expected keys such as 'map' and 'port'"),
    ],
    ids=repr,
)
def test_errors_of_a_file_of_options_have_their_places(
    radarsim: RunCommand, tmp_path: Path, text: str, place: str
) -> None:
    config = tmp_path / "server.yaml"
    config.write_text(text)
    run = radarsim("serve", "empty_room", "--config", str(config))
    assert (run.code, run.out) == (2, b"")
    assert run.err.startswith(f"radarsim: --config: {config}:{place}")
    assert run.err.count("\n") == 1


def test_the_command_counts_before_the_environment_and_that_before_the_file(
    radarsim: RunCommand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = tmp_path / "server.yaml"
    config.write_text("speed: 0\nmap: nowhere\n")
    words = ("serve", "--port", "0", "--config", str(config))
    assert "expected more than 0" in radarsim(*words).err
    monkeypatch.setenv("RADARSIM_SERVE_SPEED", "2")
    assert "nowhere" in radarsim(*words).err
    assert "expected more than 0" in radarsim(*words, "--speed", "-1").err


@pytest.mark.parametrize(
    ("name", "value", "words", "told"),
    [
        ("RADARSIM_SERVE_PORT", "99999", ("serve", "empty_room"), "PORT: '99999'"),
        ("RADARSIM_SERVE_PORT", "abc", ("serve", "empty_room"), "RADARSIM_SERVE_PORT:"),
        ("RADARSIM_SCAN_SENSOR", "radar", ("scan", "empty_room", *HERE), '"radar"'),
        ("RADARSIM_SCAN_SET", "fov_deg=2 max_range=3", (*SCAN, *HERE), '_max": 3'),
        ("RADARSIM_SCAN_POSE", "-7,0,0", SCAN, "[-7.0, 0.0,"),
        ("RADARSIM_SCAN_COUNT", "0", (*SCAN, *HERE), "RADARSIM_SCAN_COUNT: '0'"),
        ("RADARSIM_SCAN_COUNT", "0", (*SCAN, *HERE, "--count", "1"), "laser"),
        ("RADARSIM_NAVIGATE_GOAL", "1,a", (*GO,), "_GOAL: '1,a', expected X,Y"),
        ("RADARSIM_NAVIGATE_SPEED", "0", (*GO,), "NAVIGATE_SPEED: '0'"),
    ],
)
def test_options_come_from_the_environment(
    radarsim: RunCommand,
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    value: str,
    words: tuple[str, ...],
    told: str,
) -> None:
    monkeypatch.setenv(name, value)
    run = radarsim(*words)
    assert told in run.text + run.err


def test_every_option_has_a_variable_of_its_name() -> None:
    def options(command: click.Command, *path: str) -> Iterator[tuple[str, str]]:
        context = click.Context(command)
        if isinstance(command, click.Group):
            for name in command.list_commands(context):
                found = command.get_command(context, name)
                assert found is not None
                yield from options(found, *path, name)
        for param in command.params if path else ():
            if isinstance(param, click.Option):
                yield max(param.opts, key=len), str(param.name)

    named = dict(options(app))
    assert named["--set"] == "set"
    assert named == {name: name[2:].replace("-", "_") for name in named}


def test_a_variable_that_is_no_options_is_named(
    radarsim: RunCommand, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RADARSIM_SCAN_COUNTS", "0")
    monkeypatch.setenv("RADARSIM_SERVE_PROT", "0")  # of another command
    monkeypatch.setenv("RADARSIM_SCAN_SEED", "3")
    run = radarsim(*SCAN, *HERE)
    assert run.code == 0
    assert run.err == (
        "radarsim: warning: RADARSIM_SCAN_COUNTS"
        " (did you mean 'RADARSIM_SCAN_COUNT'?) is ignored, it is no option's\n"
    )


@pytest.mark.parametrize("group", [(), ("recording",)], ids=str)
def test_groups_know_the_options_of_help_as_commands_do(
    radarsim: RunCommand, group: tuple[str, ...]
) -> None:
    shown = radarsim(*group, "--help-all")
    assert shown.code == 0
    assert shown.text == radarsim(*group, "--help").text


def test_address_of_numbers_with_colons_is_told_in_brackets(
    radarsim: RunCommand, tmp_path: Path
) -> None:
    run = radarsim("map", "--connect", "[::1]:1", "-o", f"{tmp_path}/")
    assert run.code == 1
    assert "no server at [::1]:1" in run.err


def complete(*words: str) -> list[str]:
    """Return what bash completes the last word to."""
    variables = {
        "_RADARSIM_COMPLETE": "bash_complete",
        "COMP_WORDS": " ".join(("radarsim", *words)),
        "COMP_CWORD": str(len(words)),
    }
    code = "import sys; sys.argv[0] = 'radarsim'; import radarsim.cli as c; c.main()"
    run = subprocess.run(
        (sys.executable, "-c", code),
        env={**os.environ, **variables},
        capture_output=True,
        text=True,
        check=False,
    )
    return [line.partition(",")[2] for line in run.stdout.split()]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("sca",), ["scan"]),
        (("scan", "folia"), ["foliage_room"]),
        (("serve", "bug_b"), ["bug_box"]),
        (("scan", "empty_room", "--sensor", "usarsim_s"), ["usarsim_sick"]),
        (("ros", "--robot", "P3AT_Na"), ["P3AT_Navtech"]),
        (("scan", "--sen"), ["--sensor"]),
        (("scan", "--format", "js"), ["json"]),
    ],
    ids=str,
)
def test_words_are_completed(words: tuple[str, ...], expected: list[str]) -> None:
    assert complete(*words) == expected


@pytest.mark.parametrize("words", [("--help",), ("scan", "--help"), ("scan",)], ids=str)
def test_output_is_plain_in_a_pipe_and_without_colour(words: tuple[str, ...]) -> None:
    run = subprocess.run((*PROGRAM, *words), capture_output=True, check=False)
    assert ESCAPE.encode() not in run.stdout + run.stderr
    plain = on_terminal(*words, NO_COLOR="1")
    assert not re.search(r"\x1b\[[0-9;]*[34][0-7]", plain)


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(radarsim: RunCommand, name: str) -> None:
    run = radarsim(name, "--help")
    assert (run.code, run.err) == (0, "")
    assert name in radarsim("--help").text
    assert radarsim(name, "-h").text == run.text


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("--version",), 0),
        (("--help",), 0),
        (("check", "empty_room"), 0),
        (("check", "nowhere"), 1),
        (("scan", "nowhere", "--sensor", "laser", "--pose", "0,0,0"), 1),
        ((*GO, *BRIEF, "--goal", "6,0"), 1),
        ((), 2),
        (("scan",), 2),
        (("navigate", "bug_closed_box", "--algorithm", "bug2"), 3),
    ],
    ids=str,
)
def test_exit_code_tells_how_it_ended(
    radarsim: RunCommand, words: tuple[str, ...], code: int
) -> None:
    assert radarsim(*words).code == code


def test_interrupt_exits_with_130(
    radarsim: RunCommand, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("radarsim.scene.map_file.load_map", interrupt)
    run = radarsim(*SCAN, *HERE)
    assert (run.code, run.text, run.err) == (130, "", "")
