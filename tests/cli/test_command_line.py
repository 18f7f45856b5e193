"""The command line, with any parser: values, files, variables, words."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from commands import run_in_process as radarsim
from processes import on_terminal

from radarsim.cli.app import app
from radarsim.cli.completion import complete_map

SCAN = ("scan", "empty_room", "--sensor", "laser")
SHORT = ("--set", "fov_deg=2")
HERE = ("--start", "RobotStart1")
GO = ("navigate", "empty_room", "--algorithm", "bug2")
BRIEF = ("--time-limit", "0.2", "--json")


@pytest.mark.parametrize(
    ("pose", "expected"),
    [
        (["--pose", "-7.8,0,0"], [-7.8, 0]),
        (["--pose=-7.8,0,0"], [-7.8, 0]),
        (["--pose", "-7.8, 0, 0"], [-7.8, 0]),
        (["--pose", "-.5,-1e0,-90"], [-0.5, -1]),
        (["--pose", "-5,1,0.346,0,0,-90"], [-5, 1]),
        (["--pose", "1,1,1", "--pose", "2,2,2"], [2, 2]),
    ],
)
def test_poses_may_begin_with_a_minus_and_settings_repeat(
    pose: list[str], expected: list[float]
) -> None:
    run = radarsim(*SCAN, *SHORT, "--set", "max_range=3", *pose)
    assert (run.code, run.err) == (0, "")
    scan = json.loads(run.text)
    assert scan["pose"][:2] == expected
    assert (scan["range_max"], len(scan["ranges"])) == (3, 3)


@pytest.mark.parametrize(
    ("words", "goals"),
    [
        (["--goal=-3,-2"], [[-3, -2]]),
        (["--goal", "-3,2", "--goal", "-.5,1"], [[-3, 2], [-0.5, 1]]),
    ],
)
def test_goals_may_begin_with_a_minus_and_repeat(
    words: list[str], goals: list[list[float]]
) -> None:
    run = radarsim(*GO, *BRIEF, *words)
    assert json.loads(run.text)["goals"] == goals


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
    tmp_path: Path, text: str, place: str
) -> None:
    config = tmp_path / "server.yaml"
    config.write_text(text)
    run = radarsim("serve", "empty_room", "--config", config)
    assert (run.code, run.out) == (2, b"")
    assert run.err.startswith(f"radarsim: --config: {config}:{place}")
    assert run.err.count("\n") == 1


def test_the_command_counts_before_the_environment_and_that_before_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = tmp_path / "server.yaml"
    config.write_text("speed: 0\nmap: nowhere\n")
    words = ("serve", "--port", "0", "--config", str(config))
    assert "expected more than 0" in radarsim(*words).err
    monkeypatch.setenv("RADARSIM_SERVE_SPEED", "2")
    assert "nowhere" in radarsim(*words).err
    assert "expected more than 0" in radarsim(*words, "--speed", "-1").err


@pytest.mark.parametrize(
    ("name", "value", "words", "message"),
    [
        ("RADARSIM_SERVE_PORT", "99999", ("serve", "empty_room"), "PORT: '99999'"),
        ("RADARSIM_SCAN_SENSOR", "radar", ("scan", "empty_room", *HERE), '"radar"'),
        ("RADARSIM_SCAN_SET", "fov_deg=2 max_range=3", (*SCAN, *HERE), '_max": 3'),
        ("RADARSIM_SCAN_POSE", "-7,0,0", SCAN, "[-7.0, 0.0,"),
        ("RADARSIM_SCAN_COUNT", "0", (*SCAN, *HERE, "--count", "1"), "laser"),
        ("RADARSIM_NAVIGATE_GOAL", "1,a", (*GO,), "_GOAL: '1,a', expected X,Y"),
    ],
)
def test_options_come_from_the_environment(
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    value: str,
    words: tuple[str, ...],
    message: str,
) -> None:
    monkeypatch.setenv(name, value)
    run = radarsim(*words)
    assert message in run.text + run.err


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
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("RADARSIM_SCAN_COUNTS", "0")
    monkeypatch.setenv("RADARSIM_SERVE_PROT", "0")  # of another command
    monkeypatch.setenv("RADARSIM_SCAN_SEED", "3")
    run = radarsim(*SCAN, *HERE)
    assert run.code == 0
    assert run.err == (
        "radarsim: warning: RADARSIM_SCAN_COUNTS"
        " (did you mean 'RADARSIM_SCAN_COUNT'?) is ignored: no such option\n"
    )


@pytest.mark.parametrize("group", [(), ("recording",)], ids=str)
def test_groups_know_the_options_of_help_as_commands_do(group: tuple[str, ...]) -> None:
    shown = radarsim(*group, "--help")
    assert shown.code == 0
    for option in ("-h", "--help-all"):
        assert radarsim(*group, option).text == shown.text


def test_address_of_numbers_with_colons_is_reported_in_brackets(tmp_path: Path) -> None:
    run = radarsim("map", "--connect", "[::1]:1", "-o", f"{tmp_path}/")
    assert run.code == 1
    assert "no server at [::1]:1" in run.err


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("sca", "scan"),
        ("scan folia", "foliage_room"),
        ("serve bug_b", "bug_box"),
        ("scan empty_room --sensor usarsim_s", "usarsim_sick"),
        ("ros --robot P3AT_Na", "P3AT_Navtech"),
        ("scan --sen", "--sensor"),
        ("scan --format js", "json"),
    ],
)
def test_words_are_completed(
    monkeypatch: pytest.MonkeyPatch, words: str, expected: str
) -> None:
    """As bash completes the last word."""
    monkeypatch.setenv("_RADARSIM_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", f"radarsim {words}")
    monkeypatch.setenv("COMP_CWORD", str(len(words.split())))
    lines = radarsim().text.split()
    assert [line.partition(",")[2] for line in lines] == [expected]


def test_files_of_maps_are_completed(tmp_path: Path) -> None:
    (tmp_path / "room.yaml").touch()
    (tmp_path / "notes.txt").touch()
    assert list(complete_map(f"{tmp_path}/")) == [f"{tmp_path}/room.yaml"]


@pytest.mark.parametrize("words", [("scan", "--help"), ("scan",)], ids=str)
def test_output_is_plain_in_a_pipe_and_without_colour(words: tuple[str, ...]) -> None:
    run = radarsim(*words)
    assert "\x1b[" not in run.text + run.err
    plain = on_terminal(*words, NO_COLOR="1")
    assert not re.search(r"\x1b\[[0-9;]*[34][0-7]", plain)
