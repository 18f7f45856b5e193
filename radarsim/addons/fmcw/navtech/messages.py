"""Messages between a turning radar and its clients.

A message is a head of 22 bytes and its payload: a signature of 16 bytes, the version of
the protocol, the type, and the length of the payload, with the highest byte first.
Clients ask, with empty payloads, for the configuration, and to start or stop the data,
of which each direction is a message. Sources: what the maker publishes of its own
clients (IASDK, MIT licence); the numbers of a direction's time are sent with the lowest
byte first, as these clients read them.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple, Self

from radarsim.errors import MalformedMessage

SIGNATURE: Final = bytes.fromhex("0001030307070f0f1f1f3f3f7f7ffefe")
VERSION: Final = 1
MAX_REQUEST: Final = 4096  # bytes of a payload that a client may send
NANOSECONDS: Final = 1_000_000_000

_HEAD: Final = struct.Struct(">16sBBI")
_CONFIGURATION: Final = struct.Struct(">6H2f")
_PLACE: Final = struct.Struct(">3H")
_TIME: Final = struct.Struct("<2I")
_DATA_OFFSET: Final = _PLACE.size + _TIME.size


class MessageType(IntEnum):
    """Types of messages; there are others, which are ignored."""

    CONFIGURATION = 10
    CONFIGURATION_REQUEST = 20
    START = 21
    STOP = 22
    DIRECTION = 30  # with counts of 8 bits


class Message(NamedTuple):
    """One message.

    Attributes:
        type: Number of its type.
        payload: What follows its head.
    """

    type: int
    payload: bytes = b""

    def encode(self) -> bytes:
        """Return the bytes of the message."""
        head = _HEAD.pack(SIGNATURE, VERSION, self.type, len(self.payload))
        return head + self.payload


@dataclass(frozen=True, slots=True)
class RadarConfiguration:
    """What a radar tells of itself.

    Attributes:
        azimuths: Directions in a turn.
        bin_size: Distance between range bins, m, to 0.1 mm.
        bins: Range bins of a direction.
        encoder_counts: Counts of the encoder in a turn.
        rotation_hz: Turns per second, to a thousandth.
        packet_rate: Directions per second.
        range_gain: Factor of ranges.
        range_offset: What is added to ranges, m.
    """

    azimuths: int
    bin_size: float
    bins: int
    encoder_counts: int
    rotation_hz: float
    packet_rate: int
    range_gain: float = 1.0
    range_offset: float = 0.0

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Read the payload of a message; what follows these numbers is ignored.

        Raises:
            MalformedMessage: If it is too short.
        """
        if len(payload) < _CONFIGURATION.size:
            raise _too_short("configuration", payload, _CONFIGURATION.size)
        azimuths, bin_size, bins, encoder, rotation, rate, gain, offset = (
            _CONFIGURATION.unpack_from(payload)
        )
        return cls(
            azimuths,
            bin_size / 1e4,
            bins,
            encoder,
            rotation / 1e3,
            rate,
            gain,
            offset,
        )

    def encode(self) -> bytes:
        """Return the payload of a message; numbers too large for it are the largest."""
        whole = (
            self.azimuths,
            self.bin_size * 1e4,
            self.bins,
            self.encoder_counts,
            self.rotation_hz * 1e3,
            self.packet_rate,
        )
        limited = (min(round(number), 0xFFFF) for number in whole)
        return _CONFIGURATION.pack(*limited, self.range_gain, self.range_offset)


@dataclass(frozen=True, slots=True)
class Direction:
    """What a radar received from one direction.

    Attributes:
        sweep: Counts directions, 0 to 65535 and from the beginning again.
        encoder: Count of the encoder, which is 0 straight ahead.
        time: When the sweep began, ns.
        counts: The power in each range bin, a byte each.
    """

    sweep: int
    encoder: int
    time: int
    counts: bytes

    @classmethod
    def decode(cls, payload: bytes) -> Self:
        """Read the payload of a message.

        Raises:
            MalformedMessage: If it is too short.
        """
        if len(payload) < _DATA_OFFSET:
            raise _too_short("direction", payload, _DATA_OFFSET)
        start, sweep, encoder = _PLACE.unpack_from(payload)
        seconds, split = _TIME.unpack_from(payload, _PLACE.size)
        return cls(sweep, encoder, seconds * NANOSECONDS + split, payload[start:])

    def encode(self) -> bytes:
        """Return the payload of a message."""
        place = _PLACE.pack(_DATA_OFFSET, self.sweep, self.encoder)
        return place + _TIME.pack(*divmod(self.time, NANOSECONDS)) + self.counts


class MessageBuffer:
    """Finds messages in what is received, in pieces of any size.

    Attributes:
        problem: Why no more messages are found; empty while they are.
    """

    def __init__(self, limit: int = MAX_REQUEST) -> None:
        """Start without received bytes.

        Args:
            limit: Longest payload that is taken, bytes.
        """
        self.problem = ""
        self._limit = limit
        self._received = bytearray()

    def feed(self, data: bytes) -> list[Message]:
        """Add received bytes, and return the messages that they complete."""
        self._received += data
        messages = []
        while not self.problem and (message := self._take()) is not None:
            messages.append(message)
        if self.problem:
            self._received.clear()
        return messages

    def _take(self) -> Message | None:
        """Remove the next message; None if it is not complete, or not one at all."""
        received = self._received
        if not SIGNATURE.startswith(received[: len(SIGNATURE)]):
            self.problem = f"{bytes(received[:16])!r}, expected the signature"
        if len(received) < _HEAD.size or self.problem:
            return None
        _, version, kind, size = _HEAD.unpack_from(received)
        if version != VERSION:
            self.problem = f"version {version}, expected {VERSION}"
        elif size > self._limit:
            self.problem = f"payload of {size} bytes, expected at most {self._limit}"
        end = _HEAD.size + size
        if self.problem or len(received) < end:
            return None
        payload = bytes(received[_HEAD.size : end])
        del received[:end]
        return Message(kind, payload)


def _too_short(what: str, payload: bytes, expected: int) -> MalformedMessage:
    return MalformedMessage(
        f"{what} of {len(payload)} bytes, expected at least {expected}"
    )
