"""Pictures as bytes, as a viewer that knows only the protocol decodes them."""

import io
import struct

import numpy as np
import pytest
from PIL import Image

from radarsim.protocol.images import WHOLE, ImageType, Region
from radarsim.server.camera import Pixels, encode

# A red, a green and a blue corner.
PIXELS: Pixels = np.zeros((12, 18, 3), np.uint8)
PIXELS[:6, :9] = 250, 0, 0
PIXELS[:6, 9:] = 0, 250, 0
PIXELS[6:, :9] = 0, 0, 250


def data_of(picture: bytes, image_type: int) -> bytes:
    """Check the header of a picture, and return its data."""
    type_, length = struct.unpack(">BI", picture[:5])
    assert type_ == image_type
    assert length == len(picture) - 5
    return picture[5:]


@pytest.mark.parametrize("region", [WHOLE, Region(0, 0, 320, 240), Region(99, 0, 1, 1)])
def test_raw_picture_has_its_size_and_blue_green_red_from_the_top(
    region: Region,
) -> None:
    data = data_of(encode(PIXELS, region, ImageType.RAW), 0)
    width, height = struct.unpack(">2H", data[:4])
    assert (width, height) == (18, 12)
    rows = np.frombuffer(data[4:], np.uint8).reshape(
        12, 56
    )  # 54 bytes and 2 of padding
    assert (rows[:, :54].reshape(12, 18, 3)[..., ::-1] == PIXELS).all()


def test_part_of_a_raw_picture_has_the_pixels_of_that_part() -> None:
    data = data_of(encode(PIXELS, Region(8, 5, 2, 2), ImageType.RAW), 0)
    assert data[:4] == bytes([0, 2, 0, 2])
    assert data[4:10] == bytes([0, 0, 250, 0, 250, 0])
    assert data[12:18] == bytes([250, 0, 0, 0, 0, 0])


def test_jpeg_looks_like_the_picture() -> None:
    large = PIXELS.repeat(8, axis=0).repeat(8, axis=1)
    data = data_of(encode(large, WHOLE, ImageType.JPEG_GOOD), 2)
    with Image.open(io.BytesIO(data)) as image:
        assert image.format == "JPEG"
        assert image.size == (144, 96)
        decoded = np.asarray(image, float)
    assert np.abs(decoded - large).mean() < 12
