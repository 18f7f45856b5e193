import math
import os
import signal
import subprocess
import sys
import time
from multiprocessing import active_children
from pathlib import Path

import pytest

from radarsim.processes import worker_pool


@pytest.mark.slow
def test_pool_returns_results_and_leaves_no_process() -> None:
    before = {*active_children()}
    with worker_pool(2) as pool:
        assert list(pool.map(math.sqrt, [4, 9])) == [2, 3]
    assert {*active_children()} <= before


@pytest.mark.slow
def test_leaving_the_pool_early_terminates_its_processes() -> None:
    before, begun = {*active_children()}, time.perf_counter()
    with pytest.raises(KeyboardInterrupt):
        _give_up()
    assert time.perf_counter() - begun < 25
    assert {*active_children()} <= before


def _give_up() -> None:
    with worker_pool(1) as pool:
        assert pool.submit(abs, -1).result() == 1
        pool.submit(time.sleep, 30)
        time.sleep(0.2)
        raise KeyboardInterrupt


PARENT = """
import os, time
from radarsim.processes import worker_pool

if __name__ == "__main__":
    with worker_pool(2) as pool:
        print(pool.submit(os.getpid).result(), flush=True)
        pool.submit(time.sleep, 300).result()
"""


@pytest.mark.slow
def test_workers_end_when_the_main_process_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "parent.py"
    script.write_text(PARENT)
    with subprocess.Popen([sys.executable, script], stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        worker = int(parent.stdout.readline())
        parent.kill()
    deadline = time.monotonic() + 240
    while is_running(worker) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not is_running(worker)


STARTING = """
import signal, time
from radarsim.processes import worker_pool

if __name__ == "__main__":
    with worker_pool(2) as pool:
        print("go", flush=True)
        try:
            pool.submit(abs, 1)
            time.sleep(60)
        except KeyboardInterrupt:
            time.sleep(2)  # of which a worker needs less to start
"""


@pytest.mark.parametrize("delay", [0.05, 0.1, 0.2])
def test_ctrl_c_while_workers_start_prints_nothing(
    tmp_path: Path, delay: float
) -> None:
    script = tmp_path / "starting.py"
    script.write_text(STARTING)
    with subprocess.Popen(
        [sys.executable, script],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    ) as parent:
        assert parent.stdout is not None
        parent.stdout.readline()
        time.sleep(delay)
        os.killpg(parent.pid, signal.SIGINT)  # as a terminal does
        _, errors = parent.communicate(timeout=240)
    assert (parent.returncode, errors) == (0, b"")


def is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    # Nobody may have waited for a process that has ended.
    return ") Z " not in Path(f"/proc/{process}/stat").read_text()
