"""Nobody who talks is kept waiting, whatever becomes of what is heard."""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from radarsim.protocol.reports import RangeScan, Report
from radarsim.proxy import RobotSelector, TrafficObserver
from radarsim.proxy.line_queue import LineQueue
from radarsim.proxy.observer import Consumer

ScanLine = Callable[..., str]


class Taker:
    """Takes reports as slowly as it is told."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.go = threading.Event()
        self.go.set()
        self.fails_at: float | None = None

    def take(self, report: Report) -> None:
        self.go.wait(10)
        if isinstance(report, RangeScan):
            self.times.append(report.time)
            if report.time == self.fails_at:
                raise ValueError("a bug in the map")


@pytest.fixture
def taker() -> Taker:
    return Taker()


@contextmanager
def listening(taker: Consumer, max_scans: int = 1000) -> Iterator[TrafficObserver]:
    choice = RobotSelector(lambda *_: taker, patience=0.0)
    listener = TrafficObserver(choice, LineQueue(max_scans=max_scans))
    before = sys.getswitchinterval()
    listener.start()
    try:
        yield listener
    finally:
        listener.finish(5)
        assert sys.getswitchinterval() == before


def tell(listener: TrafficObserver, *lines: str, number: int = 1) -> None:
    for line in lines:
        listener.add_data(number, "server", f"{line}\r\n".encode())


def test_all_that_was_heard_is_made_use_of_by_the_end(
    taker: Taker, scan_line: ScanLine
) -> None:
    with listening(taker) as listener:
        listener.add_data(1, "client", b"INIT {ClassName P3AT}\r\nGARB{\r\n")
        tell(listener, *[scan_line(k) for k in range(100)])
        assert listener.finish()
    assert taker.times == [*range(100)]
    assert listener.error is None
    assert listener.dropped == 0


def test_of_several_robots_one_is_listened_to(
    taker: Taker, scan_line: ScanLine
) -> None:
    with listening(taker) as listener:
        tell(listener, "NFO {Level a}", number=1)
        for k in range(50):
            tell(listener, scan_line(k), number=2)
            tell(listener, scan_line(100 + k), number=3)
        assert listener.finish()
    assert taker.times == [*range(50)]


def test_what_hangs_costs_scans_and_no_time(taker: Taker, scan_line: ScanLine) -> None:
    taker.go.clear()
    lines = [scan_line(k) for k in range(2000)]
    with listening(taker, max_scans=10) as listener:
        began = time.monotonic()
        tell(listener, *lines)
        assert time.monotonic() - began < 1
        assert not listener.finish(timeout=0.05)
        taker.go.set()
        assert listener.finish()
    assert 1980 <= listener.dropped <= 1990
    assert taker.times[-10:] == [*range(1990, 2000)]


def test_what_fails_is_told_and_nothing_else_happens(
    taker: Taker, scan_line: ScanLine, caplog: pytest.LogCaptureFixture
) -> None:
    taker.fails_at = 3.0
    with listening(taker) as listener:
        tell(listener, *[scan_line(k) for k in range(10)])
        assert listener.finish()
        tell(listener, scan_line(11))
    assert taker.times == [0, 1, 2, 3]
    assert isinstance(listener.error, ValueError)
    assert "nothing is made of what passes any more: a bug in the map" in caplog.text
