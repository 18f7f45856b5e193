"""Signals at any moment of a command: nothing unfinished is reported as done."""

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from processes import start_radarsim

CODES = {signal.SIGINT: 130, signal.SIGTERM: 143}
SCAN = ("scan", "empty_room", "--sensor", "laser", "--start", "RobotStart1")
COMMANDS = {
    "scan": SCAN,
    "check": ("check", "foliage_room"),
    "serve": ("serve", "empty_room", "--port", "0"),
    "map": ("map", "-o", "{}/", "empty_room", "--time-limit", "2"),
    "navigate": ("navigate", "bug_box", "--algorithm", "bug2"),
    "trials": ("trials", "bug_box", "bug_u_trap", "--seeds", "1"),
    "demo": ("demo", "{}/demo.png"),
}
pytestmark = [
    pytest.mark.timeout(180),
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]


def start(name: str, folder: Path) -> subprocess.Popen[bytes]:
    """Start a command, and return it when Python has started the program."""
    process = start_radarsim(*(word.format(folder) for word in COMMANDS[name]))
    deadline = time.monotonic() + 240
    while not catches_sigterm(process) and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.001)
    return process


def catches_sigterm(process: subprocess.Popen[bytes]) -> bool:
    status = Path(f"/proc/{process.pid}/status").read_text()
    (mask,) = (line.split()[1] for line in status.splitlines() if "SigCgt" in line)
    return bool(int(mask, 16) >> (signal.SIGTERM - 1) & 1)


def check_end(process: subprocess.Popen[bytes], number: int) -> None:
    out, errors = process.communicate(timeout=120)
    for word in (b"Traceback", b"Fatal", b"Exception"):
        assert word not in errors
    if process.returncode == 0:  # it was done before the signal, or is a server
        assert out
        assert number == signal.SIGTERM or not out.startswith(b"radarsim: listening")
    else:
        assert process.returncode == CODES[signal.Signals(number)]


@pytest.mark.parametrize("number", CODES)
@pytest.mark.parametrize("name", ["scan", "check", "serve"])
def test_signal_at_the_start_is_not_taken_for_the_end(
    tmp_path: Path, name: str, number: int
) -> None:
    with start(name, tmp_path) as process:
        process.send_signal(number)
        check_end(process, number)
    assert process.returncode != 0


INTERRUPTED_AT = """
import os, signal, sys

class Interrupt:
    def find_spec(self, name, *_):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)

sys.meta_path.insert(0, Interrupt())
sys.argv[1:] = {words!r}
from radarsim.cli import main
main()
"""


@pytest.mark.parametrize(
    "module", ["radarsim.processes", "concurrent", "click", "radarsim.cli.scan"]
)
def test_interrupt_during_an_import_leaves_no_traceback(module: str) -> None:
    code = INTERRUPTED_AT.format(module=module, words=[*SCAN])
    done = subprocess.run(
        [sys.executable, "-c", code], check=False, capture_output=True
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, b"", b"")


def test_ctrl_c_is_handled_before_anything_that_takes_time_is_imported() -> None:
    code = "import sys; before = {*sys.modules}; import radarsim.cli"
    code += "; print(*{*sys.modules} - before)"
    out = subprocess.check_output([sys.executable, "-S", "-c", code], text=True)
    imported = out.split()
    assert "signal" in imported
    assert not {"typing", "threading", "logging", "concurrent.futures"} & {*imported}


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", COMMANDS)
def test_signals_at_any_moment_leave_no_traceback_and_no_false_success(
    tmp_path: Path, name: str, seed: int
) -> None:
    rng = random.Random(f"{name} {seed}")
    number = rng.choice(list(CODES))
    with start(name, tmp_path) as process:
        time.sleep(rng.uniform(0, 3))
        for pause in [rng.uniform(0, 0.02) for _ in range(rng.choice([1, 2]))]:
            process.send_signal(number)
            time.sleep(pause)
        check_end(process, number)
    assert not [*tmp_path.glob(".*")]  # no temporary file
