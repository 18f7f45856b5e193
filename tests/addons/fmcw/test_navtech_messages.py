"""Messages of the radar's protocol, byte by byte."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.addons.fmcw.navtech_messages import (
    MAX_REQUEST,
    SIGNATURE,
    MessageBuffer,
    configuration_message,
    direction_message,
    encode_message,
)

MESSAGES = st.tuples(st.integers(0, 255), st.binary(max_size=40))
HEAD = SIGNATURE + bytes([1])  # and the version


@given(messages=st.lists(MESSAGES, max_size=5), data=st.data())
def test_messages_are_found_however_they_are_cut(
    messages: list[tuple[int, bytes]], data: st.DataObject
) -> None:
    stream = b"".join(encode_message(*message) for message in messages)
    cuts = data.draw(st.lists(st.integers(0, len(stream)), max_size=8).map(sorted))
    buffer, found = MessageBuffer(), []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        found += buffer.feed(stream[start:end])
    assert found == messages
    assert buffer.problem == ""


@given(garbage=st.binary(max_size=60), message=MESSAGES)
def test_garbage_ends_the_reading_and_raises_nothing(
    garbage: bytes, message: tuple[int, bytes]
) -> None:
    buffer = MessageBuffer()
    assert buffer.feed(encode_message(*message)) == [message]
    buffer.feed(garbage)
    if not SIGNATURE.startswith(garbage[:16]):
        assert "expected Navtech's signature" in buffer.problem
        assert buffer.feed(encode_message(*message)) == []


@pytest.mark.parametrize(
    ("version", "size", "problem"),
    [(2, 0, "version 2, expected 1"), (1, MAX_REQUEST + 1, "payload of 4097 bytes")],
)
def test_head_of_another_kind_ends_the_reading(
    version: int, size: int, problem: str
) -> None:
    buffer = MessageBuffer()
    assert buffer.feed(SIGNATURE + struct.pack(">BBI", version, 20, size)) == []
    assert problem in buffer.problem


def test_numbers_are_where_clients_look_for_them() -> None:
    payload = "019001b60eb815e00fa006403f80000000000000"
    configuration = configuration_message(400, 0.0438, 3768, 5600, 4.0, 1600)
    assert configuration == HEAD + bytes.fromhex(f"0a00000014{payload}")
    payload = "000e0102000e03000000050000001112"
    direction = direction_message(258, 14, 3_000_000_005, b"\x11\x12")
    assert direction == HEAD + bytes.fromhex(f"1e00000010{payload}")
    start = encode_message(21)
    assert start == HEAD + bytes([21, 0, 0, 0, 0])


def test_numbers_too_large_for_a_message_are_the_largest() -> None:
    coarse = configuration_message(70_000, 10.0, 3768, 5600, 4.0, 1600)
    assert struct.unpack_from(">2H", coarse, 22) == (65535, 65535)
