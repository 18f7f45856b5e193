"""Pictures as bytes for viewers."""

import io

import numpy as np
from PIL import Image

from radarsim.protocol.images import (
    JPEG_QUALITY,
    ImageType,
    Region,
    encode_image,
    encode_raw,
)
from radarsim.server.camera.renderer import Pixels


def encode(pixels: Pixels, region: Region, image_type: ImageType) -> bytes:
    """Return a part of a picture as it is sent to a viewer.

    Args:
        pixels: RGB, (H, W, 3).
        region: The part; as much of it as is in the picture is sent.
        image_type: Type of the picture on the wire.
    """
    height, width = pixels.shape[:2]
    x, y, width, height = region.clip(width, height)
    part = np.ascontiguousarray(pixels[y : y + height, x : x + width])
    if image_type is ImageType.RAW:
        data = encode_raw(width, height, [row[:, ::-1].tobytes() for row in part])
    else:
        data = _as_jpeg(part, JPEG_QUALITY[image_type])
    return encode_image(image_type, data)


def _as_jpeg(pixels: Pixels, quality: int) -> bytes:
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "JPEG", quality=quality)
    return file.getvalue()
