"""Signals while a command loads and compiles."""

import signal
import subprocess
import sys

import pytest

from radarsim.signal_handlers import (
    exit_immediately_on_signals,
    immediate_exits,
    signal_handlers,
)

# Like the compiler, which calls back from C, where exceptions get lost.
SCRIPT = """
import ctypes, os, signal
from radarsim.signal_handlers import exit_immediately_on_signals
with exit_immediately_on_signals({terminated}):
    ctypes.CFUNCTYPE(None)(lambda: os.kill(os.getpid(), signal.{name}))()
    print("goes on")
"""


@pytest.mark.parametrize(
    ("name", "terminated", "code"),
    [
        pytest.param("SIGINT", "", 130, id="interrupted"),
        pytest.param("SIGTERM", "", 143, id="told to end"),
        pytest.param("SIGTERM", "0", 0, id="server told to end"),
    ],
)
def test_signal_ends_the_process_at_once(name: str, terminated: str, code: int) -> None:
    script = SCRIPT.format(name=name, terminated=terminated)
    words = (sys.executable, "-c", script)
    run = subprocess.run(words, check=False, capture_output=True)
    assert (run.returncode, run.stdout, run.stderr) == (code, b"", b"")


def test_previous_handlers_are_restored() -> None:
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.getsignal(number) for number in numbers]
    with pytest.raises(ValueError, match="broken"), exit_immediately_on_signals():
        raise ValueError("broken")
    assert [signal.getsignal(number) for number in numbers] == before


RAISING = """
import ctypes, os, signal
from radarsim.signal_handlers import ExitOnSignal, immediate_exits
signal.signal(signal.SIGTERM, ExitOnSignal(7))
with immediate_exits():
    ctypes.CFUNCTYPE(None)(lambda: os.kill(os.getpid(), signal.{name}))()
    print("goes on")
"""


@pytest.mark.parametrize(("name", "code"), [("SIGINT", 130), ("SIGTERM", 7)])
def test_signals_that_would_raise_end_the_process_at_once_with_their_code(
    name: str, code: int
) -> None:
    words = (sys.executable, "-c", RAISING.format(name=name))
    run = subprocess.run(words, check=False, capture_output=True)
    assert (run.returncode, run.stdout, run.stderr) == (code, b"", b"")


def test_handlers_that_do_not_raise_stay() -> None:
    def handle(*_: object) -> None:
        pass

    with signal_handlers(dict.fromkeys((signal.SIGINT, signal.SIGTERM), handle)):
        with immediate_exits():
            assert signal.getsignal(signal.SIGINT) is handle
            assert signal.getsignal(signal.SIGTERM) is handle
        assert signal.getsignal(signal.SIGINT) is handle
