"""Messages between a turning radar of Navtech and its clients: Colossus, without I/O.

A message is a head of 22 bytes and its payload: a signature of 16 bytes, the version of
the protocol, the type, and the length of the payload, with the highest byte first.
Clients ask, with empty payloads, for the configuration, and to start or stop the data,
of which each direction is a message. Sources: what the maker publishes of its own
clients (IASDK, MIT licence); the numbers of a direction's time are sent with the lowest
byte first, as these clients read them.
"""

import struct
from enum import IntEnum
from typing import Final

SIGNATURE: Final = bytes.fromhex("0001030307070f0f1f1f3f3f7f7ffefe")
VERSION: Final = 1
MAX_REQUEST: Final = 4096  # bytes of a payload that a client may send
NANOSECONDS: Final = 1_000_000_000

_HEAD: Final = struct.Struct(">16sBBI")
_CONFIGURATION: Final = struct.Struct(">6H2f")
_PLACE: Final = struct.Struct(">3H")
_TIME: Final = struct.Struct("<2I")


class MessageType(IntEnum):
    """Types of messages; there are others, which are ignored."""

    CONFIGURATION = 10
    CONFIGURATION_REQUEST = 20
    START = 21
    STOP = 22
    DIRECTION = 30  # with counts of 8 bits


def encode_message(kind: int, payload: bytes = b"") -> bytes:
    """Return the bytes of a message of a type."""
    return _HEAD.pack(SIGNATURE, VERSION, kind, len(payload)) + payload


def configuration_message(
    azimuths: int,
    bin_size: float,
    bins: int,
    encoder_counts: int,
    rotation_hz: float,
    packet_rate: int,
) -> bytes:
    """Return what a radar tells of itself; too large numbers are the largest.

    Args:
        azimuths: Directions in a turn.
        bin_size: Distance between range bins, m, to 0.1 mm.
        bins: Range bins of a direction.
        encoder_counts: Counts of the encoder in a turn.
        rotation_hz: Turns per second, to a thousandth.
        packet_rate: Directions per second.
    """
    thousandths, tenths_mm = rotation_hz * 1e3, bin_size * 1e4
    numbers = azimuths, tenths_mm, bins, encoder_counts, thousandths, packet_rate
    # struct would raise an error for larger ones.
    limited = (min(round(number), 0xFFFF) for number in numbers)
    gain, offset = 1.0, 0.0  # of ranges: clients are to take them as they are
    payload = _CONFIGURATION.pack(*limited, gain, offset)
    return encode_message(MessageType.CONFIGURATION, payload)


def direction_message(sweep: int, encoder: int, time: int, counts: bytes) -> bytes:
    """Return what a radar received from one direction.

    Args:
        sweep: Counts directions, 0 to 65535 and from the beginning again.
        encoder: Count of the encoder, which is 0 straight ahead.
        time: When the sweep began, ns.
        counts: The power in each range bin, a byte each.
    """
    place = _PLACE.pack(_PLACE.size + _TIME.size, sweep, encoder)
    payload = place + _TIME.pack(*divmod(time, NANOSECONDS)) + counts
    return encode_message(MessageType.DIRECTION, payload)


class MessageBuffer:
    """Finds messages in what is received, in pieces of any size.

    Attributes:
        problem: Why no more messages are found; empty while they are.
    """

    def __init__(self) -> None:
        """Start without received bytes."""
        self.problem = ""
        self._received = bytearray()

    def feed(self, data: bytes) -> list[tuple[int, bytes]]:
        """Add received bytes; return types and payloads of complete messages."""
        received, messages = self._received, []
        received += data
        while received and not self.problem:
            # What cannot become the signature any more is not waited for.
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
