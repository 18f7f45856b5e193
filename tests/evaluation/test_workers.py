import math
import time
from multiprocessing import active_children

import pytest

from radarsim.evaluation.workers import worker_pool


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
