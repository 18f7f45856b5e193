import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.errors import MalformedMessage
from radarsim.geometry import rotation_matrix
from radarsim.protocol.message import (
    MAX_SEGMENTS,
    Message,
    decode_message,
    flip_axes,
    parse_list,
    parse_segments,
    pose_from_wire,
)

WORDS = st.text(
    st.characters(codec="latin-1", exclude_characters="{}", exclude_categories=["C"]),
    min_size=1,
    max_size=8,
).filter(lambda text: len(text.split()) == 1 and text == text.strip())
VALUES = st.lists(WORDS, max_size=4).map(" ".join)
MESSAGES = st.builds(
    Message, WORDS, st.lists(st.tuples(WORDS, VALUES), max_size=5).map(tuple)
)


@given(message=MESSAGES)
def test_decoding_undoes_encoding(message: Message) -> None:
    assert decode_message(message.encode()) == message


@pytest.mark.parametrize(
    ("line", "segments"),
    [
        pytest.param("DRIVE", (), id="verb alone"),
        pytest.param("DRIVE {Left 1}", (("Left", "1"),), id="one group"),
        pytest.param(
            "DRIVE{Left 1}{Right 2}", (("Left", "1"), ("Right", "2")), id="}{"
        ),
        pytest.param(" DRIVE  {  Left \t 1  }  ", (("Left", "1"),), id="blanks"),
        pytest.param("DRIVE {A 1, 2 ,3}", (("A", "1, 2 ,3"),), id="blanks in a value"),
        pytest.param("DRIVE {Name }", (("Name", ""),), id="empty value"),
        pytest.param("DRIVE {Name}", (("Name", ""),), id="key alone"),
        pytest.param("DRIVE {} { } {A 1}", (("A", "1"),), id="empty groups"),
        pytest.param("DRIVE {A 1} and } {B 2}", (("A", "1"), ("B", "2")), id="between"),
    ],
)
def test_fields_are_decoded_despite_text_around_them(
    line: str, segments: tuple[tuple[str, str], ...]
) -> None:
    assert decode_message(line) == Message("DRIVE", segments)


def test_unclosed_last_segment_is_left_out_as_in_the_original() -> None:
    line = "INIT {ClassName USARBot.P2AT} {Location -8, 4, -0.3} {Rotation 0, 0, 0"
    assert decode_message(line, keeps_closed=True).segments == (
        ("ClassName", "USARBot.P2AT"),
        ("Location", "-8, 4, -0.3"),
    )
    assert decode_message("DRIVE {Left 1", keeps_closed=True).segments == ()
    assert parse_segments("{Name R1} {Class", keeps_closed=True) == (("Name", "R1"),)
    with pytest.raises(MalformedMessage, match="expected '}' to close the brace"):
        decode_message("DRIVE {A 1 {Left 1}", keeps_closed=True)


@pytest.mark.parametrize(
    ("line", "problem"),
    [
        pytest.param(
            "{Left 1}", "expected a verb at column 1 in '{Left 1}'", id="no verb"
        ),
        pytest.param(
            "DRIVE Left 1",
            "expected '{Key value}' at column 7 in 'DRIVE Left 1'",
            id="no braces",
        ),
        pytest.param(
            "DRIVE {Left 1",
            "expected '}' to close the brace at column 7 in 'DRIVE {Left 1'",
            id="open brace",
        ),
        pytest.param(
            "DRIVE {C 1} {A {B 1}}",
            "expected '}' to close the brace at column 13 in 'DRIVE {C 1} {A {B 1}}'",
            id="nested",
        ),
        pytest.param(
            "{" + "x" * 100,
            f"expected a verb at column 1 in '{{{'x' * 79}'",
            id="long line, cut",
        ),
    ],
)
def test_malformed_line_raises_an_error_with_the_column(
    line: str, problem: str
) -> None:
    with pytest.raises(MalformedMessage, match=f"^{re.escape(problem)}$"):
        decode_message(line)


def test_number_of_segments_is_limited() -> None:
    most = "DRIVE" + "{A 1}" * MAX_SEGMENTS
    assert len(decode_message(most).segments) == MAX_SEGMENTS
    text = f"{MAX_SEGMENTS + 1} segments in 'DRIVE"
    with pytest.raises(MalformedMessage, match=f"^{re.escape(text)}"):
        decode_message(most + "{")


def test_keys_match_in_any_case_and_the_first_is_used() -> None:
    message = decode_message("DRIVE {LEFT 1} {left 2} {Right 3}")
    assert message.get("Left") == "1"
    assert message.get("right") == "3"
    assert message.get("Light") is None


def test_a_line_that_only_repeats_its_type_has_no_items() -> None:
    message = decode_message("SEN {Type A} {Time 1} {Type B}")
    assert list(message.items()) == []


ANGLES = st.floats(-3, 3)


@given(numbers=st.tuples(*[st.floats(-1e3, 1e3)] * 6))
def test_pose_round_trips_over_the_wire(numbers: tuple[float, ...]) -> None:
    pose = pose_from_wire(numbers)
    x, y, z, roll, pitch, yaw = pose.numbers()
    assert (*flip_axes((x, y, z)), *flip_axes((roll, pitch, yaw))) == numbers


@pytest.mark.parametrize("text", ["-0,1.5", "1.5,-0"])
def test_zero_in_a_list_keeps_its_sign(text: str) -> None:
    wanted = [float(word) for word in text.split(",")]
    assert [str(number) for number in parse_list(text)] == [str(n) for n in wanted]


def test_zero_has_no_sign_on_the_wire() -> None:
    for number in pose_from_wire((0.0,) * 6).numbers():
        assert math.copysign(1, number) == 1


@given(roll=ANGLES, pitch=ANGLES, yaw=ANGLES)
def test_flipped_angles_give_the_rotation_in_flipped_axes(
    roll: float, pitch: float, yaw: float
) -> None:
    half_turn = np.diag([1.0, -1.0, -1.0])
    inside = rotation_matrix(roll, pitch, yaw)
    outside = rotation_matrix(*flip_axes((roll, pitch, yaw)))
    assert outside == pytest.approx(half_turn @ inside @ half_turn)
