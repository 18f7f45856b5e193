"""Pictures of a server's camera, read from its image port."""

import asyncio
import io
import struct
from collections.abc import Callable
from typing import Final

from PIL import Image

from radarsim.errors import ClientError, describe_os_error
from radarsim.protocol.images import ImageType

LARGEST: Final = 2**26  # bytes of a picture
QUALITY: Final = 75  # percent, of JPEG


def as_jpeg(image_type: int, data: bytes) -> bytes:
    """Return a picture of an image server as JPEG.

    Args:
        image_type: Its type on the wire.
        data: Its data.

    Raises:
        ValueError: If it is not as long as its size asks for.
    """
    if image_type != ImageType.RAW:
        return data
    try:
        width, height = struct.unpack_from(">2H", data)
        stride = 3 * width + -3 * width % 4  # rows begin at multiples of 4 bytes
        size = (width, height)
        pixels = Image.frombytes("RGB", size, data[4:], "raw", "BGR", stride, 1)
        file = io.BytesIO()
        pixels.save(file, "JPEG", quality=QUALITY)
    except (struct.error, ValueError, OSError) as error:
        raise ValueError(f"raw picture of {len(data)} bytes: {error}") from error
    return file.getvalue()


async def read_pictures(
    server: tuple[str, int], interval: float, take: Callable[[bytes], None]
) -> None:
    """Ask an image server for pictures until the connection is lost.

    Args:
        server: Host and port of the image server.
        interval: Time between two pictures, s.
        take: Called with each picture, as JPEG.

    Raises:
        ClientError: If it cannot be reached, closes the connection, or sends something
            else.
    """
    place = f"image port {server[0]}:{server[1]}"
    loop = asyncio.get_running_loop()
    try:
        reader, writer = await asyncio.open_connection(*server)
    except OSError as error:
        text = f"{place}: {describe_os_error(error)}"
        raise ClientError(f"{text}, expected 'radarsim serve --image-port'") from error
    try:
        while True:
            due = loop.time() + interval
            writer.write(b"OK")
            head = await reader.readexactly(5)
            image_type, size = struct.unpack(">BI", head)
            if size > LARGEST:
                raise ClientError(f"{place}: {size} bytes, expected a picture")
            take(as_jpeg(image_type, await reader.readexactly(size)))
            await asyncio.sleep(due - loop.time())
    except (OSError, asyncio.IncompleteReadError, ValueError) as error:
        raise ClientError(f"{place}: {error}, expected pictures") from error
    finally:
        writer.close()
