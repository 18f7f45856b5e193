"""Requests of viewers, and pictures on the wire."""

import pytest

from radarsim.protocol.images import (
    WHOLE,
    ImageType,
    Region,
    RequestBuffer,
    encode_image,
    encode_raw,
)

PART = b"U" + bytes([0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 1, 0, 0, 0, 0, 4])
PART_REGION = Region(1, 2, 256, 4)
# A part whose numbers read like requests.
TRAP = b"U" + b"OKOKUUUUOKOKOKOK"
TRAP_REGION = Region(0x4F4B4F4B, 0x55555555, 0x4F4B4F4B, 0x4F4B4F4B)


def taken(buffer: RequestBuffer) -> list[Region]:
    found = []
    while (region := buffer.take()) is not None:
        found.append(region)
    return found


@pytest.mark.parametrize(
    ("data", "regions"),
    [
        pytest.param(b"OK", [WHOLE], id="whole"),
        pytest.param(PART, [PART_REGION], id="part"),
        pytest.param(b"OK" + PART + b"OK", [WHOLE, PART_REGION, WHOLE], id="several"),
        pytest.param(TRAP + b"OK", [TRAP_REGION, WHOLE], id="numbers like requests"),
        pytest.param(b"OK\r\nOK\r\n", [WHOLE, WHOLE], id="lines"),
        pytest.param(b"OOK", [WHOLE], id="doubled letter"),
        pytest.param(b"ok K\xff\x00O\nK GET / HTTP/1.1\r\n", [], id="garbage"),
        pytest.param(b"", [], id="nothing"),
    ],
)
@pytest.mark.parametrize("size", [1, 3, 100])
def test_requests_are_found_in_pieces_of_any_size(
    data: bytes, regions: list[Region], size: int
) -> None:
    buffer, found = RequestBuffer(), []
    for start in range(0, len(data), size):
        buffer.feed(data[start : start + size])
        found += taken(buffer)
    assert found == regions


def test_requests_wait_until_they_are_taken() -> None:
    buffer = RequestBuffer()
    buffer.feed(b"OK" + PART)
    assert buffer.take() == WHOLE
    buffer.feed(b"OK")
    assert taken(buffer) == [PART_REGION, WHOLE]


@pytest.mark.parametrize(
    ("region", "clipped"),
    [
        pytest.param(WHOLE, (0, 0, 160, 120), id="whole"),
        pytest.param(Region(10, 20, 30, 40), (10, 20, 30, 40), id="inside"),
        pytest.param(Region(150, 100, 320, 240), (150, 100, 10, 20), id="overlapping"),
        pytest.param(Region(160, 0, 5, 5), (0, 0, 160, 120), id="to the right"),
        pytest.param(Region(0, 120, 5, 5), (0, 0, 160, 120), id="below"),
        pytest.param(Region(5, 5, 0, 9), (0, 0, 160, 120), id="without width"),
    ],
)
def test_region_is_clipped_and_one_outside_is_the_whole_picture(
    region: Region, clipped: tuple[int, int, int, int]
) -> None:
    assert region.clip(160, 120) == clipped


def test_picture_has_a_header_of_type_and_length() -> None:
    assert encode_image(ImageType.JPEG_GOOD, b"abc") == b"\x02\x00\x00\x00\x03abc"


@pytest.mark.parametrize(
    ("width", "rows", "data"),
    [
        pytest.param(4, [b"a" * 12], b"a" * 12, id="full rows"),
        pytest.param(
            3, [b"a" * 9, b"b" * 9], b"a" * 9 + bytes(3) + b"b" * 9 + bytes(3)
        ),
        pytest.param(1, [b"abc"], b"abc\x00", id="one pixel"),
    ],
)
def test_raw_picture_has_its_size_and_padded_rows(
    width: int, rows: list[bytes], data: bytes
) -> None:
    head = bytes([0, width, 0, len(rows)])
    assert encode_raw(width, len(rows), rows) == head + data
