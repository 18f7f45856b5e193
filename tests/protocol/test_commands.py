import re
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.errors import MalformedMessage, ProtocolError
from radarsim.geometry import Pose3
from radarsim.protocol.commands import (
    Command,
    Drive,
    GetConf,
    GetGeo,
    Init,
    ParsedCommand,
    SetItem,
    Unsupported,
    parse_command,
    parse_pose,
    parse_switch,
)
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.framing import LineBuffer


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        pytest.param(
            "SET {Type RangeScanner} {Name lms200} {Opcode SCAN} {Params 0}",
            SetItem("RangeScanner", "lms200", "SCAN", "0"),
            id="extra scan",
        ),
        pytest.param(
            "SET {Type INS} {Opcode POSE} {Params 0,0,0,0,0,0}",
            SetItem("INS", None, "POSE", "0,0,0,0,0,0"),
            id="pose",
        ),
        pytest.param(
            "set {name } {opcode Reset} {type tachometer}",
            SetItem("tachometer", None, "Reset", ""),
            id="any order and case",
        ),
        pytest.param(
            "INIT {ClassName P3AT} {Start a} {Location abc}",
            Init("P3AT", None, "a"),
            id="a start outdoes the location",
        ),
        pytest.param(
            "INIT {ClassName USARBot.P3AT} {Rotation 0,0,1}",
            Init("P3AT", rotation=(0.0, 0.0, -1.0)),
            id="rotation alone",
        ),
        pytest.param(
            "DRIVE {Left } {Right} {Light } {Colour red}", Drive(), id="empty fields"
        ),
        pytest.param("DRIVE", Drive(), id="drive with nothing"),
        pytest.param("DRIVE {Light 1}", Drive(light=False), id="one is not true"),
    ],
)
@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=lambda dialect: dialect.name)
def test_other_commands(line: str, expected: Command, dialect: Dialect) -> None:
    assert parse_command(line, dialect).command == expected


def test_fields_that_a_command_does_not_have_are_reported() -> None:
    line = "drive {Left 1} {colour red} {RIGHT 1} {Speed 2} {Speed 3}"
    parsed = parse_command(line, COMPAT)
    assert parsed == ParsedCommand(Drive(1, 1), ("colour", "Speed", "Speed"))


def test_true_in_capitals_is_true_in_compat_only() -> None:
    line = "DRIVE {Normalized True} {Light TRUE} {Flip true}"
    assert parse_command(line, COMPAT).command == Drive(None, None, True, True, True)
    assert parse_command(line, UDK).command == Drive(None, None, False, False, True)


@pytest.mark.parametrize(
    "verb",
    [
        *("ACT", "camera", "Control", "GETCLOSESTPATHNODE", "GETNFO", "GETPATHNODES"),
        *("GOTO", "MISPKG", "MOVE", "MULTIDRIVE", "PAUSE", "PING", "TEST", "TRACE"),
    ],
)
def test_what_the_originals_know_is_accepted(verb: str) -> None:
    assert parse_command(f"{verb} {{Name a}}", COMPAT).command == Unsupported(
        verb.upper()
    )


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        pytest.param(
            "FOO {A b}",
            "verb 'FOO', expected one of ['DRIVE', 'GETCONF', 'GETGEO', "
            "'GETSTARTPOSES', 'INIT', 'SET']",
            id="unknown verb",
        ),
        pytest.param(
            "DRIVE Left 1",
            "expected '{Key value}' at column 7 in 'DRIVE Left 1'",
            id="no braces",
        ),
        pytest.param(
            "DRIVE {Left 1} {Right abc}",
            "DRIVE Right: 'abc', expected a number",
            id="one bad number",
        ),
        pytest.param(
            "drive {Left nan} {Right 1}",
            "drive Left: 'nan', expected a number",
            id="not a number",
        ),
        pytest.param(
            "DRIVE {Left 1e400} {Right 1}",
            "DRIVE Left: '1e400', expected at most 1e+09",
            id="overflow",
        ),
        pytest.param(
            "INIT {ClassName P3AT} {Location 1,2}",
            "INIT Location: '1,2', expected 3 numbers",
            id="short vector",
        ),
        pytest.param(
            "INIT {ClassName P3AT} {Rotation 0,0,inf}",
            "INIT Rotation: 'inf', expected a number",
            id="infinite rotation",
        ),
        pytest.param(
            "INIT {Name R1}",
            "'INIT {Name R1}', expected a field '{ClassName ...}'",
            id="no class",
        ),
        pytest.param(
            "GETGEO", "'GETGEO', expected a field '{Type ...}'", id="geo without type"
        ),
        pytest.param(
            "GETCONF {Type }",
            "'GETCONF {Type}', expected a field '{Type ...}'",
            id="conf with an empty type",
        ),
        pytest.param(
            "SET {Type INS}",
            "'SET {Type INS}', expected a field '{Opcode ...}'",
            id="no opcode",
        ),
        pytest.param(
            "SET {Opcode SCAN}",
            "'SET {Opcode SCAN}', expected a field '{Type ...}'",
            id="set without type",
        ),
    ],
)
def test_a_bad_command_is_refused_whole(line: str, problem: str) -> None:
    with pytest.raises(MalformedMessage, match=f"^{re.escape(problem)}$"):
        parse_command(line, COMPAT)


def test_the_pose_of_an_order_comes_from_the_wire() -> None:
    assert parse_pose("1,2,3,0.1,0.2,0.3") == Pose3(1, -2, -3, 0.1, -0.2, -0.3)
    assert parse_pose("1,5 2 3 0 0 0") == Pose3(1.5, -2, -3)
    with pytest.raises(MalformedMessage, match="expected 6 numbers"):
        parse_pose("1,2,3")


@pytest.mark.parametrize(
    ("params", "on"),
    [
        ("true", True),
        ("TRUE", True),
        (" True ", True),
        ("false", False),
        ("fALSE", False),
    ],
)
def test_a_switch_is_on_or_off_in_any_case(params: str, on: bool) -> None:
    assert parse_switch(params) is on


@pytest.mark.parametrize("params", ["", "1", "0", "yes", "truefalse", "true,true"])
def test_a_switch_is_nothing_else(params: str) -> None:
    with pytest.raises(MalformedMessage) as caught:
        parse_switch(params)
    assert str(caught.value) == f"{params!r}, expected 'true' or 'false'"


PIECES = ["INIT", "drive", "SET ", "GETGEO", "{", "}", " ", "ClassName ", "Location "]
PIECES += ["Left ", "1,5", "nan", "1e999", "Type ", "Opcode ", "\0", "\x85", "\xff"]


@given(
    stream=st.binary(max_size=100)
    | st.lists(st.sampled_from(PIECES), max_size=15).map(
        lambda pieces: "".join(pieces).encode("latin-1")
    ),
    dialect=st.sampled_from([COMPAT, UDK]),
)
def test_random_bytes_raise_nothing_but_protocol_errors(
    stream: bytes, dialect: Dialect
) -> None:
    for line in LineBuffer().feed(stream + b"\n"):
        with suppress(ProtocolError):
            parse_command(line, dialect)


@given(cut=st.integers(0, 120))
def test_a_packet_cut_anywhere_means_the_same(cut: int) -> None:
    stream = (
        b"INIT {ClassName USARBot.P3AT} {Name R1} {Start RobotStart1}\n\r"
        b"GETGEO {Type Robot}\n\rGETCONF {Type Robot}\n\r"
    )
    lines = LineBuffer()
    texts = lines.feed(stream[:cut]) + lines.feed(stream[cut:])
    assert [parse_command(text, COMPAT).command for text in texts] == [
        Init("P3AT", "R1", "RobotStart1"),
        GetGeo("Robot"),
        GetConf("Robot"),
    ]
