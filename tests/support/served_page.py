"""A server with its page, in a process of its own."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Thread

from processes import start_radarsim

# Tests may run as root, where there is no sandbox; 3D is drawn without a graphics card.
CHROMIUM_OPTIONS = ("--no-sandbox", "--enable-unsafe-swiftshader")


@dataclass(frozen=True)
class Served:
    """A running server with its page."""

    address: tuple[str, int]
    url: str


@contextmanager
def serve(*words: str) -> Iterator[Served]:
    """Serve a map and its page on free ports, and end both afterwards."""
    words = ("serve", *words, "--port", "0", "--web", "0")
    process = start_radarsim(*words)
    stdout, stderr = process.stdout, process.stderr
    assert stdout is not None
    assert stderr is not None
    complaints: list[bytes] = []
    readers = [Thread(target=lambda: complaints.extend(stderr))]
    try:
        readers[0].start()
        told = ""
        while "commander on" not in told:
            line = stdout.readline().decode()
            assert line, f"it ended after {told!r} with {b''.join(complaints)!r}"
            told += line
        readers.append(Thread(target=stdout.read))
        readers[1].start()
        yield Served(_read_address(told), _read_url(told))
    finally:
        process.terminate()
        process.wait(240)
        for reader in readers:
            reader.join()
        stdout.close()
        stderr.close()


def _read_address(told: str) -> tuple[str, int]:
    address = re.search(r"listening on ([\d.]+):(\d+)", told)
    assert address
    return address[1], int(address[2])


def _read_url(told: str) -> str:
    url = re.search(r"commander on (\S+)", told)
    assert url
    return url[1]
