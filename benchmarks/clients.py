"""Clients that drive robots in the hall: ``python -m benchmarks.clients HOST PORT``.

The program reads lines with a number of robots and a duration in s. It connects clients
until there are so many robots, lets all of them drive, and measures for that time. It
answers each line with a JSON list of the delays of all scans, s.
"""

import json
import re
import selectors
import socket
import sys
import time

from benchmarks.scenes import drive_line, init_line
from radarsim.listening import raise_file_limit

SPAWN_SECONDS = 30.0  # an idle machine needs one for 250 robots
SETTLE_SECONDS = 0.5  # until a backlog has been read
MAX_FILES = 4096  # a thousand clients need more than many systems permit by default
SCAN = re.compile(rb"SEN \{Time ([0-9.]+)\} \{Type RangeScanner\}")


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


def main() -> None:
    """Drive and measure until stdin ends."""
    address = sys.argv[1], int(sys.argv[2])
    raise_file_limit(MAX_FILES)
    sockets: list[socket.socket] = []
    for line in sys.stdin:
        count, seconds = line.split()
        added = range(len(sockets), int(count))
        for number in added:
            sockets.append(socket.create_connection(address, timeout=10))
            sockets[-1].setblocking(False)
            sockets[-1].sendall(init_line(number))
        wait_for_robots([sockets[number] for number in added], SPAWN_SECONDS)
        for number in added:
            sockets[number].sendall(drive_line(number))
        # The delays of what waited while robots spawned would count otherwise.
        listen(sockets, SETTLE_SECONDS)
        sys.stdout.write(json.dumps(listen(sockets, float(seconds))) + "\n")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
