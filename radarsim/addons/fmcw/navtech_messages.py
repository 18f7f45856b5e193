"""Messages of the Colossus protocol between a Navtech radar and its clients.

This module does no I/O. A message is a header of 22 bytes and a payload. The header has
a signature of 16 bytes, the protocol version, the message type, and the length of the
payload, all big-endian. Clients send messages without payload to request the
configuration, or to start or stop the data, which is sent as a message per azimuth. The
time of an azimuth is little-endian, as the maker's clients expect it. Source: the
client code that the maker publishes (IASDK, MIT licence).
"""

import struct
from enum import IntEnum
from typing import Final

SIGNATURE: Final = bytes.fromhex("0001030307070f0f1f1f3f3f7f7ffefe")
VERSION: Final = 1
MAX_REQUEST: Final = 4096  # maximum payload of a message from a client, bytes
NANOSECONDS: Final = 1_000_000_000

_HEAD: Final = struct.Struct(">16sBBI")
_CONFIGURATION: Final = struct.Struct(">6H2f")
_PLACE: Final = struct.Struct(">3H")
_TIME: Final = struct.Struct("<2I")


class MessageType(IntEnum):
    """Types of messages; messages of other types are ignored."""

    CONFIGURATION = 10
    CONFIGURATION_REQUEST = 20
    START = 21
    STOP = 22
    DIRECTION = 30  # data of an azimuth, with counts of 8 bits


def encode_message(kind: int, payload: bytes = b"") -> bytes:
    """Return the bytes of a message with a type and a payload."""
    return _HEAD.pack(SIGNATURE, VERSION, kind, len(payload)) + payload


def configuration_message(
    azimuths: int,
    bin_size: float,
    bins: int,
    encoder_counts: int,
    rotation_hz: float,
    packet_rate: int,
) -> bytes:
    """Return the message with a radar's configuration; numbers are limited to 16 bits.

    Args:
        azimuths: Number of azimuths per revolution.
        bin_size: Distance between range bins, m; sent in units of 0.1 mm.
        bins: Number of range bins of an azimuth.
        encoder_counts: Encoder counts per revolution.
        rotation_hz: Revolutions per second; sent in thousandths.
        packet_rate: Azimuths per second.
    """
    thousandths, tenths_mm = rotation_hz * 1e3, bin_size * 1e4
    numbers = azimuths, tenths_mm, bins, encoder_counts, thousandths, packet_rate
    # Numbers are limited, since ``struct`` raises an error for larger numbers.
    limited = (min(round(number), 0xFFFF) for number in numbers)
    gain, offset = 1.0, 0.0  # correction of ranges; these values change nothing
    payload = _CONFIGURATION.pack(*limited, gain, offset)
    return encode_message(MessageType.CONFIGURATION, payload)


def direction_message(sweep: int, encoder: int, time: int, counts: bytes) -> bytes:
    """Return the bytes of the message with the data of one azimuth.

    Args:
        sweep: Counter of azimuths, 0 to 65535, which wraps around.
        encoder: Encoder count, 0 straight ahead.
        time: Time at which the sweep began, ns.
        counts: The power in each range bin, a byte each.
    """
    place = _PLACE.pack(_PLACE.size + _TIME.size, sweep, encoder)
    payload = place + _TIME.pack(*divmod(time, NANOSECONDS)) + counts
    return encode_message(MessageType.DIRECTION, payload)


class MessageBuffer:
    """Splits a stream of received bytes into messages.

    Attributes:
        problem: The error that stopped the buffer; empty while there is none.
    """

    def __init__(self) -> None:
        """Create a buffer without received bytes."""
        self.problem = ""
        self._received = bytearray()

    def feed(self, data: bytes) -> list[tuple[int, bytes]]:
        """Add received bytes; return the type and payload of each complete message."""
        received, messages = self._received, []
        received += data
        while received and not self.problem:
            # An error is reported as soon as the first bytes differ from the signature.
            if not SIGNATURE.startswith(received[: len(SIGNATURE)]):
                self.problem = f"{bytes(received[:16])!r}, expected Navtech's signature"
                break
            if len(received) < _HEAD.size:
                break
            _, version, kind, size = _HEAD.unpack_from(received)
            end = _HEAD.size + size
            if version != VERSION:
                self.problem = f"version {version}, expected {VERSION}"
            elif size > MAX_REQUEST:
                text = f"payload of {size} bytes, expected at most {MAX_REQUEST}"
                self.problem = text
            elif len(received) < end:
                break
            else:
                messages.append((kind, bytes(received[_HEAD.size : end])))
                del received[:end]
        if self.problem:
            received.clear()
        return messages
