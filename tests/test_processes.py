"""How signals end a process, worker processes, and a thread in the background."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from multiprocessing import active_children

import pytest
from processes import has_ended

from radarsim.processes import (
    BackgroundThread,
    exit_immediately_on_signals,
    ignore_signals,
    raise_on_signals,
    signal_handlers,
    worker_process,
)

NUMBERS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
CODES = [
    ("SIGINT", "", 130),
    ("SIGTERM", "", 143),
    ("SIGTERM", "set_exit_code_of_sigterm(0)", 0),
    ("SIGHUP", "", 129),
]


@pytest.fixture(autouse=True)
def _handlers() -> Iterator[None]:
    before = [signal.getsignal(number) for number in NUMBERS]
    yield
    for number, handler in zip(NUMBERS, before, strict=True):
        signal.signal(number, handler)


def run(script: str) -> tuple[int, bytes, bytes]:
    lines = f"import ctypes, os, signal\nfrom radarsim.processes import *\n{script}"
    ended = subprocess.run(
        (sys.executable, "-c", lines), check=False, capture_output=True
    )
    return ended.returncode, ended.stdout, ended.stderr


# Called back from C, where exceptions get lost.
IMMEDIATE = """
{setting}
with raise_on_signals(), exit_immediately_on_signals():
    ctypes.CFUNCTYPE(None)(lambda: os.kill(os.getpid(), signal.{name}))()
    print("goes on")
"""
RAISING = """
{setting}
with exit_immediately_on_signals(), raise_on_signals():
    try:
        os.kill(os.getpid(), signal.{name})
    finally:
        print("saved")
"""


@pytest.mark.parametrize(("name", "setting", "code"), CODES)
def test_signal_ends_the_process_at_once_or_lets_work_be_saved(
    name: str, setting: str, code: int
) -> None:
    for script, printed in ((IMMEDIATE, b""), (RAISING, b"saved\n")):
        ended = run(script.format(name=name, setting=setting))
        assert ended == (code, printed, b"")


ENDING = """
import atexit
atexit.register(lambda: os.kill(os.getpid(), signal.{name}))
with exit_immediately_on_signals():
    ignore_signals()
os.kill(os.getpid(), signal.{name})
print("done")
"""


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_signal_at_the_end_changes_nothing(name: str) -> None:
    assert run(ENDING.format(name=name)) == (0, b"done\n", b"")


@pytest.mark.parametrize("context", [exit_immediately_on_signals, raise_on_signals])
def test_previous_handlers_are_restored(context: type) -> None:
    before = [signal.getsignal(number) for number in NUMBERS]
    with pytest.raises(ValueError, match="broken"), context():
        raise ValueError("broken")
    assert [signal.getsignal(number) for number in NUMBERS] == before


def test_handlers_that_were_replaced_stay_replaced() -> None:
    with exit_immediately_on_signals():
        ignore_signals()
    assert {signal.getsignal(number) for number in NUMBERS} == {signal.SIG_IGN}


def test_signals_that_are_ignored_stay_ignored() -> None:
    def handle(*_: object) -> None:
        pass

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with signal_handlers({signal.SIGTERM: handle}), exit_immediately_on_signals():
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        assert signal.getsignal(signal.SIGTERM) is not handle


def test_other_threads_leave_signals_alone() -> None:
    failures: list[BaseException] = []

    def work() -> None:
        try:
            with exit_immediately_on_signals(), raise_on_signals():
                pass
        except ValueError as error:
            failures.append(error)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert not failures


def test_immediate_exit_writes_all_output_and_waits_for_no_thread() -> None:
    script = "import threading, time\nthreading.Thread(target=time.sleep, args=(600,))"
    script += ".start()\nprint('last words', end='')\nexit_immediately(130)"
    assert run(script) == (130, b"last words", b"")


def test_functions_run_in_one_other_thread() -> None:
    background = BackgroundThread()
    found = {background.submit(threading.get_ident).result() for _ in range(3)}
    assert len(found) == 1
    assert threading.get_ident() not in found


def test_a_fork_has_a_thread_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the new process nothing runs that was given to the thread of the old one."""
    background, never = BackgroundThread(), threading.Event()
    background.submit(never.wait)
    monkeypatch.setattr(os, "getpid", lambda: -1)
    assert background.submit(int, "7").result(timeout=60) == 7
    never.set()


@pytest.mark.slow
def test_leaving_early_terminates_the_process() -> None:
    before, begun = {*active_children()}, time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        _give_up()
    assert time.perf_counter() - begun < 25
    assert {*active_children()} <= before


def _give_up() -> None:
    with worker_process(int) as process:
        assert process.submit(abs, -1).result() == 1
        process.submit(time.sleep, 30)
        time.sleep(0.2)
        raise KeyboardInterrupt


PARENT = """
import os, time
from radarsim.processes import worker_process

if __name__ == "__main__":
    with worker_process(int) as process:
        print(process.submit(os.getpid).result(), flush=True)
        process.submit(time.sleep, 300).result()
"""


@pytest.mark.slow
def test_worker_ends_when_the_main_process_is_killed() -> None:
    command = (sys.executable, "-c", PARENT)
    with subprocess.Popen(command, stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline())
        os.kill(worker, 0)
        parent.kill()
    assert has_ended(worker)
