import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import radarsim.cli.app
from radarsim.cli import main
from radarsim.errors import ServerError

PROGRAM = (sys.executable, "-m", "radarsim")


def test_a_reader_that_has_enough_is_no_crash() -> None:
    command = (*PROGRAM, "scan", "empty_room", "--sensor", "laser")
    process = subprocess.Popen(
        (*command, "--start", "RobotStart1", "--count", "100"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.read(10)
    process.stdout.close()
    errors = process.stderr.read()
    process.stderr.close()
    process.wait(timeout=50)
    assert errors == b""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_a_full_disk_is_one_sentence() -> None:
    command = (*PROGRAM, "check", "empty_room")
    with Path("/dev/full").open("wb") as full:
        run = subprocess.run(
            command, stdout=full, stderr=subprocess.PIPE, check=False, timeout=50
        )
    assert run.returncode == 1
    assert run.stderr == b"radarsim: cannot write: No space left on device\n"


@pytest.mark.parametrize(
    ("error", "code"),
    [
        pytest.param(KeyboardInterrupt(), 130, id="interrupted"),
        pytest.param(ServerError("the port is taken"), 1, id="failed"),
    ],
)
def test_how_a_command_ends(
    error: BaseException,
    code: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def run() -> None:
        raise error

    monkeypatch.setattr(radarsim.cli.app, "app", run)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == code
    text = capsys.readouterr().err
    assert text == ("radarsim: the port is taken\n" if code == 1 else "")


def test_a_command_that_is_told_to_end_ends_with_0() -> None:
    command = (*PROGRAM, "scan", "empty_room", "--sensor", "radar", "--count", "200000")
    with subprocess.Popen(
        (*command, "--start", "RobotStart1", "--format", "csv"),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    ) as process:
        time.sleep(1.5)  # it scans by then, and for many seconds more
        process.terminate()
        assert process.wait(timeout=10) == 0
        assert process.stderr is not None
        assert process.stderr.read() == b""
