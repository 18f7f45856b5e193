import os
import subprocess
import sys
import time
from multiprocessing import active_children

import pytest
from processes import has_ended

from radarsim.processes import worker_process


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
