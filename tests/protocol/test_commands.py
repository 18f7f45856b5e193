import re
from contextlib import suppress
from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.errors import MalformedMessage, ProtocolError
from radarsim.geometry import Pose3
from radarsim.protocol.commands import (
    Act,
    Action,
    Command,
    Control,
    Drive,
    GetConf,
    GetGeo,
    GetStartPoses,
    Init,
    MovePackage,
    MultiDrive,
    SetItem,
    SetViewports,
    ShowCamera,
    Trace,
    encode_command,
    parse_command,
    parse_pose,
    parse_switch,
)
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.message import LineBuffer
from radarsim.protocol.packages import RATE, RELATIVE, LinkOrder

OTHERS = {
    "any order and case": (
        "set {name } {opcode Reset} {type tachometer}",
        SetItem("tachometer", None, "Reset", ""),
    ),
    "a start outdoes the location": (
        "INIT {ClassName P3AT} {Start a} {Location abc}",
        Init("P3AT", None, "a"),
    ),
    "rotation alone": (
        "INIT {ClassName USARBot.P3AT} {Rotation 0,0,1}",
        Init("P3AT", rotation=(0.0, 0.0, -1.0)),
    ),
    "empty fields": ("DRIVE {Left } {Right} {Light } {Colour red}", Drive()),
    "gripper of another server": ("ACT {Name Arm} {Gripper 1}", Act("Arm", ())),
    "one is not true": ("DRIVE {Light 1}", Drive(light=False)),
}


@pytest.mark.parametrize(("line", "expected"), OTHERS.values(), ids=OTHERS)
@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=lambda dialect: dialect.name)
def test_other_commands_are_parsed(
    line: str, expected: Command, dialect: Dialect
) -> None:
    assert parse_command(line, dialect)[0] == expected


ARM = (LinkOrder("Arm", 2, 1.5), LinkOrder("Arm", 4, -0.5, RELATIVE))
WRITTEN_AGAIN = {
    "package": (
        "MISPKG {Name Arm} {Link 2} {Value 1.5} {Link 4} {Order 10} {Value -.5}",
        MovePackage("Arm", ARM),
        "MISPKG {Name Arm} {Link 2} {Value 1.5} {Order 0} {Link 4} {Value -0.5}"
        " {Order 10}",
    ),
    "no link": ("act {name Arm}", Act("Arm", ()), "ACT {Name Arm}"),
    "flippers": (
        "Multidrive {FRFlipper 1,57}{FLFlipper -1}",
        MultiDrive(
            (LinkOrder("FRFlipper", None, 1.57), LinkOrder("FLFlipper", None, -1.0))
        ),
        "MULTIDRIVE {FRFlipper 1.57} {FLFlipper -1.0}",
    ),
    "one flipper": (
        "DRIVE {Name FLFlipper}{Order 1}{Value -0.5}",
        Drive(joint="FLFlipper", value=-0.5, order=RATE),
        "DRIVE {Name FLFlipper} {Value -0.5} {Order 1}",
    ),
    "pan and tilt": (
        "MISPKG {Name Eye} {Rotation 0,-0.5,0.25} {Order 1}",
        MovePackage(
            "Eye", (LinkOrder("Eye", 1, 0.5, RATE), LinkOrder("Eye", 2, 0.25, RATE))
        ),
        "MISPKG {Name Eye} {Link 1} {Value 0.5} {Order 1} {Link 2} {Value 0.25}"
        " {Order 1}",
    ),
    "a robot": (
        "set {type camera} {robot R1} {Client 10.0.0.2}",
        ShowCamera("10.0.0.2", "R1"),
        "SET {Client 10.0.0.2} {Robot R1} {Type Camera}",
    ),
    "one camera": (
        "SET {Type Viewports} {Config 0} {Viewport1 Camera2} {Viewport3 }",
        SetViewports(False, ("Camera2", None, None, None)),
        "SET {Type Viewports} {Config SingleView} {Viewport1 Camera2}",
    ),
    "four cameras": (
        "SET {Config QUADVIEW} {Type viewports} {Viewport4 Disable}",
        SetViewports(True, (None, None, None, "Disable")),
        "SET {Type Viewports} {Config QuadView} {Viewport4 Disable}",
    ),
    "a camera": (
        "SET {Type Viewports} {Viewport2 C}",
        SetViewports(None, (None, "C", None, None)),
        "SET {Type Viewports} {Viewport2 C}",
    ),
    "field of view": (
        "SET {Type Camera} {Name C} {FOV 1}",
        SetItem("Camera", "C", "FOV", "1"),
        "SET {Type Camera} {Name C} {Opcode FOV} {Params 1}",
    ),
    "trail": (
        "Trace {On True} {Interval 0,5} {Color green}",
        Trace(True, 0.5, "Green"),
        "TRACE {On true} {Interval 0.5} {Color Green}",
    ),
    "crate": (
        "CONTROL {Type relmove} {Name a} {Location 1, 2, 3}",
        Control(Action.MOVE_BY, "a", position=(1, -2, -3)),
        "CONTROL {Type RelMove} {Name a} {Location 1.0,2.0,3.0} {Rotation 0.0,0.0,0.0}"
        " {Scale 1.0,1.0,1.0}",
    ),
    "new crate": (
        "CONTROL {Type Create} {ClassName USARPhysObj.WCCrate} {Name a} {Start s} "
        "{Scale 1,2,3} {Physics Falling} {Permanent TRUE} {Memory m}",
        Control(
            Action.CREATE,
            "a",
            "WCCrate",
            scale=(1, 2, 3),
            start="s",
            falls=True,
            stays=True,
        ),
        "CONTROL {Type Create} {Name a} {ClassName WCCrate} {Location 0.0,0.0,0.0}"
        " {Rotation 0.0,0.0,0.0} {Scale 1.0,2.0,3.0} {Start s} {Physics RigidBody}"
        " {Permanent true}",
    ),
    "space": (
        "CONTROL {Type KillAll} {MinPos 1,2,3} {MaxPos 0,0,0}",
        Control(Action.KILL_ALL, low=(1, -2, -3), high=(0, 0, 0)),
        "CONTROL {Type KillAll} {Location 0.0,0.0,0.0} {Rotation 0.0,0.0,0.0}"
        " {Scale 1.0,1.0,1.0} {MinPos 1.0,2.0,3.0} {MaxPos 0.0,0.0,0.0}",
    ),
}


@pytest.mark.parametrize(
    ("line", "command", "again"), WRITTEN_AGAIN.values(), ids=WRITTEN_AGAIN
)
def test_commands_are_read_and_written(line: str, command: Command, again: str) -> None:
    for dialect in (COMPAT, UDK):
        assert parse_command(line, dialect) == (command, [])
    assert encode_command(command) == again
    assert parse_command(again, UDK)[0] == command


WRONG_LINKS = {
    "config": ("SET {Type Viewports} {Config 2}", "Config '2', expected"),
    "no opcode": ("SET {Type Camera} {Name C}", "expected a field"),
    "two angles": ("MISPKG {Name A} {Rotation 1,2}", "expected"),
    "no name": ("MISPKG {Link 1}", "expected a field .{Name"),
    "no link": ("ACT {Name A} {Value 1}", "Value before Link"),
    "no number": ("MISPKG {Name A} {Link one}", "'one', expected"),
    "many": ("MISPKG {Name A}" + " {Link 1}" * 33, "33 links, expected at most"),
    "flippers": ("MULTIDRIVE" + " {F 1}" * 99, "99 links, expected at most 32"),
}


@pytest.mark.parametrize(("line", "problem"), WRONG_LINKS.values(), ids=WRONG_LINKS)
def test_links_that_cannot_be_read_are_refused(line: str, problem: str) -> None:
    with pytest.raises(MalformedMessage, match=problem):
        parse_command(line, COMPAT)


def test_unknown_fields_are_reported() -> None:
    line = "drive {Left 1} {colour red} {RIGHT 1} {Steer 2}"
    parsed = parse_command(line, COMPAT)
    assert parsed == (Drive(1, 1), ["colour", "Steer"])


def test_true_in_capitals_is_true_in_compat_only() -> None:
    line = "DRIVE {Normalized True} {Light TRUE} {Flip true}"
    assert parse_command(line, COMPAT)[0] == Drive(None, None, True, True, True)
    assert parse_command(line, UDK)[0] == Drive(None, None, False, False, True)


MALFORMED = {
    "a verb of other servers": (
        "PING",
        "verb 'PING', expected one of ['ACT', 'CONTROL', 'DRIVE', 'GETCONF', 'GETGEO',"
        " 'GETSTARTPOSES', 'INIT', 'MISPKG', 'MULTIDRIVE', 'SET', 'TRACE', 'WATCH']",
    ),
    "one bad number": (
        "DRIVE {Left 1} {Right abc}",
        "DRIVE Right: 'abc', expected a number",
    ),
    "overflow": (
        "DRIVE {Left 1e400} {Right 1}",
        "DRIVE Left: '1e400', expected at most 1e+09",
    ),
    "outside the world": (
        "INIT {ClassName P3AT} {Location 0,2e9,0}",
        "INIT Location: '2e9', expected at most 1e+09",
    ),
    "no opcode": (
        "SET {Type INS}",
        "'SET {Type INS}', expected a field '{Opcode ...}'",
    ),
}


@pytest.mark.parametrize(("line", "problem"), MALFORMED.values(), ids=MALFORMED)
def test_malformed_command_raises_an_error(line: str, problem: str) -> None:
    with pytest.raises(MalformedMessage, match=f"^{re.escape(problem)}$"):
        parse_command(line, COMPAT)


def test_parse_pose_converts_from_the_wire_frame() -> None:
    assert parse_pose("1,2,3,0.1,0.2,0.3") == Pose3(1, -2, -3, 0.1, -0.2, -0.3)
    assert parse_pose("1,5 2 3 0 0 0") == Pose3(1.5, -2, -3)
    with pytest.raises(MalformedMessage, match="expected 6 numbers"):
        parse_pose("1,2,3")


@pytest.mark.parametrize(
    ("params", "on"), [("true", True), (" True ", True), ("fALSE", False)]
)
def test_parse_switch_accepts_true_and_false_in_any_case(params: str, on: bool) -> None:
    assert parse_switch(params) is on


@pytest.mark.parametrize("params", ["", "1", "0", "yes", "truefalse", "true,true"])
def test_parse_switch_rejects_everything_else(params: str) -> None:
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
def test_random_bytes_raise_only_protocol_errors(
    stream: bytes, dialect: Dialect
) -> None:
    for line in LineBuffer().feed(stream + b"\n"):
        with suppress(ProtocolError):
            parse_command(line, dialect)


NUMBERS = st.floats(-1e9, 1e9)
TRIPLES = st.tuples(NUMBERS, NUMBERS, NUMBERS)
WORDS = st.from_regex(r"[A-Za-z0-9_]{1,9}", fullmatch=True)
TEXTS = st.from_regex(r"[!-z|~]([ -z|~]{0,20}[!-z|~])?", fullmatch=True)
FLAGS = st.none() | st.booleans()
COMMANDS = st.one_of(
    st.builds(Init, WORDS, st.none() | TEXTS, TEXTS, takes_free=st.booleans()),
    st.builds(
        Init,
        WORDS,
        st.none() | TEXTS,
        position=st.none() | TRIPLES,
        rotation=st.none() | st.tuples(*[st.floats(-3.14, 3.14)] * 3),
        takes_free=st.booleans(),
    ),
    st.builds(Drive, st.none() | NUMBERS, st.none() | NUMBERS, FLAGS, FLAGS, FLAGS),
    st.just(GetStartPoses()),
    st.builds(GetGeo, TEXTS, st.none() | TEXTS),
    st.builds(GetConf, TEXTS, st.none() | TEXTS),
    st.builds(SetItem, TEXTS, st.none() | TEXTS, TEXTS, st.just("") | TEXTS),
)


@given(command=COMMANDS, dialect=st.sampled_from([COMPAT, UDK]))
def test_encoded_command_parses_to_the_same_command(
    command: Command, dialect: Dialect
) -> None:
    assert parse_command(encode_command(command), dialect)[0] == command


WRITTEN = {
    "axes of the wire": (
        Init("P3AT", "R1", position=(1.0, 2.0, 0.5), rotation=(0.0, 0.0, 1.5)),
        "INIT {ClassName USARBot.P3AT} {Name R1}"
        " {Location 1.0,-2.0,-0.5} {Rotation 0.0,0.0,-1.5}",
    ),
    "package": (Init("My.P3AT", start="A"), "INIT {ClassName My.P3AT} {Start A}"),
    "no exponent": (
        Drive(1e-7, -1e9, light=True),
        "DRIVE {Left 0.0000001} {Right -1000000000.0} {Light true}",
    ),
    "no minus": (Drive(-0.0, 0), "DRIVE {Left 0.0} {Right 0.0}"),
    "a car that turns left": (
        Drive(speed=2, front_steer=0.25, rear_steer=0.0),
        "DRIVE {Speed 2.0} {FrontSteer -0.25} {RearSteer 0.0}",
    ),
}


@pytest.mark.parametrize(("command", "line"), WRITTEN.values(), ids=WRITTEN)
def test_encode_command_writes_usarsim_lines(command: Command, line: str) -> None:
    assert encode_command(command) == line


@pytest.mark.parametrize("number", [nan, inf, -inf, 1.1e9])
def test_encode_command_rejects_numbers_out_of_range(number: float) -> None:
    with pytest.raises(ValueError, match=r"expected a magnitude of at most 1e\+09"):
        encode_command(Drive(0, number))


@pytest.mark.parametrize("text", ["a\r\nDRIVE", "a}", "{a", "Straße", "a\tb"])
def test_encode_command_rejects_text_that_would_inject_a_line_or_field(
    text: str,
) -> None:
    with pytest.raises(ValueError, match="expected printable ASCII without braces"):
        encode_command(Init("P3AT", name=text))


def test_encode_command_rejects_what_is_no_text() -> None:
    with pytest.raises(ValueError, match="text 7, expected printable ASCII"):
        encode_command(Init("P3AT", name=7))  # type: ignore[arg-type]
