"""The protocol of USARSim's image server: decodes requests and encodes pictures.

A viewer requests a picture with ``OK``, or a part of it with ``U`` and four numbers of
4 bytes: x and y of the part's upper left corner, its width and its height, in pixels.
All other bytes are ignored. A picture is sent as 1 byte for its type, 4 bytes for the
length of its data, and the data. All numbers are big-endian.
"""

import struct
from enum import IntEnum
from typing import Final, NamedTuple

WIDTH, HEIGHT = 160, 120  # size of the image of one camera, pixels
_PART_BYTES: Final = 17  # length of a request for a part


class ImageType(IntEnum):
    """The supported formats of pictures, by their numbers in the original server."""

    RAW = 0
    JPEG_GOOD = 2


class Region(NamedTuple):
    """A rectangle of a picture, in pixels from its upper left corner."""

    x: int
    y: int
    width: int
    height: int

    def clip(self, width: int, height: int) -> "Region":
        """Clip the region to a picture; if nothing remains, return the whole picture.

        Args:
            width: Width of the picture.
            height: Height of the picture.
        """
        right, lower = (
            min(self.x + self.width, width),
            min(self.y + self.height, height),
        )
        if right <= self.x or lower <= self.y:
            return Region(0, 0, width, height)
        return Region(self.x, self.y, right - self.x, lower - self.y)


WHOLE: Final = Region(0, 0, 2**32 - 1, 2**32 - 1)


class RequestBuffer:
    """Finds requests for pictures in the byte stream from an image viewer."""

    def __init__(self) -> None:
        self._received = b""

    def feed(self, data: bytes) -> None:
        """Append bytes received from the viewer."""
        self._received += data

    def take(self) -> Region | None:
        """Remove the next request and return its region; None if none is complete."""
        whole, part = self._received.find(b"OK"), self._received.find(b"U")
        if part >= 0 and not 0 <= whole < part:
            return self._take_part(part)
        if whole >= 0:
            self._received = self._received[whole + 2 :]
            return WHOLE
        # Only an "O" at the end can begin a request "OK". All other bytes are dropped,
        # so that invalid data cannot fill the memory.
        self._received = b"O" if self._received.endswith(b"O") else b""
        return None

    def _take_part(self, start: int) -> Region | None:
        """Remove a request for a part of the picture; None if it is incomplete."""
        request = self._received[start : start + _PART_BYTES]
        if len(request) < _PART_BYTES:
            self._received = request
            return None
        self._received = self._received[start + _PART_BYTES :]
        return Region(*struct.unpack(">4I", request[1:]))


def encode_image(image_type: ImageType, data: bytes) -> bytes:
    """Return picture data with a header of type and length in bytes."""
    return struct.pack(">BI", image_type, len(data)) + data


def encode_raw(width: int, height: int, rows: list[bytes]) -> bytes:
    """Return the data of an uncompressed picture, for ``encode_image``.

    Args:
        width: Width in pixels.
        height: Height in pixels.
        rows: Pixels of each row from the top, blue, green and red, without padding.
    """
    # The original server sends a Windows bitmap, in which each row is padded with zeros
    # to a multiple of 4 bytes.
    padding = bytes(-3 * width % 4)
    return struct.pack(">2H", width, height) + b"".join(row + padding for row in rows)
