from math import inf, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.protocol.commands import (
    Command,
    Drive,
    GetConf,
    GetGeo,
    GetStartPoses,
    Init,
    SetItem,
    Unsupported,
    encode_command,
    parse_command,
)
from radarsim.protocol.dialect import COMPAT, UDK, Dialect

NUMBERS = st.floats(-1e9, 1e9)
TRIPLES = st.tuples(NUMBERS, NUMBERS, NUMBERS)
WORDS = st.from_regex(r"[A-Za-z0-9_]{1,9}", fullmatch=True)
TEXTS = st.from_regex(r"[!-z|~]([ -z|~]{0,20}[!-z|~])?", fullmatch=True)
FLAGS = st.none() | st.booleans()
COMMANDS = st.one_of(
    st.builds(Init, WORDS, st.none() | TEXTS, TEXTS),
    st.builds(
        Init,
        WORDS,
        st.none() | TEXTS,
        position=st.none() | TRIPLES,
        rotation=st.none() | TRIPLES,
    ),
    st.builds(Drive, st.none() | NUMBERS, st.none() | NUMBERS, FLAGS, FLAGS, FLAGS),
    st.just(GetStartPoses()),
    st.builds(GetGeo, TEXTS, st.none() | TEXTS),
    st.builds(GetConf, TEXTS, st.none() | TEXTS),
    st.builds(SetItem, TEXTS, st.none() | TEXTS, TEXTS, st.just("") | TEXTS),
    st.builds(Unsupported, st.sampled_from(["ACT", "PING", "MISPKG"])),
)


@given(command=COMMANDS, dialect=st.sampled_from([COMPAT, UDK]))
def test_a_server_reads_what_was_meant(command: Command, dialect: Dialect) -> None:
    assert parse_command(encode_command(command), dialect).command == command


@pytest.mark.parametrize(
    ("command", "line"),
    [
        pytest.param(
            Init("P3AT", "R1", position=(1.0, 2.0, 0.5), rotation=(0.0, 0.0, 1.5)),
            "INIT {ClassName USARBot.P3AT} {Name R1}"
            " {Location 1.0,-2.0,-0.5} {Rotation 0.0,0.0,-1.5}",
            id="axes of the wire",
        ),
        pytest.param(
            Init("My.P3AT", start="A"),
            "INIT {ClassName My.P3AT} {Start A}",
            id="package",
        ),
        pytest.param(
            Drive(1e-7, -1e9, light=True),
            "DRIVE {Left 0.0000001} {Right -1000000000.0} {Light true}",
            id="no exponent",
        ),
        pytest.param(Drive(-0.0, 0), "DRIVE {Left 0.0} {Right 0.0}", id="no minus"),
    ],
)
def test_lines_as_the_field_knows_them(command: Command, line: str) -> None:
    assert encode_command(command) == line


@pytest.mark.parametrize("number", [nan, inf, -inf, 1.1e9])
def test_a_number_that_nobody_can_read_is_not_sent(number: float) -> None:
    with pytest.raises(ValueError, match=r"expected at most 1e\+09 in size"):
        encode_command(Drive(0, number))


@pytest.mark.parametrize("text", ["a\r\nDRIVE", "a}", "{a", "Straße", "a\tb"])
def test_a_text_cannot_smuggle_in_a_line_or_a_field(text: str) -> None:
    with pytest.raises(ValueError, match="expected printable ASCII without braces"):
        encode_command(Init("P3AT", name=text))
