"""Functions run in one thread beside the caller's, also after a fork."""

import os
import threading

import pytest

from radarsim.processes import BackgroundThread


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
