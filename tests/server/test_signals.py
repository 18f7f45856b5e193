"""How a server ends: by a signal, by an exception, and when its port is taken."""

import asyncio
import os
import re
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from radarsim.errors import ServerError
from radarsim.scene.scene import Scene
from radarsim.server.host import Diagnostic, Host
from radarsim.server.tcp_server import Server, serve

INIT = b"INIT {ClassName USARBot.P3AT} {Start RobotStart1}\r\n"
EXITS = [(signal.SIGINT, 130), (signal.SIGTERM, 0), (signal.SIGHUP, 129)]


@pytest.mark.parametrize(("number", "code"), EXITS)
async def test_signal_stops_the_server_with_its_exit_code(
    empty_room: Scene, number: int, code: int
) -> None:
    announced: list[tuple[str, int]] = []

    def announce(address: tuple[str, int]) -> None:
        announced.append(address)
        os.kill(os.getpid(), number)
        os.kill(os.getpid(), number)  # users press Ctrl-C twice

    assert await serve(Server(Host(empty_room)), "127.0.0.1", 0, announce) == code
    ((host, port),) = announced
    assert host == "127.0.0.1"
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection((host, port), 30)


async def test_terminal_may_be_closed_if_the_parent_said_so(empty_room: Scene) -> None:
    def announce(_: tuple[str, int]) -> None:
        os.kill(os.getpid(), signal.SIGHUP)
        asyncio.get_running_loop().call_later(0.1, os.kill, os.getpid(), signal.SIGTERM)

    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        assert await serve(Server(Host(empty_room)), "127.0.0.1", 0, announce) == 0
    finally:
        signal.signal(signal.SIGHUP, before)


class Broken(Host):
    """Fails in its first tick."""

    def step(self, *, passes: bool = True) -> list[tuple[int, Diagnostic]]:  # noqa: ARG002
        raise RuntimeError("broken")


async def test_exception_in_a_tick_stops_the_server(empty_room: Scene) -> None:
    with pytest.raises(RuntimeError, match="broken") as caught:
        await serve(Server(Broken(empty_room)), "127.0.0.1", 0, lambda _: None)
    assert caught.value.__notes__ == ["at 0.00 s of simulated time"]


async def test_taken_port_is_an_error_before_the_address_is_announced(
    empty_room: Scene,
) -> None:
    announced: list[tuple[str, int]] = []
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(ServerError, match=f"cannot listen on 127.0.0.1:{port}"):
            await serve(Server(Host(empty_room)), "127.0.0.1", port, announced.append)
    assert announced == []
    assert asyncio.get_running_loop().remove_signal_handler(signal.SIGINT) is False


@contextmanager
def started(cwd: Path, *options: str) -> Iterator["subprocess.Popen[str]"]:
    process = subprocess.Popen(
        [sys.executable, "-m", "radarsim", "serve", *options],
        cwd=cwd,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def listening_port(process: "subprocess.Popen[str]") -> int:
    assert process.stdout is not None
    line = process.stdout.readline()
    assert line.startswith("radarsim: listening on 127.0.0.1:")
    return int(line.rpartition(":")[2])


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), EXITS)
def test_program_exits_on_a_signal_while_robots_are_scanning(
    tmp_path: Path, number: int, code: int
) -> None:
    with started(tmp_path, "empty_room", "--port", "0") as process:
        address = ("127.0.0.1", listening_port(process))
        with socket.create_connection(address, 60) as client:
            client.sendall(INIT)
            while b"RangeScanner" not in client.recv(65536):
                pass
            process.send_signal(number)
            process.send_signal(number)  # users press Ctrl-C twice
            out, errors = process.communicate(timeout=240)
        assert process.returncode == code
        assert out == ""
        assert "Traceback" not in errors


@pytest.mark.usefixtures("empty_room")
@pytest.mark.parametrize(
    ("number", "code"),
    [
        (signal.SIGINT, 130),
        pytest.param(signal.SIGTERM, 0, id="terminate", marks=pytest.mark.slow),
        pytest.param(signal.SIGHUP, 129, id="hang up", marks=pytest.mark.slow),
    ],
)
def test_program_exits_on_a_signal_while_viewers_wait_for_pictures(
    tmp_path: Path, number: int, code: int
) -> None:
    with started(tmp_path, "empty_room", "--port", "0", "--image-port", "0") as process:
        listening_port(process)
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("radarsim: images on 127.0.0.1:")
        address = ("127.0.0.1", int(line.rpartition(":")[2]))
        with (
            socket.create_connection(address, 240) as viewer,
            socket.create_connection(address, 240) as deaf,
        ):
            deaf.sendall(b"OK" * 1000)
            viewer.sendall(b"OKOKOK")
            assert viewer.recv(1) == b"\x02"
            process.send_signal(number)
            _, errors = process.communicate(timeout=240)
        assert process.returncode == code
        # Busy machines are slow, and empty caches are filled.
        ignored = re.compile("too slow|compil")
        lines = [line for line in errors.splitlines() if not ignored.search(line)]
        assert lines == []
