"""Selection of the observed robot, and consumers that do not delay the traffic."""

import math
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from radarsim.autonomy.proxy import ConnectionState, RobotSelector, TrafficObserver
from radarsim.autonomy.proxy.line_queue import LineQueue
from radarsim.autonomy.proxy.observer import MAX_WAITING_SCANS, Consumer
from radarsim.protocol.reports import Ins, RangeScan, Report

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


class RecordingConsumer:
    """Records the reports and the scanners that it was started with."""

    def __init__(self) -> None:
        self.started: list[tuple[int, str]] = []
        self.times: list[float] = []
        self.max_range = math.nan

    def begin(self, connection: ConnectionState, scanner: str) -> "RecordingConsumer":
        self.started.append((connection.number, scanner))
        facts = connection.scanner(scanner)
        assert facts is not None
        self.max_range = facts.max_range
        return self

    def take(self, report: Report) -> None:
        if isinstance(report, Ins | RangeScan):
            self.times.append(report.time)


@pytest.fixture
def consumer() -> RecordingConsumer:
    return RecordingConsumer()


def report(selector: RobotSelector, connection: ConnectionState, *lines: str) -> None:
    for line in lines:
        parsed = connection.receive_server_line(line)
        if parsed is not None:
            selector.take(connection, parsed)


def test_only_the_first_connection_with_scans_is_observed(
    consumer: RecordingConsumer, scan_line: ScanLine
) -> None:
    selector = RobotSelector(consumer.begin)
    probe, robot, late = ConnectionState(1), ConnectionState(2), ConnectionState(3)
    report(selector, probe, "NFO {Level a}", pose(50))
    report(selector, robot, pose(1), pose(2))
    assert selector.chosen is None
    report(selector, robot, scan_line(3))
    assert selector.chosen is robot
    report(selector, late, scan_line(60), GEO, CONF)
    report(selector, robot, GEO, pose(4))
    assert selector.consumer is None
    report(selector, robot, CONF)
    assert selector.consumer is consumer
    report(selector, robot, scan_line(5))
    report(selector, late, scan_line(61))
    assert consumer.started == [(2, "lms200")]
    assert consumer.times == [1, 2, 3, 4, 5]
    assert consumer.max_range == 80.0


def test_selector_waits_for_a_client_that_does_not_ask(
    consumer: RecordingConsumer, scan_line: ScanLine
) -> None:
    selector, robot = RobotSelector(consumer.begin, patience=2.0), ConnectionState(1)
    report(selector, robot, *[scan_line(k / 10) for k in range(20)])
    assert selector.consumer is None
    report(selector, robot, scan_line(2.0))
    assert selector.consumer is consumer
    assert len(consumer.times) == 21
    assert math.isinf(consumer.max_range)


def test_selector_counts_scans_without_time_stamps(
    consumer: RecordingConsumer, scan_line: ScanLine
) -> None:
    selector, robot = RobotSelector(consumer.begin), ConnectionState(1)
    scan = scan_line(0).replace("{Time 0.00} ", "")
    report(selector, robot, *[scan] * (MAX_WAITING_SCANS - 1))
    assert selector.consumer is None
    report(selector, robot, scan)
    assert len(consumer.times) == MAX_WAITING_SCANS


def test_one_scanner_can_be_selected(
    consumer: RecordingConsumer, scan_line: ScanLine
) -> None:
    selector = RobotSelector(consumer.begin, scanner="lms200")
    other, robot = ConnectionState(1), ConnectionState(2)
    report(selector, other, scan_line(1, name="sick"))
    report(selector, robot, scan_line(1, name="sick"), scan_line(1), GEO, CONF)
    assert consumer.started == [(2, "lms200")]


def test_finish_ends_the_wait_for_answers(
    consumer: RecordingConsumer, scan_line: ScanLine
) -> None:
    selector, robot = RobotSelector(consumer.begin), ConnectionState(1)
    selector.finish()
    report(selector, robot, pose(1))
    selector.finish()
    assert consumer.started == []
    report(selector, robot, scan_line(2))
    selector.finish()
    selector.finish()
    assert consumer.started == [(1, "lms200")]
    assert consumer.times == [1, 2]


def test_newest_reports_before_the_first_scan_are_held(
    consumer: RecordingConsumer, scan_line: ScanLine
) -> None:
    selector, robot = RobotSelector(consumer.begin), ConnectionState(1)
    report(selector, robot, *[pose(k) for k in range(1000)], scan_line(1000))
    selector.finish()
    assert consumer.times[-2:] == [999, 1000]
    assert 100 < len(consumer.times) < 500


class SlowConsumer:
    """Takes reports when it is allowed to."""

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
def slow_consumer() -> SlowConsumer:
    return SlowConsumer()


@contextmanager
def listening(
    slow_consumer: Consumer, max_scans: int = 1000
) -> Iterator[TrafficObserver]:
    selector = RobotSelector(lambda *_: slow_consumer, patience=0.0)
    listener = TrafficObserver(selector, LineQueue(max_scans=max_scans))
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


def test_all_data_is_processed_by_the_end(
    slow_consumer: SlowConsumer, scan_line: ScanLine
) -> None:
    with listening(slow_consumer) as listener:
        listener.add_data(1, "client", b"INIT {ClassName P3AT}\r\nGARB{\r\n")
        send(listener, *[scan_line(k) for k in range(100)])
        assert listener.finish(600)
    assert slow_consumer.times == [*range(100)]
    assert listener.error is None
    assert listener.dropped == 0


def test_one_of_several_robots_is_observed(
    slow_consumer: SlowConsumer, scan_line: ScanLine
) -> None:
    with listening(slow_consumer) as listener:
        send(listener, "NFO {Level a}", number=1)
        for k in range(50):
            send(listener, scan_line(k), number=2)
            send(listener, scan_line(100 + k), number=3)
        assert listener.finish(600)
    assert slow_consumer.times == [*range(50)]


def test_hanging_consumer_costs_scans_and_no_time(
    slow_consumer: SlowConsumer, scan_line: ScanLine
) -> None:
    slow_consumer.go.clear()
    lines = [scan_line(k) for k in range(2000)]
    with listening(slow_consumer, max_scans=10) as listener:
        began = time.monotonic()
        send(listener, *lines)
        assert time.monotonic() - began < 60
        assert not listener.finish(timeout=0.05)
        slow_consumer.go.set()
        assert listener.finish(600)
    assert 1980 <= listener.dropped <= 1990
    assert slow_consumer.times[-10:] == [*range(1990, 2000)]


def test_error_of_a_consumer_is_kept_and_logged(
    slow_consumer: SlowConsumer, scan_line: ScanLine, caplog: pytest.LogCaptureFixture
) -> None:
    slow_consumer.fails_at = 3.0
    with listening(slow_consumer) as listener:
        send(listener, *[scan_line(k) for k in range(10)])
        assert listener.finish(600)
        send(listener, scan_line(11))
    assert slow_consumer.times == [0, 1, 2, 3]
    assert isinstance(listener.error, ValueError)
    assert "nothing is made of what passes any more: a bug in the map" in caplog.text
