"""Names from maps, peers and command lines are shown escaped."""

import io
import logging
from pathlib import Path

import pytest
from commands import run_in_process as radarsim

from radarsim.cli import output
from radarsim.errors import MapError, RadarsimError, escape_unprintable

# Colour and title of a terminal, bell, return, a C1 control, a change of direction.
HOSTILE = "x\x1b[31m\x1b]0;t\x07\r\x9b\u202eq"
SHOWN = r"x\x1b[31m\x1b]0;t\x07\r\x9b\u202eq"
MARKUP = "[red]wall[/]"


def is_printable(text: str) -> bool:
    return all(each.isprintable() or each == "\n" for each in text)


def map_text(name: str) -> str:
    """Return a map whose names of materials hold escape sequences."""
    quoted = '"' + "".join(f"\\u{ord(each):04x}" for each in name) + '"'
    return (
        "version: 1\nlevel: room\n"
        f"materials: {{{quoted}: {{density: .7}}}}\n"
        "objects:\n"
        f"  - {{name: '{MARKUP}', box: [1, 9, 3], position: [4, 0, 1.5],"
        f" material: {quoted}}}\n"
        "starts: [{name: RobotStart1, position: [0, 0, 0]}]\n"
        "trial: {start: RobotStart1, goal: [2, 0], safety_distance: .5}\n"
    )


@pytest.fixture
def hostile_map(tmp_path: Path) -> Path:
    file = tmp_path / f"{MARKUP.replace('/', '_')}{HOSTILE}.yaml"
    file.write_text(map_text(HOSTILE))
    return file


@pytest.mark.parametrize(
    "command",
    [
        ("check", "{map}"),
        ("check", "{map}", "--plot", "{folder}/plan.svg"),
        ("scan", "{map}", "--sensor", "radar", "--start", "RobotStart1"),
        *(
            ("explain", "{map}", *("--sensor", "radar", "--beam", "90"), *options)
            for options in (("--start", "RobotStart1"), ("--pose", "1,0,0"))
        ),
        ("navigate", "{map}", "--algorithm", "bug2", "--time-limit", "1"),
        ("navigate", *("{map}", "--algorithm", "bug2", "--json")),
    ],
)
def test_names_in_a_map_are_escaped(
    hostile_map: Path, command: tuple[str, ...]
) -> None:
    words = [w.format(map=hostile_map, folder=hostile_map.parent) for w in command]
    run = radarsim(*words)
    assert is_printable(run.text + run.err)
    if command[0] in ("check", "explain"):
        assert SHOWN in run.text
        assert MARKUP in run.text


def test_title_and_legend_of_a_picture_are_escaped(hostile_map: Path) -> None:
    picture = hostile_map.parent / "scan.svg"
    pose = ("--sensor", "radar", "--start", "RobotStart1")
    assert radarsim("scan", hostile_map, *pose, "-o", picture).code == 0
    assert is_printable(picture.read_text(encoding="utf-8"))


@pytest.mark.slow
def test_markup_in_the_name_of_a_map_stays_text(hostile_map: Path) -> None:
    words = ("--algorithms", "bug2", "--seeds", "1", "--workers", "1")
    run = radarsim("trials", hostile_map, *words)
    assert run.code == 0
    assert is_printable(run.text + run.err)
    assert "[red]" in run.text


@pytest.mark.parametrize(
    ("command", "code"),
    [
        (("check", HOSTILE), 1),
        (("check", "empty_room", f"--{HOSTILE}"), 2),
        (("check", "empty_room", "--plot", HOSTILE), 2),
        (("check", f"empty_room@{HOSTILE}"), 1),
        ((HOSTILE,), 2),
        (("serve", "empty_room", "--port", HOSTILE), 2),
        (("serve", "empty_room", "--host", HOSTILE), 1),
        (("scan", "empty_room", "--sensor", HOSTILE, "--pose", "0,0,0"), 2),
        (("navigate", "--algorithm", HOSTILE), 2),
        (("docs", HOSTILE), 2),
    ],
)
def test_words_of_a_command_line_are_escaped_in_messages(
    command: tuple[str, ...], code: int
) -> None:
    run = radarsim(*command)
    assert run.code == code
    assert is_printable(run.text + run.err)
    assert r"\x1b" in run.text + run.err


def test_path_of_a_written_file_is_escaped(tmp_path: Path) -> None:
    run = radarsim("new", tmp_path / f"{HOSTILE}.yaml")
    assert run.code == 0
    assert is_printable(run.text)
    assert SHOWN in run.text


def test_log_lines_are_escaped(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO()
    monkeypatch.setattr("sys.stderr", stream)
    root = logging.getLogger()
    before = root.handlers[:]
    root.handlers.clear()
    try:
        output.start_log(logging.WARNING, "%(levelname)s %(message)s")
        logging.getLogger("radarsim").warning("%s did it\n", HOSTILE)
    finally:
        root.handlers[:] = before
    assert stream.getvalue() == f"WARNING {SHOWN} did it\\n\n"


def test_messages_of_errors_are_printable_also_in_python() -> None:
    assert str(RadarsimError(f"{HOSTILE}\nsecond line")) == f"{SHOWN}\nsecond line"
    error = MapError([f"a: {HOSTILE}", "b\nc"])
    assert error.problems == [f"a: {SHOWN}", r"b\nc"]
    assert str(error) == "\n".join(error.problems)


@pytest.mark.parametrize("text", ["", "two words", "1 m²", "Größe", "木"])
def test_printable_text_stays_as_it_is(text: str) -> None:
    assert escape_unprintable(text) == text


@pytest.mark.parametrize(
    ("called", "name"),
    [
        ("radarsim", "radarsim"),
        ("/no such folder/bin/radarsim", "'/no such folder/bin/radarsim'"),
        ("/a/radarsim/__main__.py", "python -m radarsim"),
        ("/usr/bin/pytest", "radarsim"),
    ],
)
def test_commands_to_copy_begin_as_the_program_was_called(
    monkeypatch: pytest.MonkeyPatch, called: str, name: str
) -> None:
    monkeypatch.setattr("sys.argv", [called])
    monkeypatch.setenv("PATH", "/nowhere")
    assert output.program_name() == name
