"""Clients of the benchmarks, with robots in rows in an empty room."""

import re
import selectors
import socket
import time

SCAN = re.compile(rb"SEN \{Time ([0-9.]+)\} \{Type RangeScanner\}")


def connect(address: tuple[str, int]) -> socket.socket:
    """Connect a client; its socket does not block."""
    sock = socket.create_connection(address, timeout=10)
    sock.setblocking(False)
    return sock


def spawn(address: tuple[str, int], number: int) -> socket.socket:
    """Connect a client with a robot at the place of its number, up to 200."""
    sock = connect(address)
    sock.sendall(init_line(number))
    return sock


def init_line(number: int) -> bytes:
    """Return the line that spawns a robot at the place of its number, up to 200."""
    row, column = divmod(number, 20)
    place = f"{-9 + 0.95 * column:.2f},{-5 + 1.0 * row:.2f},0"
    text = f"INIT {{ClassName USARBot.P3AT}} {{Name R{number}}} {{Location {place}}}"
    return f"{text}\r\n".encode()


def wait_for_robots(sockets: list[socket.socket], seconds: float) -> None:
    """Read from clients that have sent INIT until all have robots, or time is up."""
    with selectors.DefaultSelector() as selector:
        for sock in sockets:
            selector.register(sock, selectors.EVENT_READ)
        end = time.monotonic() + seconds
        while selector.get_map() and (now := time.monotonic()) < end:
            for key, _ in selector.select(end - now):
                if b"STA {" in key.fileobj.recv(65536):  # type: ignore[union-attr]
                    selector.unregister(key.fileobj)


def listen(sockets: list[socket.socket], seconds: float) -> list[float]:
    """Read from all sockets for a while; return the delay of each scan, s.

    The delay is the time of arrival less the simulated time, up to a constant.
    """
    delays = []
    with selectors.DefaultSelector() as selector:
        for sock in sockets:
            selector.register(sock, selectors.EVENT_READ)
        end = time.monotonic() + seconds
        while (now := time.monotonic()) < end:
            for key, _ in selector.select(end - now):
                data = key.fileobj.recv(65536)  # type: ignore[union-attr]
                arrived = time.monotonic()
                delays += [arrived - float(text) for text in SCAN.findall(data)]
    return delays
