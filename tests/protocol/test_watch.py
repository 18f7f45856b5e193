"""The command of watchers and the lines that they get."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.errors import MalformedMessage
from radarsim.protocol.commands import Watch, encode_command, parse_command
from radarsim.protocol.dialect import COMPAT, UDK
from radarsim.protocol.watch import (
    MOST_NAMES,
    CommandError,
    RobotChoice,
    RobotJoined,
    RobotLeft,
    see_head,
    split_seen,
)

ALL = RobotChoice(None)
LINE = re.compile(r"[A-Z]+( \{[ -z|~]+\})+")


def test_clock_of_a_watch_is_read_and_written() -> None:
    line = "WATCH {Robots All} {Clock true}"
    watch = Watch(ALL, clock=True)
    assert parse_command(line, COMPAT)[0] == watch
    assert encode_command(watch) == line


@pytest.mark.parametrize(
    ("line", "robots", "echoes"),
    [
        ("WATCH {Robots All}", ALL, RobotChoice()),
        ("watch {robots ALL} {echoes TRUE}", ALL, ALL),
        ("WATCH {Echoes false} {Robots R1}", RobotChoice(("R1",)), RobotChoice()),
        ("WATCH {Robots none}", RobotChoice(), RobotChoice()),
        ("WATCH {Robots All,}", RobotChoice(("All",)), RobotChoice()),
        ("WATCH {Robots All} {Echoes true,}", ALL, RobotChoice(("true",))),
        (
            "WATCH {Robots R1,, P3AT_2 ,} {Echoes r1}",
            RobotChoice(("R1", "P3AT_2")),
            RobotChoice(("r1",)),
        ),
        ("WATCH {Robots All} {Echoes }", ALL, RobotChoice()),
        ("WATCH {Robots Caf\xe9}", RobotChoice(("Caf?",)), RobotChoice()),
    ],
)
def test_watch_is_read_and_written(
    line: str, robots: RobotChoice, echoes: RobotChoice
) -> None:
    watch = Watch(robots, echoes)
    for dialect in (COMPAT, UDK):
        assert parse_command(line, dialect)[0] == watch
        assert parse_command(encode_command(watch), dialect)[0] == watch


@pytest.mark.parametrize(
    "line",
    [
        "WATCH",
        "WATCH {Robots}",
        "WATCH {Robots ,, ,}",
        "WATCH {Robot All}",
        "WATCH {Robots All} {Echoes ,}",
        f"WATCH {{Robots {'a,' * (MOST_NAMES + 1)}}}",
    ],
)
def test_watch_of_no_robots_is_malformed(line: str) -> None:
    with pytest.raises(MalformedMessage):
        parse_command(line, COMPAT)


def test_choice_includes_names_in_any_case() -> None:
    choice = RobotChoice.parse("R1,caf\xe9")
    assert choice.includes("r1")
    assert choice.includes("CAF?")
    assert not choice.includes("R11")
    assert ALL.includes("anything")
    assert not RobotChoice().includes("anything")


@given(name=st.text(max_size=80))
def test_lines_about_any_robot_are_printable_and_can_be_split(name: str) -> None:
    for report in (RobotJoined(name, "P3AT"), RobotLeft(name), CommandError(name)):
        assert LINE.fullmatch(report.encode(COMPAT))
    joined = RobotJoined(name, "P3AT").encode(COMPAT)
    head = see_head(name).decode("ascii")
    assert LINE.fullmatch(head.rstrip())
    robot, own = split_seen(head + joined)
    assert own == joined
    assert f"{{Joined {robot}}}" in joined


@pytest.mark.parametrize("line", ["SEE", "SEE {Robot R1}", "SEE {Name R1} STA {A 1}"])
def test_line_without_robot_or_content_is_no_copy(line: str) -> None:
    with pytest.raises(MalformedMessage):
        split_seen(line)
