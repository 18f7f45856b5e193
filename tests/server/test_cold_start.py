"""A server on a machine on which nothing is compiled yet."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from radarsim.cli.serve import WAIT_FOR_ENGINE
from radarsim.kernel_cache import COMPLETE

GREETING = b"NFO {Gametype BotDeathMatch} {Level DM-EmptyRoom} {TimeLimit 0}\r\n"
INIT = b"INIT {ClassName USARBot.P3AT} {Start RobotStart1}\r\n"
LINES = (
    f"radarsim: {WAIT_FOR_ENGINE}\n",
    "radarsim: compiling the ray engine, once on this machine\n",
)
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


@contextmanager
def serving(cache: Path) -> "Iterator[subprocess.Popen[str]]":
    environment = {k: v for k, v in os.environ.items() if not k.startswith("COVERAGE")}
    with subprocess.Popen(
        (sys.executable, "-m", "radarsim", "serve", "empty_room", "--port", "0"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**environment, "NUMBA_CACHE_DIR": str(cache)},
    ) as process:
        try:
            yield process
        finally:
            process.kill()


def connect(process: "subprocess.Popen[str]") -> socket.socket:
    assert process.stdout is not None
    line = process.stdout.readline()
    assert line.startswith("radarsim: listening on 127.0.0.1:")
    client = socket.create_connection(("127.0.0.1", int(line.rpartition(":")[2])), 240)
    assert client.recv(len(GREETING), socket.MSG_WAITALL) == GREETING
    return client


def wait_until_told(process: "subprocess.Popen[str]") -> None:
    assert process.stderr is not None
    assert tuple(process.stderr.readline() for _ in LINES) == LINES


def children(process: "subprocess.Popen[str]") -> list[int]:
    path = Path(f"/proc/{process.pid}/task")
    tasks = [each / "children" for each in path.iterdir()]
    return [int(number) for task in tasks for number in task.read_text().split()]


def wait_until_gone(number: int) -> None:
    until = time.monotonic() + 60
    while Path(f"/proc/{number}/cmdline").exists():
        if not Path(f"/proc/{number}/cmdline").read_bytes():
            return  # nobody has asked for its exit code
        assert time.monotonic() < until
        time.sleep(0.01)


@pytest.mark.parametrize(
    ("number", "code"),
    [
        (signal.SIGINT, 130),
        pytest.param(signal.SIGTERM, 0, id="terminate", marks=pytest.mark.slow),
        pytest.param(signal.SIGKILL, -9, id="kill", marks=pytest.mark.slow),
    ],
)
def test_clients_are_greeted_while_the_engine_is_compiled_and_a_signal_ends_it(
    tmp_path: Path, number: int, code: int
) -> None:
    with serving(tmp_path) as process, connect(process) as client:
        client.sendall(b"GETSTARTPOSES\r\n" + INIT)
        assert client.recv(65536).startswith(b"NFO {StartPoses 3}")
        wait_until_told(process)
        (compiler,) = children(process)
        process.send_signal(number)
        assert process.wait(60) == code
        wait_until_gone(compiler)
        assert process.stdout is not None
        assert process.stderr is not None
        assert (process.stdout.read(), process.stderr.read()) == ("", "")
    assert not [*tmp_path.rglob(COMPLETE)]


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_robot_is_spawned_when_all_is_compiled(tmp_path: Path) -> None:
    with serving(tmp_path) as process, connect(process) as client:
        client.sendall(INIT)
        wait_until_told(process)
        client.settimeout(1100)
        assert b"{Time 0.10}" in client.recv(1000)
    assert [*tmp_path.rglob(COMPLETE)]


LOADED = """
import sys
from radarsim.cli.serve import make_image_server
from radarsim.cli.server_options import load_host
from radarsim.server.tcp_server import Server
from radarsim.simulation.config import SimulationConfig
host = load_host(sys.argv[1], SimulationConfig(), seed=0, begins=False)
Server(host), make_image_server(host, 0), host.connect()
print(*{"numba", "scipy", "shapely", "matplotlib", "embreex"} & set(sys.modules))
host.begin(host.make_simulation())
print(*{"scipy.signal", "matplotlib"} & set(sys.modules))
"""


def test_nothing_slow_is_imported_before_a_server_listens() -> None:
    command = (sys.executable, "-c", LOADED, "smoke_room")
    assert subprocess.check_output(command, text=True) == "\n\n"
