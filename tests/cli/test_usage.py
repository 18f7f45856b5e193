"""Errors of usage: exit code 2, and one line that says what is wrong and what helps."""

import pytest

from .conftest import RunCommand


@pytest.mark.parametrize(
    ("command", "words"),
    [
        pytest.param(("sarve",), ["'sarve'", "did you mean 'serve'"], id="command"),
        pytest.param(
            ("map", "-o", "m", "--strat", "auto"),
            ["'--strat'", "did you mean '--strategy'"],
            id="beginning of an option",
        ),
        pytest.param(
            ("serve", "empty_room", "--prot", "1"),
            ["'--prot'", "did you mean '--port'"],
            id="option",
        ),
        pytest.param(
            ("sensors", "--xyzzy"), ["'--xyzzy'", "sensors --help"], id="unknown option"
        ),
        pytest.param(
            ("drive", "--port", "3001"), ["--connect HOST:PORT"], id="address of once"
        ),
        pytest.param(
            ("navigate", "--map", "empty_room"),
            ["MAP as an argument"],
            id="map of once",
        ),
        pytest.param(("--xyzzy",), ["'--xyzzy'", "--help"], id="option of the program"),
        pytest.param(("demo", "--hel"), ["'--hel'", "'--help'"], id="help"),
        pytest.param(("serve", "a", "--port"), ["--port", "value"], id="no value"),
        pytest.param(("sensors", "--json=3"), ["--json", "no value"], id="a value"),
        pytest.param(("check", "a", "b", "c"), ["'b c'", "no more"], id="arguments"),
        pytest.param(
            ("scan",),
            ["MAP", "--sensor", "--start", "--pose", "scan --help"],
            id="all that is missing",
        ),
        pytest.param(
            ("explain", "empty_room", "--pose", "0,0,0"),
            ["--sensor", "--beam"],
            id="options are missing",
        ),
        pytest.param(("serve",), ["MAP", "serve --help"], id="argument is missing"),
        pytest.param(
            ("navigate", "--algorithm", "bug3"), ["--algorithm: 'bug3'"], id="value"
        ),
        pytest.param(("check", "--plot", "p.txt", "a"), ["--plot: p.txt"], id="ending"),
    ],
)
def test_error_of_usage_is_one_line(
    radarsim: RunCommand, command: tuple[str, ...], words: list[str]
) -> None:
    run = radarsim(*command)
    assert (run.code, run.text) == (2, "")
    assert run.err.startswith("radarsim: ")
    assert run.err.count("\n") == 1
    for word in words:
        assert word in run.err


def test_nothing_is_missing_that_was_given(radarsim: RunCommand) -> None:
    run = radarsim("explain", "empty_room", "--pose", "0,0,0")
    for word in ("MAP", "--pose", "--start"):
        assert word not in run.err


def test_wrong_map_gives_one_exit_code_wherever_it_is_named(
    radarsim: RunCommand,
) -> None:
    commands = [
        ("check", "bug_bx"),
        ("scan", "bug_bx", "--sensor", "radar", "--pose", "0,0,0"),
        ("navigate", "bug_bx", "--algorithm", "bug1"),
        ("trials", "bug_bx"),
    ]
    runs = [radarsim(*command) for command in commands]
    assert {run.code for run in runs} == {1}
    assert all("did you mean 'bug_box'" in run.text + run.err for run in runs)


def test_program_without_a_command_prints_its_help(radarsim: RunCommand) -> None:
    run = radarsim()
    assert run.code == 2
    assert "serve" in run.text + run.err
    assert "radarsim: " not in run.err
