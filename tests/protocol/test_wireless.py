"""Questions of and to wireless servers, and the model of signals."""

import math

import pytest

from radarsim.protocol import questions
from radarsim.protocol.dialect import COMPAT, UDK
from radarsim.protocol.message import Triple

ROBOTS = (("R1", (1.0, 2.0, 0.1), False), ("R2", (3.0, -4.0, 0.1), True))


def count(start: Triple, end: Triple) -> int:
    """Count obstacles by the places."""
    return round(abs(start[0] - end[0]))


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (
            "GETPOS",
            "POSITIONS {Robots 2}"
            " {Name R1 Location 1.00,-2.00,-0.10 BatteryEmpty False}"
            " {Name R2 Location 3.00,4.00,-0.10 BatteryEmpty True}",
        ),
        ("getobs {from R1} {to R2}", "NUMOBS {From R1} {To R2} {ObstCount 2.0000}"),
        ("GETOBS {From R1} {To R9}", "NUMOBS {From R1} {To R9} {ObstCount -1.0000}"),
        ("GETOBS {From R9} {To R1}", "NUMOBS {From R9} {To R1} {ObstCount -1.0000}"),
        (
            "GETOBS {Start 0,0,0} {End 5,0,0}",
            "NUMOBS {Start 0,0,0} {End 5,0,0} {ObstCount 5.0000}",
        ),
        ("GETOBS {From R1}", ""),
        ("GETOBS {Start 0,0,0} {To R1}", ""),
        ("GETOBS {Start 1,2} {End 3,4,5}", ""),
        ("GETSS {Robot R1}", ""),
        ("GETPOS {", ""),
    ],
)
def test_question_is_answered_as_by_the_original(line: str, expected: str) -> None:
    answer = questions.answer_wireless(line, ROBOTS, count, UDK)
    assert answer.decode("ascii") == f"{expected}\r\n"


def test_a_blank_line_has_no_answer() -> None:
    assert questions.answer_wireless("", ROBOTS, count, UDK) == b""


def test_decimals_are_those_of_the_dialect() -> None:
    line = questions.answer_wireless("GETPOS", ROBOTS[:1], count, COMPAT)
    assert b"Location 1.0000,-2.0000,-0.1000 " in line


@pytest.mark.parametrize(
    ("line", "request_"),
    [
        ("INIT {Robot R1} {Port 7000,7001}", ("INIT", "R1", (7000, 7001))),
        ("init {robot R 1} {port 7000, }", ("INIT", "R 1", (7000,))),
        ("DNS {Robot R2}", ("DNS", "R2", ())),
        ("DNS {Robot R2} {Port x}", ("DNS", "R2", None)),
        ("DNS {Robot R2} {Port 65536}", ("DNS", "R2", None)),
        ("DNS {Robot R2} {Port 0}", ("DNS", "R2", None)),
        ("DNS {Robot R2} {Port 123456}", ("DNS", "R2", None)),
        ("DNS {Robot", ("", "", ())),
    ],
)
def test_requests_are_read(
    line: str, request_: tuple[str, str, tuple[int, ...] | None]
) -> None:
    assert questions.read_request(line) == request_


def test_signal_falls_with_distance_and_obstacles() -> None:
    assert questions.signal_strength(2.0, 0) == pytest.approx(-49.67)
    assert questions.signal_strength(20.0, 0) == pytest.approx(-59.67)
    assert questions.signal_strength(20.0, 2) == pytest.approx(-59.67 - 12.65)
    assert questions.signal_strength(0.0, 3) == math.inf


@pytest.mark.parametrize(
    ("strength", "text"),
    [
        (-59.6712345, "{Strength -59.6712}"),
        (math.inf, "{Strength INF} {Error Model.Returned.INF}"),
        (1.0, "{Strength NaN} {Error Model.Returned.NaN}"),
        (None, "{Strength NaN} {Error Model.Returned.NaN}"),
    ],
)
def test_strengths_are_written_as_by_the_original(
    strength: float | None, text: str
) -> None:
    assert questions.strength_text(strength) == text
