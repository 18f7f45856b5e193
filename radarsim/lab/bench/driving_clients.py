"""Clients that drive robots in circles, in a process of their own.

The arguments are host and port of a server of the hall. The process reads lines with a
number of robots and a duration in s: it connects clients until there are so many
robots, lets all of them drive, and then measures for that time. It answers each line
with one: a JSON list of the delays of all scans, s.
"""

import json
import socket
import sys

from radarsim.lab.bench.clients import connect, listen, wait_for_robots
from radarsim.lab.bench.robots import drive_line, init_line
from radarsim.server.open_files import raise_file_limit

SPAWN_SECONDS = 30.0  # of which an idle machine needs one for 250 robots
SETTLE_SECONDS = 0.5  # until a backlog has been read
MAX_FILES = 4096


def main() -> None:
    """Drive and measure until stdin ends."""
    host, port = sys.argv[1:]
    raise_file_limit(MAX_FILES)
    sockets: list[socket.socket] = []
    for line in sys.stdin:
        count, seconds = line.split()
        _drive(sockets, (host, int(port)), int(count))
        sys.stdout.write(json.dumps(listen(sockets, float(seconds))) + "\n")
        sys.stdout.flush()


def _drive(sockets: list[socket.socket], address: tuple[str, int], count: int) -> None:
    """Connect until there are so many clients, and let their robots drive."""
    added = range(len(sockets), count)
    for number in added:
        sockets.append(connect(address))
        sockets[-1].sendall(init_line(number))
    wait_for_robots([sockets[number] for number in added], SPAWN_SECONDS)
    for number in added:
        sockets[number].sendall(drive_line(number))
    listen(sockets, SETTLE_SECONDS)


if __name__ == "__main__":
    main()
