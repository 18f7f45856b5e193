"""The robot that scans first is followed from its first word on, and no other."""

import math
from collections.abc import Callable

import pytest

from radarsim.protocol.reports import Ins, RangeScan, Report
from radarsim.proxy import ConnectionState, RobotSelector
from radarsim.proxy.observer import MAX_WAITING_SCANS

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


def tell(choice: RobotSelector, overheard: ConnectionState, *lines: str) -> None:
    for line in lines:
        report = overheard.receive_server_line(line)
        if report is not None:
            choice.take(overheard, report)


def test_the_first_connection_with_scans_is_followed_and_no_other(
    made: Made, scan_line: ScanLine
) -> None:
    choice = RobotSelector(made.begin)
    probe, robot, late = ConnectionState(1), ConnectionState(2), ConnectionState(3)
    tell(choice, probe, "NFO {Level a}", pose(50))
    tell(choice, robot, pose(1), pose(2))
    assert choice.chosen is None
    tell(choice, robot, scan_line(3))
    assert choice.chosen is robot
    tell(choice, late, scan_line(60), GEO, CONF)
    tell(choice, robot, GEO, pose(4))
    assert choice.consumer is None
    tell(choice, robot, CONF)
    assert choice.consumer is made
    tell(choice, robot, scan_line(5))
    tell(choice, late, scan_line(61))
    assert made.begun == [(2, "lms200")]
    assert made.times == [1, 2, 3, 4, 5]
    assert made.max_range == 80.0


def test_a_client_that_does_not_ask_is_waited_for_a_while(
    made: Made, scan_line: ScanLine
) -> None:
    choice, robot = RobotSelector(made.begin, patience=2.0), ConnectionState(1)
    tell(choice, robot, *[scan_line(k / 10) for k in range(20)])
    assert choice.consumer is None
    tell(choice, robot, scan_line(2.0))
    assert choice.consumer is made
    assert len(made.times) == 21
    assert math.isinf(made.max_range)


def test_where_no_time_is_told_scans_are_counted(
    made: Made, scan_line: ScanLine
) -> None:
    choice, robot = RobotSelector(made.begin), ConnectionState(1)
    scan = scan_line(0).replace("{Time 0.00} ", "")
    tell(choice, robot, *[scan] * (MAX_WAITING_SCANS - 1))
    assert choice.consumer is None
    tell(choice, robot, scan)
    assert len(made.times) == MAX_WAITING_SCANS


def test_one_scanner_may_be_asked_for(made: Made, scan_line: ScanLine) -> None:
    choice = RobotSelector(made.begin, scanner="lms200")
    other, robot = ConnectionState(1), ConnectionState(2)
    tell(choice, other, scan_line(1, name="sick"))
    tell(choice, robot, scan_line(1, name="sick"), scan_line(1), GEO, CONF)
    assert made.begun == [(2, "lms200")]


def test_at_the_end_what_was_waited_for_is_given_up(
    made: Made, scan_line: ScanLine
) -> None:
    choice, robot = RobotSelector(made.begin), ConnectionState(1)
    choice.finish()
    tell(choice, robot, pose(1))
    choice.finish()
    assert made.begun == []
    tell(choice, robot, scan_line(2))
    choice.finish()
    choice.finish()
    assert made.begun == [(1, "lms200")]
    assert made.times == [1, 2]


def test_of_a_long_talk_before_the_first_scan_the_end_is_kept(
    made: Made, scan_line: ScanLine
) -> None:
    choice, robot = RobotSelector(made.begin), ConnectionState(1)
    tell(choice, robot, *[pose(k) for k in range(1000)], scan_line(1000))
    choice.finish()
    assert made.times[-2:] == [999, 1000]
    assert 100 < len(made.times) < 500
