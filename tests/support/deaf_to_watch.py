"""A server that knows no WATCH: radarsim behind a connection that leaves it out."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress


@contextmanager
def without_watch(server: tuple[str, int]) -> Iterator[tuple[str, int]]:
    """Pass on connections to a server, without the lines that watch."""
    with socket.create_server(("127.0.0.1", 0)) as listening:
        threading.Thread(target=_accept, args=(listening, server), daemon=True).start()
        yield listening.getsockname()[:2]
        listening.shutdown(socket.SHUT_RDWR)


def _accept(listening: socket.socket, server: tuple[str, int]) -> None:
    with suppress(OSError):  # it is closed
        while True:
            client, _ = listening.accept()
            threading.Thread(target=_serve, args=(client, server), daemon=True).start()


def _serve(client: socket.socket, server: tuple[str, int]) -> None:
    with client, socket.create_connection(server) as other:
        back = threading.Thread(target=_pass_on, args=(other, client, False))
        back.start()
        _pass_on(client, other, True)
        back.join()


def _pass_on(source: socket.socket, target: socket.socket, filters: bool) -> None:
    with suppress(OSError), source.makefile("rb") as lines:
        for line in lines:
            if not (filters and line.startswith(b"WATCH")):
                target.sendall(line)
    for each in (source, target):
        with suppress(OSError):
            each.shutdown(socket.SHUT_RDWR)
