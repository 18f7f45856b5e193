"""Questions of a wireless server, and the answers."""

import pytest

from radarsim.errors import MalformedMessage
from radarsim.protocol.dialect import COMPAT, UDK
from radarsim.protocol.message import Triple
from radarsim.protocol.wireless import Station, WirelessRequest

STATIONS = (
    Station("R1", (1.0, 2.0, 0.1), is_spent=False),
    Station("R2", (3.0, -4.0, 0.1), is_spent=True),
)


def count(start: Triple, end: Triple) -> int:
    """Count what the test can tell from the places."""
    return round(abs(start[0] - end[0]))


def answer(line: str) -> str | None:
    request = WirelessRequest.decode(line)
    if request is None:
        return None
    return request.answer(STATIONS, count, UDK).decode("ascii").removesuffix("\r\n")


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (
            "GETPOS",
            "POSITIONS {Robots 2}"
            " {Name R1 Location 1.00,-2.00,-0.10 BatteryEmpty False}"
            " {Name R2 Location 3.00,4.00,-0.10 BatteryEmpty True}",
        ),
        (
            "getobs {from R1} {to R2}",
            "NUMOBS {From R1} {To R2} {ObstCount 2.0000}",
        ),
        (
            "GETOBS {From R1} {To R9}",
            "NUMOBS {From R1} {To R9} {ObstCount -1.0000}",
        ),
        (
            "GETOBS {From R9} {To R1}",
            "NUMOBS {From R9} {To R1} {ObstCount -1.0000}",
        ),
        (
            "GETOBS {Start 0,0,0} {End 5,0,0}",
            "NUMOBS {Start 0,0,0} {End 5,0,0} {ObstCount 5.0000}",
        ),
        ("GETOBS {From R1}", None),
        ("GETOBS {Start 0,0,0} {To R1}", None),
        ("GETSS {Robot R1}", None),
    ],
)
def test_question_is_answered_as_by_the_original(
    line: str, expected: str | None
) -> None:
    assert answer(line) == expected


def test_decimals_are_those_of_the_dialect() -> None:
    request = WirelessRequest.decode("GETPOS")
    assert request is not None
    line = request.answer(STATIONS[:1], count, COMPAT)
    assert b"Location 1.0000,-2.0000,-0.1000 " in line


@pytest.mark.parametrize("line", ["GETOBS {Start 1,2} {End 3,4,5}", "GETPOS {"])
def test_what_is_no_place_and_no_message_is_malformed(line: str) -> None:
    with pytest.raises(MalformedMessage):
        answer(line)
