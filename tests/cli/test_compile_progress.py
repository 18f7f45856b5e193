"""What the user sees while the ray engine is compiled."""

import io
import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from radarsim.cli import compile_progress as module
from radarsim.cli.compile_progress import compile_progress, with_compile_progress
from radarsim.cli.output import start_log
from radarsim.kernel_cache import ENGINE, compilation, describe

LINE = "radarsim: compiling the ray engine, once on this machine\n"


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.fixture
def cached(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "is_cold", lambda: False)


def wait_until(holds: Callable[[], bool]) -> None:
    until = time.monotonic() + 240
    while not holds():
        assert time.monotonic() < until
        time.sleep(0.01)


@pytest.mark.usefixtures("cached")
def test_nothing_is_told_where_nothing_is_compiled(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with compile_progress():
        pass
    assert capsys.readouterr() == ("", "")


@pytest.mark.usefixtures("cached")
def test_one_line_is_told_in_a_pipe_however_much_is_compiled(
    capsys: pytest.CaptureFixture[str],
) -> None:
    @with_compile_progress
    def command(times: int) -> int:
        for _ in range(times):
            with compilation.running(), compilation.running():
                pass
        return times

    assert command(3) == 3
    assert capsys.readouterr() == ("", LINE)


@pytest.mark.usefixtures("cached")
def test_each_part_of_the_program_is_told_once_by_its_name(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with compile_progress():
        for subject in (ENGINE, "mapping", ENGINE, "mapping"):
            with compilation.running(subject), compilation.running("exploration"):
                pass
    mapping = "radarsim: compiling mapping as well\n"
    assert capsys.readouterr() == ("", LINE + mapping)


def test_without_a_cache_it_is_told_before_anything_is_imported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(module, "is_cold", lambda: True)
    with compile_progress(at_start=True):
        assert capsys.readouterr() == ("", LINE)


@pytest.mark.usefixtures("cached")
@pytest.mark.parametrize("columns", [120, 40, 12])
def test_terminal_counts_seconds_in_one_line_that_vanishes(
    monkeypatch: pytest.MonkeyPatch, columns: int
) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("COLUMNS", str(columns))
    with compile_progress():
        with compilation.running():
            wait_until(lambda: terminal.getvalue().count("\r") > 2)
        shown = terminal.getvalue()
        assert not shown.rpartition("\x1b[K")[2]
    lines = shown.split("\r\x1b[K")
    assert "comp" in lines[1]
    assert lines[1].endswith(" 0 s")
    assert max(map(len, lines)) < columns
    assert "\n" not in shown
    assert terminal.getvalue() == shown  # no thread goes on


@pytest.mark.usefixtures("cached")
def test_lines_of_the_log_are_written_in_place_of_the_progress(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr(logging.getLogger(), "handlers", [])
    start_log(logging.WARNING, "%(message)s")
    with compile_progress(), compilation.running():
        wait_until(lambda: "compiling" in terminal.getvalue())
        logging.getLogger("radarsim.server").warning("late")
    assert "\r\x1b[Klate\n" in terminal.getvalue()


def test_without_a_folder_for_the_cache_it_is_not_told_to_happen_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("radarsim.kernel_cache.cache_folder", lambda: None)
    assert "once" not in describe(ENGINE)
    assert "NUMBA_CACHE_DIR" in describe(ENGINE)


def test_program_tells_it_at_once_and_can_be_interrupted(tmp_path: Path) -> None:
    with subprocess.Popen(
        (sys.executable, "-m", "radarsim", "check", "empty_room"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
    ) as process:
        assert process.stderr is not None
        assert process.stdout is not None
        assert process.stderr.readline() == LINE
        assert not [*tmp_path.glob("*/*/*")]  # nothing is compiled yet
        process.send_signal(signal.SIGINT)
        assert process.wait(60) == 130
        assert process.stdout.read() == ""
        assert process.stderr.read() == ""
