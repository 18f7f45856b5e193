"""Many robots and a client that does not read, on a server in its own process."""

import asyncio
import os
import re
import signal
import socket
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

SECONDS = float(
    os.environ.get("RADARSIM_STRESS_SECONDS")
    or (10 if os.environ.get("CI") == "true" else 60)
)
ROBOTS = 16
SCAN = re.compile(rb"SEN {Time ([0-9.]+)} {Type RangeScanner}")
LEAST_RATE = 9.5  # Hz of the wall clock, of 10
MOST_GROWTH = 4.0  # MB of memory in the second half of the run

pytestmark = [pytest.mark.slow, pytest.mark.timeout(SECONDS + 600)]


@dataclass
class Scans:
    """Simulated times and wall clock times of the scans of one client."""

    simulated: list[float] = field(default_factory=list)
    arrived: list[float] = field(default_factory=list)


@asynccontextmanager
async def server(folder: Path) -> AsyncIterator[tuple[int, asyncio.subprocess.Process]]:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "radarsim", "serve", "foliage_room", "--port", "0"),
        cwd=folder,
        stdout=asyncio.subprocess.PIPE,
    )
    assert process.stdout is not None
    try:
        line = await process.stdout.readline()
        yield int(line.decode().rpartition(":")[2]), process
    finally:
        if process.returncode is None:
            process.send_signal(signal.SIGTERM)
        await process.wait()


def init(number: int) -> bytes:
    x, y = -9.5 + 1.8 * (number % 5), -4.8 + 3.2 * (number // 5)
    return b"INIT {ClassName P3AT} {Name R%d} {Location %.1f,%.1f,0}\r\n" % (
        number,
        x,
        y,
    )


async def request_without_reading(port: int) -> None:
    """Request scans all the time and read nothing."""
    with socket.socket() as sock:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        sock.setblocking(False)
        loop = asyncio.get_running_loop()
        await loop.sock_connect(sock, ("127.0.0.1", port))
        await loop.sock_sendall(sock, init(0))
        while True:
            order = b"SET {Type RangeScanner} {Opcode SCAN}\r\n"
            await loop.sock_sendall(sock, order)
            await asyncio.sleep(0.02)


async def driver(port: int, number: int, until: float) -> Scans:
    """Drive about and record every scan."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    scans = Scans()
    writer.write(init(number))
    while time.monotonic() < until:
        line = await asyncio.wait_for(reader.readline(), 30)
        if match := SCAN.match(line):
            scans.simulated.append(float(match[1]))
            scans.arrived.append(time.monotonic())
            if len(scans.simulated) % 10 == 0:
                left, right = (
                    np.sin([len(scans.simulated), number + len(scans.simulated)]) * 5
                )
                writer.write(b"DRIVE {Left %.2f} {Right %.2f}\r\n" % (left, right))
    writer.close()
    await writer.wait_closed()
    return scans


def memory(pid: int) -> float:
    """Return the resident memory of a process, MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.usefixtures("foliage_room")  # compiled by then
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux' /proc")
async def test_client_that_does_not_read_does_not_delay_fifteen_others(
    tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    async with server(tmp_path) as (port, process):
        stopped = asyncio.create_task(request_without_reading(port))
        until = time.monotonic() + SECONDS
        running = [
            asyncio.create_task(driver(port, number, until))
            for number in range(1, ROBOTS)
        ]
        await asyncio.sleep(SECONDS / 2)
        before = memory(process.pid)
        results = await asyncio.gather(*running)
        growth = memory(process.pid) - before
        assert not stopped.done()
        stopped.cancel()
    for scans in results:
        assert np.diff(scans.simulated) == pytest.approx(0.1)  # not one is missing
        rate = (len(scans.arrived) - 1) / (scans.arrived[-1] - scans.arrived[0])
        assert rate > LEAST_RATE
    worst = max(float(np.diff(scans.arrived).max()) for scans in results)
    record_property("memory, its growth in MB and longest wait in s", (growth, worst))
    assert worst < 1
    assert growth < MOST_GROWTH
