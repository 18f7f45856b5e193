"""Which robot is observed, and that no consumer delays the traffic."""

import math
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from radarsim.protocol.reports import Ins, RangeScan, Report
from radarsim.proxy import ConnectionState, RobotSelector, TrafficObserver
from radarsim.proxy.line_queue import LineQueue
from radarsim.proxy.observer import MAX_WAITING_SCANS, Consumer

ScanLine = Callable[..., str]
GEO = (
    "GEO {Type RangeScanner} {Name lms200 Location 0.2,0,-0.2 Orientation 0,0,0 "
    "Mount HARD}"
)
CONF = "CONF {Type RangeScanner} {Name lms200} {MinRange 0.1} {MaxRange 80.0}"


def pose(time: float) -> str:
    return (
        f"SEN {{Time {time}}} {{Type INS}} {{Name InsTest}} {{Location {time},0,0}} "
        "{Orientation 0,0,0}"
    )


class Made:
    """Keeps what it takes, and how it was begun."""

    def __init__(self) -> None:
        self.begun: list[tuple[int, str]] = []
        self.times: list[float] = []
        self.max_range = math.nan

    def begin(self, overheard: ConnectionState, scanner: str) -> "Made":
        self.begun.append((overheard.number, scanner))
        facts = overheard.scanner(scanner)
        assert facts is not None
        self.max_range = facts.max_range
        return self

    def take(self, report: Report) -> None:
        if isinstance(report, Ins | RangeScan):
            self.times.append(report.time)


@pytest.fixture
def made() -> Made:
    return Made()


def report(choice: RobotSelector, overheard: ConnectionState, *lines: str) -> None:
    for line in lines:
        parsed = overheard.receive_server_line(line)
        if parsed is not None:
            choice.take(overheard, parsed)


def test_the_first_connection_with_scans_is_followed_and_no_other(
    made: Made, scan_line: ScanLine
) -> None:
    choice = RobotSelector(made.begin)
    probe, robot, late = ConnectionState(1), ConnectionState(2), ConnectionState(3)
    report(choice, probe, "NFO {Level a}", pose(50))
    report(choice, robot, pose(1), pose(2))
    assert choice.chosen is None
    report(choice, robot, scan_line(3))
    assert choice.chosen is robot
    report(choice, late, scan_line(60), GEO, CONF)
    report(choice, robot, GEO, pose(4))
    assert choice.consumer is None
    report(choice, robot, CONF)
    assert choice.consumer is made
    report(choice, robot, scan_line(5))
    report(choice, late, scan_line(61))
    assert made.begun == [(2, "lms200")]
    assert made.times == [1, 2, 3, 4, 5]
    assert made.max_range == 80.0


def test_selector_waits_for_a_client_that_does_not_ask(
    made: Made, scan_line: ScanLine
) -> None:
    choice, robot = RobotSelector(made.begin, patience=2.0), ConnectionState(1)
    report(choice, robot, *[scan_line(k / 10) for k in range(20)])
    assert choice.consumer is None
    report(choice, robot, scan_line(2.0))
    assert choice.consumer is made
    assert len(made.times) == 21
    assert math.isinf(made.max_range)


def test_where_no_time_is_told_scans_are_counted(
    made: Made, scan_line: ScanLine
) -> None:
    choice, robot = RobotSelector(made.begin), ConnectionState(1)
    scan = scan_line(0).replace("{Time 0.00} ", "")
    report(choice, robot, *[scan] * (MAX_WAITING_SCANS - 1))
    assert choice.consumer is None
    report(choice, robot, scan)
    assert len(made.times) == MAX_WAITING_SCANS


def test_one_scanner_may_be_asked_for(made: Made, scan_line: ScanLine) -> None:
    choice = RobotSelector(made.begin, scanner="lms200")
    other, robot = ConnectionState(1), ConnectionState(2)
    report(choice, other, scan_line(1, name="sick"))
    report(choice, robot, scan_line(1, name="sick"), scan_line(1), GEO, CONF)
    assert made.begun == [(2, "lms200")]


def test_finish_ends_the_wait_for_answers(made: Made, scan_line: ScanLine) -> None:
    choice, robot = RobotSelector(made.begin), ConnectionState(1)
    choice.finish()
    report(choice, robot, pose(1))
    choice.finish()
    assert made.begun == []
    report(choice, robot, scan_line(2))
    choice.finish()
    choice.finish()
    assert made.begun == [(1, "lms200")]
    assert made.times == [1, 2]


def test_newest_reports_before_the_first_scan_are_held(
    made: Made, scan_line: ScanLine
) -> None:
    choice, robot = RobotSelector(made.begin), ConnectionState(1)
    report(choice, robot, *[pose(k) for k in range(1000)], scan_line(1000))
    choice.finish()
    assert made.times[-2:] == [999, 1000]
    assert 100 < len(made.times) < 500


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


def send(listener: TrafficObserver, *lines: str, number: int = 1) -> None:
    for line in lines:
        listener.add_data(number, "server", f"{line}\r\n".encode())


def test_all_data_is_processed_by_the_end(taker: Taker, scan_line: ScanLine) -> None:
    with listening(taker) as listener:
        listener.add_data(1, "client", b"INIT {ClassName P3AT}\r\nGARB{\r\n")
        send(listener, *[scan_line(k) for k in range(100)])
        assert listener.finish()
    assert taker.times == [*range(100)]
    assert listener.error is None
    assert listener.dropped == 0


def test_one_of_several_robots_is_observed(taker: Taker, scan_line: ScanLine) -> None:
    with listening(taker) as listener:
        send(listener, "NFO {Level a}", number=1)
        for k in range(50):
            send(listener, scan_line(k), number=2)
            send(listener, scan_line(100 + k), number=3)
        assert listener.finish()
    assert taker.times == [*range(50)]


def test_hanging_consumer_costs_scans_and_no_time(
    taker: Taker, scan_line: ScanLine
) -> None:
    taker.go.clear()
    lines = [scan_line(k) for k in range(2000)]
    with listening(taker, max_scans=10) as listener:
        began = time.monotonic()
        send(listener, *lines)
        assert time.monotonic() - began < 1
        assert not listener.finish(timeout=0.05)
        taker.go.set()
        assert listener.finish()
    assert 1980 <= listener.dropped <= 1990
    assert taker.times[-10:] == [*range(1990, 2000)]


def test_error_of_a_consumer_is_kept_and_logged(
    taker: Taker, scan_line: ScanLine, caplog: pytest.LogCaptureFixture
) -> None:
    taker.fails_at = 3.0
    with listening(taker) as listener:
        send(listener, *[scan_line(k) for k in range(10)])
        assert listener.finish()
        send(listener, scan_line(11))
    assert taker.times == [0, 1, 2, 3]
    assert isinstance(listener.error, ValueError)
    assert "nothing is made of what passes any more: a bug in the map" in caplog.text
