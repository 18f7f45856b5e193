"""A client of the protocol of Navtech's radars, written from a description of it.

It shares no code with the server and was written before its author had read the server.
What it does not expect, it refuses.
"""

import socket
import struct
from dataclasses import dataclass

SIGNATURE = bytes.fromhex("00 01 03 03 07 07 0f 0f 1f 1f 3f 3f 7f 7f fe fe")
HEAD = struct.Struct(">16sBBI")  # signature, version, type, bytes of the payload
REQUEST_CONFIGURATION, START, STOP = 20, 21, 22
CONFIGURATION, FFT_8_BIT, FFT_16_BIT = 10, 30, 31


class ProtocolError(Exception):
    """What came is no message of the protocol."""


@dataclass(frozen=True)
class Configuration:
    """The configuration that the radar sends."""

    azimuths: int  # a turn
    bin: float  # m
    bins: int
    encoder: int  # counts a turn
    turns: float  # a second
    packets: int  # a second

    @classmethod
    def parse(cls, payload: bytes) -> "Configuration":
        """Parse a payload; what follows its 20 bytes is protobuf."""
        if len(payload) < 20:
            raise ProtocolError(f"a configuration of {len(payload)} bytes")
        azimuths, tenths, bins, encoder, millihertz, packets = struct.unpack_from(
            ">6H", payload
        )
        return cls(azimuths, tenths / 10_000, bins, encoder, millihertz / 1000, packets)


@dataclass(frozen=True)
class Azimuth:
    """Power over range of one azimuth."""

    sweep: int  # counter, which starts again after 65535
    encoder: int
    seconds: int
    split: int
    counts: tuple[int, ...]

    @classmethod
    def parse(cls, kind: int, payload: bytes) -> "Azimuth":
        """Parse the payload of an FFT message of 8 or 16 bits."""
        offset, sweep, encoder = struct.unpack_from(">3H", payload)
        seconds, split = struct.unpack_from("<2I", payload, 6)
        if not 14 <= offset <= len(payload):
            raise ProtocolError(f"data at byte {offset} of {len(payload)}")
        data = payload[offset:]
        if kind == FFT_8_BIT:
            return cls(sweep, encoder, seconds, split, tuple(data))
        return cls(
            sweep, encoder, seconds, split, struct.unpack(f">{len(data) // 2}H", data)
        )


class ColossusClient:
    """A connection to a radar."""

    def __init__(self, address: tuple[str, int], timeout: float = 240.0) -> None:
        """Connect; ``timeout`` in seconds holds for each wait."""
        self.socket = socket.create_connection(address, timeout)

    def close(self) -> None:
        """Close the connection."""
        self.socket.close()

    def send(self, kind: int) -> None:
        """Send a message without payload."""
        self.socket.sendall(HEAD.pack(SIGNATURE, 1, kind, 0))

    def receive(self, *wanted: int) -> tuple[int, bytes]:
        """Return type and payload of the next message that is of a wanted type."""
        while True:
            signature, version, kind, length = HEAD.unpack(self.read(HEAD.size))
            if (signature, version) != (SIGNATURE, 1):
                raise ProtocolError(f"signature {signature.hex()}, version {version}")
            payload = self.read(length)
            if kind in wanted:
                return kind, payload

    def request_configuration(self) -> Configuration:
        """Ask for the configuration and return it."""
        self.send(REQUEST_CONFIGURATION)
        return Configuration.parse(self.receive(CONFIGURATION)[1])

    def read_azimuth(self) -> Azimuth:
        """Return the next azimuth."""
        return Azimuth.parse(*self.receive(FFT_8_BIT, FFT_16_BIT))

    def read_turn(self) -> list[Azimuth]:
        """Return the next whole turn, from straight ahead on."""
        turn = [self.read_azimuth()]
        while turn[0].encoder:
            turn = [self.read_azimuth()]
        while (azimuth := self.read_azimuth()).encoder:
            turn.append(azimuth)
        return turn

    def read(self, count: int) -> bytes:
        """Return received bytes."""
        data = b""
        while len(data) < count:
            piece = self.socket.recv(count - len(data))
            if not piece:
                raise ProtocolError(f"{len(data)} of {count} bytes, then the end")
            data += piece
        return data
