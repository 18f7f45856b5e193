import re
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.errors import LineTooLong
from radarsim.protocol.message import LineBuffer

STREAMS = st.lists(
    st.sampled_from(
        [b"DRIVE {Left 1}", b"{", b" ", b"\r", b"\n", b"\0", b"\xff", b"GET"]
    ),
    max_size=30,
).map(b"".join)


def collect(
    chunks: list[bytes], limit: int = 65536, *, keeps_blank: bool = False
) -> tuple[list[str], bool]:
    """Feed chunks; return the lines and whether one was too long."""
    buffer = LineBuffer(limit, keeps_blank=keeps_blank)
    lines: list[str] = []
    for chunk in chunks:
        lines += buffer.feed(chunk)
        if buffer.overflow is not None:
            return lines, True
    return lines, False


def cut(stream: bytes, places: list[int]) -> list[bytes]:
    edges = [0, *sorted(place % (len(stream) + 1) for place in places), len(stream)]
    return [stream[a:b] for a, b in pairwise(edges)]


@given(
    stream=STREAMS | st.binary(max_size=80),
    cuts=st.lists(st.integers(0, 400)),
    keeps_blank=st.booleans(),
)
def test_lines_do_not_depend_on_how_the_stream_is_split(
    stream: bytes, cuts: list[int], keeps_blank: bool
) -> None:
    whole = collect([stream], keeps_blank=keeps_blank)
    assert collect(cut(stream, cuts), keeps_blank=keeps_blank) == whole


@pytest.mark.parametrize(
    ("chunks", "lines"),
    [
        ([b"\r\n"], [""]),
        ([b"\r", b"\n"], [""]),
        ([b"\r", b"", b"\n", b"\n"], ["", ""]),
        ([b"A\r\n\r\nB\n\n"], ["A", "", "B", ""]),
        ([b"A\n", b"\r", b"\n\r"], ["A", ""]),
        ([b"A\r", b"B\r\r"], ["A", "B", ""]),
        ([b" \n"], [""]),
    ],
)
def test_blank_lines_are_kept_where_they_are_asked_for(
    chunks: list[bytes], lines: list[str]
) -> None:
    assert collect(chunks, keeps_blank=True) == (lines, False)


@pytest.mark.parametrize("keeps_blank", [True, False])
@pytest.mark.parametrize(
    "before",
    [
        pytest.param([b"\xef\xbb", b"\xbf"], id="mark of UTF-8"),
        pytest.param([b"\0"], id="zero"),
        pytest.param([b"\xff\xfb\x1f\xff\xfb \xff\xfd\x01", b"\xff\xf1"], id="telnet"),
        pytest.param([b"\xff\xfa\x1f\0P\0\x18\xff\xf0"], id="size of a window"),
    ],
)
def test_what_editors_and_telnet_send_first_is_dropped(
    before: list[bytes], keeps_blank: bool
) -> None:
    chunks = [*before, b"GETPOS\n", b"\0A\0\n"]
    assert collect(chunks, keeps_blank=keeps_blank) == (["GETPOS", "A"], False)


@given(stream=STREAMS, cuts=st.lists(st.integers(0, 400)), limit=st.integers(0, 40))
def test_overflow_does_not_depend_on_how_the_stream_is_split(
    stream: bytes, cuts: list[int], limit: int
) -> None:
    assert collect(cut(stream, cuts), limit) == collect([stream], limit)


@given(stream=st.binary(max_size=200))
def test_lines_are_split_at_cr_and_lf_and_blank_ones_skipped(
    stream: bytes,
) -> None:
    blanks = "\0 \t\v\f\x1c\x1d\x1e\x1f\x85\xa0"
    parts = re.split("[\r\n]", stream.decode("latin-1"))
    lines = [line for part in parts if (line := part.strip(blanks))]
    assert collect([b"A\n", stream, b"\n"])[0] == ["A", *lines]


def test_blanks_before_a_line_do_not_count_as_its_length() -> None:
    for stream in (b" \n" * 50 + b" " * 50 + b"GET\n", b" " * 50 + b"GET\n"):
        for chunks in ([stream], cut(stream, [*range(len(stream))])):
            assert collect(chunks, limit=3) == (["GET"], False)


def test_line_one_byte_longer_than_the_limit_overflows() -> None:
    assert collect([b"x" * 65536 + b"\n"]) == (["x" * 65536], False)
    assert collect([b"x" * 65537]) == ([], True)
    assert collect([b"x" * 65537 + b"\n"]) == ([], True)


def test_lines_before_an_overlong_line_are_returned_and_none_after_it() -> None:
    buffer = LineBuffer(limit=4)
    assert buffer.feed(b"A\nB\nCCCCC\nD\n") == ["A", "B"]
    assert str(buffer.overflow) == "line of 5 bytes, expected at most 4"
    with pytest.raises(LineTooLong, match="line of 5 bytes, expected at most 4"):
        buffer.feed(b"E\n")
