"""A client of the radar's protocol, written before the server from facts alone.

It shares no code with radarsim: whatever it reads, another program can read as well.
"""

import socket
import struct
from dataclasses import dataclass

SIGNATURE = bytes.fromhex("0001030307070f0f1f1f3f3f7f7ffefe")
CONFIGURATION, REQUEST, START, STOP, FFT = 10, 20, 21, 22, 30


@dataclass
class Row:
    """What one direction brought."""

    sweep: int
    encoder: int
    time: float
    counts: bytes


class ReadingClient:
    """Connects, asks for the configuration, and reads directions."""

    def __init__(self, address: tuple[str, int]) -> None:
        self._socket = socket.create_connection(address, timeout=240)

    def close(self) -> None:
        self._socket.close()

    def send(self, kind: int) -> None:
        self._socket.sendall(SIGNATURE + struct.pack(">BBI", 1, kind, 0))

    def _read(self, count: int) -> bytes:
        data = b""
        while len(data) < count:
            piece = self._socket.recv(count - len(data))
            if not piece:
                raise EOFError
            data += piece
        return data

    def message(self, wanted: int) -> bytes:
        """Return the payload of the next message of a type."""
        while True:
            head = self._read(22)
            assert head[:16] == SIGNATURE
            version, kind, size = struct.unpack(">BBI", head[16:])
            assert version == 1
            payload = self._read(size)
            if kind == wanted:
                return payload

    def configuration(self) -> tuple[int, ...]:
        """Return azimuths, bin in 0.1 mm, bins, encoder, mHz, packets a second."""
        self.send(REQUEST)
        return struct.unpack(">6H", self.message(CONFIGURATION)[:12])

    def row(self) -> Row:
        payload = self.message(FFT)
        offset, sweep, encoder = struct.unpack(">3H", payload[:6])
        seconds, split = struct.unpack("<2I", payload[6:14])
        assert offset == 14
        return Row(sweep, encoder, seconds + split * 1e-9, payload[offset:])
