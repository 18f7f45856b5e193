"""A server with its page in a process of its own, and a commander in a thread."""

import asyncio
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import Queue
from threading import Thread
from typing import Any

from processes import start_radarsim

from radarsim.addons.web.cli import PageOptions
from radarsim.addons.web.program import serve_page
from radarsim.simulation.config import SimulationConfig

# Tests may run as root, where there is no sandbox; 3D is drawn without a graphics card.
CHROMIUM_OPTIONS = ("--no-sandbox", "--enable-unsafe-swiftshader")
TOKEN = "a-token-of-tests-0123456789"


@dataclass(frozen=True)
class Served:
    """A commander that runs.

    Attributes:
        web: Host and port of the page.
        token: The token of the page.
        server: Host and port of the USARSim server.
    """

    web: str
    token: str
    server: tuple[str, int]

    @property
    def url(self) -> str:
        return f"http://{self.web}/#token={self.token}"


@contextmanager
def serve(*words: str) -> Iterator[Served]:
    """Serve a map and its page on free ports, and end both afterwards."""
    process = start_radarsim("serve", *words, "--port", "0", "--web", "0")
    stdout, stderr = process.stdout, process.stderr
    assert stdout is not None
    assert stderr is not None
    complaints: list[bytes] = []
    readers = [Thread(target=lambda: complaints.extend(stderr))]
    try:
        readers[0].start()
        printed = ""
        while "commander on" not in printed:
            line = stdout.readline().decode()
            assert line, f"it ended after {printed!r} with {b''.join(complaints)!r}"
            printed += line
        readers.append(Thread(target=stdout.read))
        readers[1].start()
        where = r"listening on ([\d.]+):(\d+).*commander on http://(.*)/#token=(\S+)"
        found = re.search(where, printed, re.DOTALL)
        assert found
        yield Served(found[3], found[4], (found[1], int(found[2])))
    finally:
        process.terminate()
        process.wait(240)
        for reader in readers:
            reader.join()
        stdout.close()
        stderr.close()


@contextmanager
def run_commander(
    server: tuple[str, int] | Path,
    *,
    config: SimulationConfig | None = None,
    map_: str | None = None,
    record_to: Path = Path(),
) -> Iterator[Served]:
    """Run a commander; arguments as of ``serve_page``."""
    page = PageOptions(web=0, record_to=record_to)
    begun: Queue[Any] = Queue()

    async def run() -> None:
        end = asyncio.get_running_loop().create_future()
        await serve_page(
            server,
            page,
            config or SimulationConfig(),
            token=TOKEN,
            map_=map_,
            end=end,
            announce=lambda at: begun.put((at, end)),
        )

    thread = Thread(target=asyncio.run, args=[run()], daemon=True)
    thread.start()
    (host, port), end = begun.get(timeout=240)
    yield Served(
        f"{host}:{port}", TOKEN, ("", 0) if isinstance(server, Path) else server
    )
    end.get_loop().call_soon_threadsafe(end.set_result, None)
    thread.join(240)
    assert not thread.is_alive()
