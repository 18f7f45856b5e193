"""Requests to a wireless server, and its model of signals."""

import math

import pytest

from radarsim.protocol.radio import RadioRequest, signal_strength, strength_text


@pytest.mark.parametrize(
    ("line", "request_"),
    [
        ("INIT {Robot R1} {Port 7000,7001}", RadioRequest("INIT", "R1", (7000, 7001))),
        ("init {robot R 1} {port 7000, }", RadioRequest("INIT", "R 1", (7000,))),
        ("DNS {Robot R2}", RadioRequest("DNS", "R2")),
        ("DNS {Robot R2} {Port x}", RadioRequest("DNS", "R2", None)),
        ("DNS {Robot R2} {Port 65536}", RadioRequest("DNS", "R2", None)),
        ("DNS {Robot R2} {Port 0}", RadioRequest("DNS", "R2", None)),
        ("DNS {Robot R2} {Port 123456}", RadioRequest("DNS", "R2", None)),
        ("DNS {Robot", RadioRequest("")),
    ],
)
def test_requests_are_read(line: str, request_: RadioRequest) -> None:
    assert RadioRequest.decode(line) == request_


def test_signal_falls_with_distance_and_obstacles() -> None:
    assert signal_strength(2.0, 0) == pytest.approx(-49.67)
    assert signal_strength(20.0, 0) == pytest.approx(-59.67)
    assert signal_strength(20.0, 2) == pytest.approx(-59.67 - 12.65)
    assert signal_strength(0.0, 3) == math.inf


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
    assert strength_text(strength) == text
