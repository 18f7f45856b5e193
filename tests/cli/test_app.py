import os
import subprocess
import sys
from pathlib import Path

import pytest
from commands import run_in_process as radarsim

from radarsim import __version__
from radarsim.cli import app
from radarsim.errors import ServerError
from radarsim.processes import BROKEN_PIPE

PROGRAM = (sys.executable, "-m", "radarsim")


def test_version_and_help_are_printed() -> None:
    assert radarsim("--version").text.startswith("radarsim 0.")
    assert "serve" in radarsim("--help").text
    assert radarsim("sarve").code == 2


def test_closed_stdout_ends_the_program_without_an_error() -> None:
    command = (*PROGRAM, "scan", "empty_room", "--sensor", "laser")
    with subprocess.Popen(
        (*command, "--start", "RobotStart1", "--count", "100"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    ) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.read(10)
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == BROKEN_PIPE


def test_output_that_nobody_reads_ends_the_program_as_others() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    words = (*PROGRAM, "sensors")
    run = subprocess.run(
        words, stdout=writer, stderr=subprocess.PIPE, check=False, timeout=240
    )
    os.close(writer)
    assert (run.returncode, run.stderr) == (BROKEN_PIPE, b"")


def test_bug_is_shown_whole_with_what_to_report(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(*_: object) -> None:
        raise ArithmeticError("no such number")

    monkeypatch.setattr("radarsim.scene.map_file.load_variants", fail)
    run = radarsim("check", "empty_room")
    assert run.code == 1
    assert run.err.startswith("Traceback (most recent call last):")
    *_, error, message = run.err.splitlines()
    assert error == "ArithmeticError: no such number"
    assert message.startswith("radarsim: this is an error in radarsim itself; please")
    assert f"radarsim {__version__}, Python 3." in message


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_full_disk_is_reported_in_one_line() -> None:
    command = (*PROGRAM, "materials")
    with Path("/dev/full").open("wb") as full:
        run = subprocess.run(
            command, stdout=full, stderr=subprocess.PIPE, check=False, timeout=240
        )
    assert run.returncode == 1
    assert run.stderr == b"radarsim: cannot write: the disk is full\n"


@pytest.mark.parametrize(
    ("error", "code"),
    [(KeyboardInterrupt(), 130), (ServerError("the port is taken"), 1)],
)
def test_errors_become_exit_codes(
    monkeypatch: pytest.MonkeyPatch, error: BaseException, code: int
) -> None:
    def fail() -> None:
        raise error

    monkeypatch.setattr(app, "app", fail)
    run = radarsim("check", "empty_room")
    assert run.code == code
    assert run.err == ("radarsim: the port is taken\n" if code == 1 else "")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("closed", "command", "code"),
    [
        ("<&- >&- 2>&-", "docs radar", 0),
        (">&-", "docs radar", 0),
        ("2>&-", "scan nowhere --sensor radar --pose 0,0,0", 1),
    ],
)
def test_streams_may_be_closed(closed: str, command: str, code: int) -> None:
    shell = ("sh", "-c", f'exec "$@" {closed}', "sh")
    words = (*shell, *PROGRAM, *command.split())
    run = subprocess.run(words, capture_output=True, check=False, timeout=240)
    assert run.returncode == code
    assert b"Traceback" not in run.stderr
