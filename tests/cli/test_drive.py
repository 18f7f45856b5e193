"""The command at a terminal: a pseudo-terminal, where there is such a thing."""

import contextlib
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.server_thread import ServerThread

needs_pty = pytest.mark.skipif(sys.platform == "win32", reason="needs a pty")
UP = b"\x1b[A"


class Terminal:
    """A pseudo-terminal of 80 by 24 characters that collects its output."""

    def __init__(self) -> None:
        import fcntl
        import struct
        import termios

        self.user, self.program = os.openpty()
        size = struct.pack("HHHH", 24, 80, 0, 0)
        fcntl.ioctl(self.program, termios.TIOCSWINSZ, size)
        self.shown = b""
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def attributes(self) -> list[Any]:
        import termios

        return termios.tcgetattr(self.program)

    def type(self, keys: bytes) -> None:
        os.write(self.user, keys)

    def close(self) -> None:
        os.close(self.program)  # ends the reading thread
        self._thread.join(240)
        os.close(self.user)

    def _read(self) -> None:
        with contextlib.suppress(OSError):
            while data := os.read(self.user, 65536):
                self.shown += data


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    made = Terminal()
    yield made
    made.close()


@pytest.fixture
def host(empty_room: Scene) -> Host:
    return Host(empty_room)


@pytest.fixture
def port(host: Host) -> Iterator[int]:
    thread = ServerThread(host, speed=1.0)
    yield thread.begin()[1]
    thread.finish()


def start(
    terminal: Terminal, *options: str, kind: str = "xterm-256color"
) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        (sys.executable, "-m", "radarsim", "drive", *options),
        stdin=terminal.program,
        stdout=terminal.program,
        stderr=terminal.program,
        start_new_session=True,
        env={**os.environ, "TERM": kind},
    )


def wait_until(condition: Callable[[], bool], patience: float = 240.0) -> None:
    end = time.monotonic() + patience
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


@needs_pty
def test_keys_drive_the_robot_and_the_terminal_is_restored(
    terminal: Terminal, host: Host, port: int
) -> None:
    before = terminal.attributes()
    with start(terminal, "--connect", f"127.0.0.1:{port}") as process:
        wait_until(lambda: b"lms200" in terminal.shown)
        assert terminal.attributes() != before
        ((vehicle,)) = host.simulation.vehicles
        began = vehicle.robot.pose.x
        for _ in range(10):
            terminal.type(UP)
            time.sleep(0.05)
        wait_until(lambda: vehicle.robot.pose.x > began + 0.1)

        def stands() -> bool:
            pose = vehicle.robot.pose
            time.sleep(0.2)
            return vehicle.robot.pose == pose

        wait_until(stands)  # since no key comes, for longer than any key holds
        terminal.type(b"q")
        assert process.wait(timeout=240) == 0
    assert terminal.attributes() == before
    assert b"\x1b[?1049l" in terminal.shown, "the screen as it was before"
    shown = terminal.shown
    assert shown.rindex(b"\x1b[?25h") > shown.rindex(b"\x1b[?25l"), "with its cursor"


@needs_pty
def test_sigterm_is_the_end_of_a_drive_and_restores_the_terminal(
    terminal: Terminal, port: int
) -> None:
    before = terminal.attributes()
    with start(terminal, "--connect", f"127.0.0.1:{port}") as process:
        wait_until(lambda: b"lms200" in terminal.shown)
        for _ in range(2):
            process.send_signal(signal.SIGTERM)
        assert process.wait(timeout=240) == 0
    assert terminal.attributes() == before
    assert b"Traceback" not in terminal.shown


@needs_pty
@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)]
)
def test_signal_before_the_robot_is_there_is_no_end_of_a_drive(
    terminal: Terminal, number: int, code: int
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        options = ("--connect", f"127.0.0.1:{silent.getsockname()[1]}")
        with start(terminal, *options) as process, silent.accept()[0]:
            process.send_signal(number)
            assert process.wait(timeout=240) == code
    assert b"Traceback" not in terminal.shown


@needs_pty
def test_terminal_is_restored_when_the_server_disconnects(
    terminal: Terminal, host: Host
) -> None:
    before = terminal.attributes()
    thread = ServerThread(host, speed=1.0)
    with start(terminal, "--connect", f"127.0.0.1:{thread.begin()[1]}") as process:
        wait_until(lambda: b"lms200" in terminal.shown)
        thread.finish()
        assert process.wait(timeout=240) == 1
    assert terminal.attributes() == before
    wait_until(lambda: b"radarsim: " in terminal.shown.rpartition(b"\x1b[?1049l")[2])


@needs_pty
def test_dumb_terminal_is_refused(terminal: Terminal) -> None:
    with start(terminal, kind="dumb") as process:
        assert process.wait(timeout=240) == 2
    wait_until(lambda: b"'dumb'" in terminal.shown)


@needs_pty
def test_misspelt_robot_ends_the_command_before_it_connects(terminal: Terminal) -> None:
    with socket.create_server(("127.0.0.1", 0)) as silent:
        server = f"127.0.0.1:{silent.getsockname()[1]}"
        words = ("--robot", "P3AT_Radar361", "--connect", server)
        with start(terminal, *words) as process:
            assert process.wait(timeout=240) == 2
        silent.setblocking(False)
        with pytest.raises(BlockingIOError):
            silent.accept()
    wait_until(lambda: b"did you mean 'P3AT_Radar360'" in terminal.shown)
