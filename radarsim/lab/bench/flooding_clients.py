"""Clients that flood a server as fast as they can, in a process of their own.

The arguments are host, port, number of clients, number of those with robots, and the
line that all repeat. The process writes ``ready`` when the clients are connected,
floods after it has read a line, and goes on until it is killed.
"""

import os
import selectors
import socket
import sys

from radarsim.lab.bench.clients import connect, spawn

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
    rest = [data] * len(sockets)
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


if __name__ == "__main__":
    main()
