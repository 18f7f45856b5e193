"""CDR, the encoding of ROS 2 messages: little-endian, aligned to the size of numbers.

Source: OMG, DDS Interoperability Wire Protocol 2.5, section 10; XCDR version 1.
"""

import struct
from typing import Any, Final

from numpy.typing import NDArray

HEADER: Final = b"\x00\x01\x00\x00"  # little-endian, no options


class CdrWriter:
    """Encodes the fields of one message, one after the other."""

    def __init__(self) -> None:
        self._data = bytearray(HEADER)

    def numbers(self, code: str, *values: float) -> None:
        """Append numbers of one type.

        Args:
            code: Type of the numbers, as of ``struct``: ``B``, ``i``, ``I``, ``f`` or
                ``d``.
            values: The numbers.
        """
        self._align(struct.calcsize(f"<{code}"))
        self._data += struct.pack(f"<{len(values)}{code}", *values)

    def text(self, text: str) -> None:
        """Append a string."""
        data = text.encode() + b"\0"
        self.numbers("I", len(data))
        self._data += data

    def array(self, values: NDArray[Any]) -> None:
        """Append a sequence of unlimited length; ``values`` is little-endian, (N,)."""
        self.numbers("I", len(values))
        if len(values):
            self._align(values.itemsize)
            self._data += values.tobytes()

    def octets(self, data: bytes) -> None:
        """Append a sequence of bytes."""
        self.numbers("I", len(data))
        self._data += data

    def to_bytes(self) -> bytes:
        """Return the encoded message."""
        return bytes(self._data)

    def _align(self, size: int) -> None:
        """Fill up to a multiple of a size, counted from the end of the header."""
        self._data += bytes(-(len(self._data) - len(HEADER)) % size)
