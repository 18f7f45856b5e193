"""Clients of the benchmarks, also as processes of their own.

``python -m radarsim.lab.bench.clients drive HOST PORT`` drives robots in circles in the
hall. It reads lines with a number of robots and a duration in s: it connects clients
until there are so many robots, lets all of them drive, and then measures for that time.
It answers each line with one: a JSON list of the delays of all scans, s.

``python -m radarsim.lab.bench.clients flood HOST PORT CLIENTS ROBOTS LINE`` floods a
server as fast as it can: so many clients repeat a line, the first ones of which have
robots in an empty room. It writes ``ready`` when they are connected, floods after it
has read a line, and goes on until it is killed.
"""

import json
import os
import re
import selectors
import socket
import sys
import time

from radarsim.lab.bench import robots
from radarsim.listening import raise_file_limit

SPAWN_SECONDS = 30.0  # of which an idle machine needs one for 250 robots
SETTLE_SECONDS = 0.5  # until a backlog has been read
MAX_FILES = 4096
REPETITIONS = 1000  # of the line in what is passed to a socket at once
NICENESS = 5  # the flood comes over a network, and takes no core from the server
FIRST_PLACE = 20  # of robots; those before it are for clients that do not flood
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


def drive(address: tuple[str, int]) -> None:
    """Drive and measure until stdin ends."""
    # A thousand clients need more files than many systems permit by default.
    raise_file_limit(MAX_FILES)
    sockets: list[socket.socket] = []
    for line in sys.stdin:
        count, seconds = line.split()
        added = range(len(sockets), int(count))
        for number in added:
            sockets.append(connect(address))
            sockets[-1].sendall(robots.init_line(number))
        wait_for_robots([sockets[number] for number in added], SPAWN_SECONDS)
        for number in added:
            sockets[number].sendall(robots.drive_line(number))
        # The delays of what waited while robots spawned would count otherwise.
        listen(sockets, SETTLE_SECONDS)
        sys.stdout.write(json.dumps(listen(sockets, float(seconds))) + "\n")
        sys.stdout.flush()


def flood(address: tuple[str, int], count: int, with_robots: int, line: str) -> None:
    """Send a line again and again on all sockets, and read what comes, until killed."""
    os.nice(NICENESS)
    sockets = [
        spawn(address, FIRST_PLACE + number)
        if number < with_robots
        else connect(address)
        for number in range(count)
    ]
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    sys.stdin.readline()
    data = (line + "\r\n").encode() * REPETITIONS
    rest = [data] * len(sockets)  # a socket may take a part, even of a line
    with selectors.DefaultSelector() as selector:
        for index, sock in enumerate(sockets):
            events = selectors.EVENT_READ | selectors.EVENT_WRITE
            selector.register(sock, events, index)
        while True:
            for key, ready in selector.select():
                index = key.data
                if ready & selectors.EVENT_READ:
                    sockets[index].recv(65536)
                if ready & selectors.EVENT_WRITE:
                    sent = sockets[index].send(rest[index])
                    rest[index] = rest[index][sent:] or data


def main() -> None:
    """Drive or flood, as the arguments say."""
    what, host, port, *words = sys.argv[1:]
    if what == "drive":
        drive((host, int(port)))
    else:
        clients, with_robots, line = words
        flood((host, int(port)), int(clients), int(with_robots), line)


if __name__ == "__main__":
    main()
