"""Clients that flood a server as fast as they can, in a process of their own.

The arguments are host, port, number of clients, number of those with robots, and the
line that all repeat. The process writes ``ready`` when the clients are connected,
floods after it has read a line, and goes on until it is killed.
"""

import os
import selectors
import socket
import sys

from radarsim.benchmark.clients import connect, spawn

REPETITIONS = 1000  # of the line in what is passed to a socket at once
NICENESS = 5  # the flood comes over a network, and takes no core from the server
FIRST_PLACE = 20  # of robots; those before it are for clients that do not flood


def main() -> None:
    """Flood until killed."""
    host, port, count, robots, line = sys.argv[1:]
    address = (host, int(port))
    os.nice(NICENESS)
    sockets = [
        spawn(address, FIRST_PLACE + number)
        if number < int(robots)
        else connect(address)
        for number in range(int(count))
    ]
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    sys.stdin.readline()
    _flood(sockets, (line + "\r\n").encode() * REPETITIONS)


def _flood(sockets: list[socket.socket], data: bytes) -> None:
    """Send the data again and again on all sockets, and read what comes."""
    rest = dict.fromkeys(sockets, data)
    with selectors.DefaultSelector() as selector:
        for sock in sockets:
            selector.register(sock, selectors.EVENT_READ | selectors.EVENT_WRITE)
        while True:
            for key, events in selector.select():
                sock: socket.socket = key.fileobj  # type: ignore[assignment]
                if events & selectors.EVENT_READ:
                    sock.recv(65536)
                if events & selectors.EVENT_WRITE:
                    rest[sock] = rest[sock][sock.send(rest[sock]) :] or data


if __name__ == "__main__":
    main()
