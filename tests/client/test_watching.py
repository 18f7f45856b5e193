"""Clients that watch robots get copies of their reports."""

import math
from collections.abc import Callable

import pytest
from host_client import DIALECTS

from radarsim.addons.testing import UsarsimServer
from radarsim.client import Client, ClientError
from radarsim.client import session as questions
from radarsim.client.session import MOST_WATCHED, Session
from radarsim.protocol.dialect import COMPAT, Dialect
from radarsim.protocol.reports import (
    ClockTick,
    CommandError,
    EchoLine,
    Ins,
    RangeScan,
    Report,
    RobotGeo,
    RobotJoined,
    RobotLeft,
    Status,
    WatchedLine,
    Watching,
)
from radarsim.protocol.watch import RobotChoice
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

Connect = Callable[..., Client]
INIT = b"INIT {ClassName P3AT} {Name R1} {Start RobotStart1}\r\n"


def exchange(host: Host, number: int, session: Session, ticks: int) -> list[Report]:
    """Let time pass, and return what a session reads of what a client gets."""
    reports = session.receive(host.take(number))
    for _ in range(ticks):
        host.step()
        reports += session.receive(host.take(number))
    return reports


@pytest.mark.usarsim(speed=5, map="foliage_room")
def test_client_watches_the_robot_of_another(
    usarsim_server: UsarsimServer, connect: Connect
) -> None:
    driver, watcher = connect(usarsim_server.port), connect(usarsim_server.port)
    watcher.watch(echoes="R1")
    answer = watcher.wait_for(Watching)
    assert answer == Watching(RobotChoice(None), RobotChoice(("R1",)))
    driver.spawn("P3AT", name="R1", start="RobotStart1")
    assert watcher.wait_for(RobotJoined) == RobotJoined("R1", "P3AT")
    seen = watcher.wait_for(WatchedLine)
    assert seen.robot == "R1"
    while not isinstance(watcher.wait_for(WatchedLine).report, EchoLine):
        pass
    assert watcher.geometry("Robot", robot="r1") == driver.geometry("Robot")
    for kind in ("RangeScanner", "INS"):
        watched = watcher.configuration(kind, robot="R1")
        assert watched == driver.configuration(kind)
    with pytest.raises(ClientError, match="R9"):
        watcher.geometry("Robot", robot="R9")
    while not isinstance(watcher.wait_for(WatchedLine).report, RobotGeo):
        driver.geometry("Robot")  # each time, as a slow watcher loses the oldest copies
    driver.close()
    assert watcher.wait_for(RobotLeft, timeout=30) == RobotLeft("R1")
    watcher.watch([])
    watcher.start_poses()
    assert watcher.session.unread == 0


@DIALECTS
def test_watched_reports_are_those_of_the_robots_own_client(
    foliage_room: Scene, dialect: Dialect
) -> None:
    host = Host(foliage_room, config=SimulationConfig(dialect))
    driver, watcher = host.connect(), host.connect()
    own, other = Session(), Session()
    host.receive(driver, INIT)
    host.receive(watcher, questions.watch("r1", False))
    reports: list[Report] = []
    copies: list[Report] = []
    for _ in range(60):
        host.step()
        reports += own.receive(host.take(driver))
        copies += other.receive(host.take(watcher))
    greeting, answer, *others = copies
    assert greeting == reports[0]
    assert answer == Watching(RobotChoice(("r1",)))
    seen = [copy.report for copy in others if isinstance(copy, WatchedLine)]
    assert len(seen) == len(others)
    assert [repr(report) for report in seen] == [repr(each) for each in reports[1:]]
    assert other.watched["R1"].time == own.time > 0
    assert math.isnan(other.time)
    assert other.scans == {}
    scan = other.watched["R1"].scans["lms200"]
    assert scan.ranges.tolist() == own.scans["lms200"].ranges.tolist()
    assert other.unread == own.unread == 0


def test_copy_without_a_time_gets_the_latest_of_its_robot() -> None:
    session = Session()
    copies = session.receive(
        b"SEE {Robot A} STA {Type GroundVehicle} {Time 5.00} {Battery 9}\r\n"
        b"STA {Type GroundVehicle} {Time 9.00} {Battery 9}\r\n"
        b"SEE {Robot A} SEN {Type INS} {Name I} {Location 0,0,0}"
        b" {Orientation 0,0,0}\r\n"
    )
    assert isinstance(copies[2], WatchedLine)
    assert isinstance(copies[2].report, Ins)
    assert copies[2].report.time == 5.0
    assert session.time == 9.0


def test_copies_come_without_reports_where_these_are_not_wanted() -> None:
    session = Session()
    session.reads_copies = False
    line = "STA {Type GroundVehicle} {Time 5.00} {Battery 9}"
    copies = session.receive(f"SEE {{Robot A}} {line}\r\n{line}\r\n".encode())
    assert copies[0] == WatchedLine("A", line, None)
    assert isinstance(copies[1], Status)


def test_copy_of_an_unknown_line_has_no_report() -> None:
    session = Session()
    copies = session.receive(
        b"see{robot A}RES {Type Gripper}\r\n"
        b"SEE {Robot A} SEE {Robot B} STA {Time 1.00}\r\n"
        b"SEE {Robot A} SEN {Type RangeScanner} {Name L} {Resolution 1} {FOV 900}"
        b" {Range 1,2}\r\n"
    )
    assert [copy.report for copy in copies if isinstance(copy, WatchedLine)] == [
        None,
        None,
        None,
    ]
    assert session.unread == 0


@pytest.mark.parametrize(
    "line",
    [
        *("SEE", "SEE {Robot A}", "SEE STA {Time 1.00}", "SEE {Robot A} STA {Time"),
        *(
            "SEEK {Robot A} STA {Time 1.00}",
            "NFO {Joined R1}",
            "NFO {Other 1}",
            "NFO {Watching ,}",
            "NFO {Watching All}",
        ),
    ],
)
def test_incomplete_copy_is_skipped_and_counted(line: str) -> None:
    session = Session()
    assert session.receive(f"{line}\r\n".encode()) == []
    assert session.unread == 1


def test_news_of_robots_and_errors_are_reports() -> None:
    session = Session()
    status = "STA {Type GroundVehicle} {Time 5.00} {Battery 9}"
    watched: list[Report] = [
        Watching(RobotChoice(("a", "b")), RobotChoice(("b",))),
        RobotJoined("R 1", "P3AT"),
        WatchedLine("R 1", status, Status(5.0, 9, light=False)),
        RobotLeft("R 1"),
        CommandError("R2, expected R1"),
    ]
    lines = [report.encode(COMPAT) for report in watched]
    data = [f"{line}\r\n".encode() for line in lines]
    assert session.receive(b"".join(data[:3])) == watched[:3]
    assert list(session.watched) == ["R 1"]
    assert session.receive(b"".join(data[3:])) == watched[3:]
    assert session.watched == {}


def test_number_of_watched_robots_that_are_remembered_is_limited() -> None:
    session = Session()
    for number in range(MOST_WATCHED + 5):
        session.receive(b"SEE {Robot %d} STA {Time 1.00}\r\n" % number)
    assert len(session.watched) == MOST_WATCHED
    assert "0" not in session.watched
    assert str(MOST_WATCHED + 4) in session.watched


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (questions.watch(None, False), b"WATCH {Robots All}\r\n"),
        (questions.watch([], False), b"WATCH {Robots None}\r\n"),
        (questions.watch("R 1", True), b"WATCH {Robots R 1} {Echoes All}\r\n"),
        (questions.watch(("a", "b"), ["b"]), b"WATCH {Robots a,b} {Echoes b}\r\n"),
        (questions.watch("x}\r\nINIT", False), b"WATCH {Robots x? INIT}\r\n"),
    ],
)
def test_watch_is_one_line(data: bytes, line: bytes) -> None:
    assert data == line


@pytest.mark.parametrize("name", ["", "  ", "a,b"])
def test_name_that_cannot_be_listed_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="without commas"):
        questions.watch([name], False)


@pytest.mark.parametrize(
    ("scanner", "settings", "params"),
    [
        (
            "L",
            {"side_offset_uu": 50},
            b"{Name L} {Opcode SETTING} {Params side_offset_uu=50}",
        ),
        (None, {"a": 1e-7, "b": True}, b"{Opcode SETTING} {Params a=1e-07 b=true}"),
        (
            None,
            {"a": math.inf, "b": -math.inf, "c": None, "d": (1, 2.5), "e": "first"},
            b"{Opcode SETTING} {Params a=.inf b=-.inf c=null d=[1,2.5] e=first}",
        ),
    ],
)
def test_settings_are_one_line(
    scanner: str | None, settings: dict[str, object], params: bytes
) -> None:
    data = questions.change_settings(scanner, settings)
    assert data == b"SET {Type RangeScanner} %b\r\n" % params


def test_no_settings_are_refused() -> None:
    with pytest.raises(ValueError, match="no settings"):
        questions.change_settings("lms200", {})
    with pytest.raises(ValueError, match="braces"):
        questions.change_settings("lms200", {"a": "}\r\nINIT {"})


def test_answer_about_another_robot_is_known_among_others() -> None:
    question = questions.geometry("Robot", robot="R1")
    geo = RobotGeo("P3AT", (1, 1, 1), (0, 0, 0), 0.1, 0.4, 0.3)
    assert question.accepts(WatchedLine("r1", "", geo))
    assert question.accepts(CommandError("it is not there"))
    for other in (geo, WatchedLine("R2", "", geo), WatchedLine("R1", "", None)):
        assert not question.accepts(other)


@DIALECTS
def test_clock_is_reported_in_every_tick(empty_room: Scene, dialect: Dialect) -> None:
    host = Host(empty_room, config=SimulationConfig(dialect))
    number, session = host.connect(), Session()
    host.receive(number, questions.watch(None, False, clock=True))
    reports = exchange(host, number, session, 250)
    times = [each.time for each in reports if isinstance(each, ClockTick)]
    assert times == pytest.approx([tick / 100 for tick in range(1, 251)])
    host.receive(number, questions.watch(None, False))
    assert not any(
        isinstance(each, ClockTick) for each in exchange(host, number, session, 9)
    )


def test_scan_of_a_watched_robot_is_not_one_of_the_clients_own(
    empty_room: Scene,
) -> None:
    host = Host(empty_room)
    number, session = host.connect(), Session()
    host.receive(number, INIT + b"WATCH {Robots R1}\r\n")
    reports = exchange(host, number, session, 20)
    own = [report for report in reports if isinstance(report, RangeScan)]
    copies = [report for report in reports if isinstance(report, WatchedLine)]
    assert session.scans["lms200"] is own[-1]
    assert session.watched["R1"].scans["lms200"] is copies[-1].report
