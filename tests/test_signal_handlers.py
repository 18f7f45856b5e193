"""Signals while a command loads and compiles."""

import signal
import subprocess
import sys

import pytest

from radarsim.signal_handlers import exit_immediately_on_signals

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
