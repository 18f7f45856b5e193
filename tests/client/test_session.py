from itertools import pairwise
from math import atan, isnan, pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.client import session as questions
from radarsim.client.session import Question, Session, drive
from radarsim.geometry import Pose3
from radarsim.protocol.commands import Drive, parse_command
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.reports import (
    Encoder,
    Gps,
    Greeting,
    GroundTruth,
    Ins,
    IntervalConf,
    ItemGeo,
    NameConf,
    RangeScan,
    Report,
    RobotConf,
    RobotGeo,
    ScannerConf,
    Sonar,
    SonarConf,
    StartPoses,
    Status,
    to_bytes,
)
from radarsim.scene.scene import GPS_ORIGIN, Scene
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

HERE = Pose3(1, 2, 3)
REPORTS: list[Report] = [
    Greeting("DM-Yard"),
    Status(0.5, 9, False),
    Ins(0.75, "I", HERE),
    RangeScan(1.0, "S", pi / 1080, pi, np.linspace(0, 80, 1081)),
]
STREAM = to_bytes(report.encode(COMPAT) for report in REPORTS)
GEO = RobotGeo("P3AT", (1, 1, 1), (0, 0, 0), 0.1, 0.4, 0.3)


@given(cuts=st.lists(st.integers(0, len(STREAM)), max_size=20))
def test_reports_do_not_depend_on_how_the_stream_is_split(cuts: list[int]) -> None:
    session = Session()
    edges = [0, *sorted(cuts), len(STREAM)]
    reports: list[Report] = []
    for start, end in pairwise(edges):
        reports += session.receive(STREAM[start:end])
    assert reports[:-1] == REPORTS[:-1]
    scan = reports[-1]
    assert isinstance(scan, RangeScan)
    assert len(scan.ranges) == 1081
    assert session.scans == {"S": scan}
    assert (session.greeting, session.time, session.unread) == (REPORTS[0], 1.0, 0)


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=["compat", "udk"])
def test_sonars_gps_and_encoders_are_read_with_a_time(
    empty_room: Scene, dialect: Dialect
) -> None:
    host = Host(empty_room, config=SimulationConfig(dialect))
    number = host.connect()
    host.receive(number, b"INIT {ClassName USARBot.P2AT} {Location -8,0,0}\r\n")
    for _ in range(20):
        host.step()
    session = Session()
    reports = session.receive(host.take(number))
    assert session.unread == 0
    sonars = [report for report in reports if isinstance(report, Sonar)]
    ranges = dict(pair for report in sonars for pair in report.ranges)
    assert list(ranges) == [f"{side}{i}" for side in "FR" for i in range(1, 9)]
    assert ranges["R4"] == pytest.approx(10.4 - 8.24, abs=1e-3)
    gps = [report for report in reports if isinstance(report, Gps)]
    assert gps[-1].satellites == 11
    assert gps[-1].position == pytest.approx(GPS_ORIGIN, abs=1e-3)
    encoders = [report for report in reports if isinstance(report, Encoder)]
    ticks = dict(pair for report in encoders for pair in report.ticks)
    assert list(ticks) == ["ECLeft", "ECRight"]
    stamped = [*sonars, *gps, *encoders]
    assert {report.time for report in stamped} == {0.1, 0.2}
    conf = SonarConf("Sonar", (("F1", 5, 0.1, 0.35, 0.2),))
    question = questions.configuration("sonar", "F1")
    assert question.accepts(conf)
    assert not question.accepts(IntervalConf("GPS", (("GPS", 0.2),)))


@given(data=st.lists(st.binary(max_size=50), max_size=20))
def test_no_bytes_break_a_session(data: list[bytes]) -> None:
    session = Session()
    for chunk in data:
        session.receive(chunk)
    session.receive(b"\r\n")
    assert session.receive(STREAM)[:2] == REPORTS[:2]


@pytest.mark.parametrize("size", [1000, 65536, 65537, 200_000])
@pytest.mark.parametrize("chunk", [4096, 70_000, 10**6])
def test_only_the_overlong_line_is_lost(size: int, chunk: int) -> None:
    session = Session()
    data = STREAM + b"x" * size + b"\n" + STREAM
    reports: list[Report] = []
    for start in range(0, len(data), chunk):
        reports += session.receive(data[start : start + chunk])
    assert [type(report) for report in reports] == 2 * [type(r) for r in REPORTS]
    assert session.unread >= 1


def test_ignored_lines_are_passed_over() -> None:
    session = Session()
    session.ignored = ("SEN ",)
    assert session.receive(STREAM) == REPORTS[:2]
    assert session.unread == 0
    session.ignored = ()
    assert len(session.receive(STREAM)) == len(REPORTS)


def test_report_without_time_gets_the_latest_time() -> None:
    session = Session()
    line = b"SEN {Type INS} {Name I} {Location 1,-2,-3} {Orientation 0,0,0}\r\n"
    assert isnan(session.time)
    (report,) = session.receive(line)
    assert isinstance(report, Ins)
    assert isnan(report.time)
    session.receive(b"STA {Time 3.50}\r\nSTA {Time 2.50}\r\nSTA {Battery 3}\r\n")
    assert session.receive(line) == [Ins(3.5, "I", HERE)]


@pytest.mark.parametrize(
    "fields",
    [
        "{FOV 0} {Range 1,2}",
        "{FOV -3.14} {Range 1,2}",
        "{FOV 180} {Range 1,2}",
        "{FOV 3.14} {Range 1,-2}",
        "{FOV 3.14} {Range 1,nan}",
    ],
)
def test_implausible_scan_is_skipped(fields: str) -> None:
    session = Session()
    line = f"SEN {{Type RangeScanner}} {{Name S}} {{Resolution 0.1}} {fields}\r\n"
    assert session.receive(line.encode()) == []
    assert (session.unread, session.scans) == (1, {})


def test_scan_of_one_beam_may_have_zero_fov() -> None:
    line = b"SEN {Type RangeScanner} {Name S} {Resolution 0} {FOV 0} {Range 2}\r\n"
    assert len(Session().receive(line)) == 1


def test_unknown_lines_are_counted_and_the_last_line_is_stored() -> None:
    session = Session()
    lines = b"RES {Type Camera}\r\nSEN {Type INS} {Name I}\r\n}{\r\n\r\n  \r\nhello\n"
    assert session.receive(lines) == []
    assert (session.unread, session.last) == (4, "hello")


@pytest.mark.parametrize(
    ("question", "answer", "others"),
    [
        (questions.start_poses(), StartPoses(()), [Greeting("a")]),
        (
            questions.geometry("robot"),
            GEO,
            [ItemGeo("Robot", (), ""), RobotConf("P3AT", 1, 1, 1)],
        ),
        (
            questions.geometry("INS"),
            ItemGeo("ins", (("I", HERE),), ""),
            [GEO, ItemGeo("Odometry", (), "")],
        ),
        (
            questions.geometry("INS", "i"),
            ItemGeo("INS", (("I", HERE),), ""),
            [ItemGeo("INS", (("J", HERE),), ""), ItemGeo("INS", (), "")],
        ),
        (
            questions.configuration("Robot"),
            RobotConf("P3AT", 1, 1, 1),
            [GEO, IntervalConf("Robot", ())],
        ),
        (
            questions.configuration("RangeScanner"),
            ScannerConf("rangescanner", (("S", 1, 1, 1, 1),)),
            [ItemGeo("RangeScanner", (), ""), IntervalConf("INS", ())],
        ),
        (
            questions.configuration("INS", "I"),
            IntervalConf("INS", (("i", 0.1),)),
            [IntervalConf("INS", (("J", 0.1),)), NameConf("INS", ("J",))],
        ),
        (
            questions.configuration("Camera", "C"),
            NameConf("Camera", ("C",)),
            [NameConf("Camera", ()), NameConf("Lamp", ("C",))],
        ),
        (questions.spawn("P3AT"), GroundTruth(1, "G", HERE), [Greeting("a"), GEO]),
    ],
)
def test_question_accepts_only_its_reply(
    question: Question, answer: Report, others: list[Report]
) -> None:
    assert question.accepts(answer)
    assert not any(question.accepts(other) for other in others)


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (questions.geometry("INS", "I").data, b"GETGEO {Type INS} {Name I}"),
        (
            questions.echoes("S", on=False),
            b"SET {Type RangeScanner} {Name S} {Opcode ECHOES} {Params false}",
        ),
        (
            questions.set_item("Odometry", None, "RESET"),
            b"SET {Type Odometry} {Opcode RESET}",
        ),
    ],
)
def test_requests_are_encoded_as_usarsim_lines(data: bytes, line: bytes) -> None:
    assert data == (line and line + b"\r\n")


CONF = b"CONF {Type GroundVehicle} {Name Hummer} {SteeringType %s} {Mass 2360} "
LIMITS = b"{MaxSpeed 14.8} {MaxTorque 1} {MaxFrontSteer 0.4363} {MaxRearSteer 0}\r\n"
SHAPE = (
    b"GEO {Type GroundVehicle} {Name %s} {Dimensions 4.57,2.16,2.1} {COG 0,0,0} "
    b"{WheelRadius 0.47} {WheelSeparation 1.82} {WheelBase 3.3}\r\n"
)


@pytest.mark.parametrize(
    ("left", "right", "speed", "angle"),
    [
        (2.0, 2.0, 2.0, 0.0),
        (1.0, 3.0, 2.0, atan(3.3 * 2 / 1.82 / 2)),
        (-1.0, -3.0, -2.0, atan(3.3 * 2 / 1.82 / 2)),
        (3.0, -3.0, 3.0, -pi / 2),
        (0.0, 0.0, 0.0, 0.0),
    ],
)
def test_a_car_is_steered_in_the_same_curve(
    left: float, right: float, speed: float, angle: float
) -> None:
    session = Session()
    session.receive(CONF % b"AckermanSteered" + LIMITS)
    assert session.car is None
    session.receive(SHAPE % b"Sedan")
    assert session.car is None  # of a robot before
    session.receive(SHAPE % b"Hummer")
    command, *_ = parse_command(
        drive(left, right, session.car).decode().strip(), COMPAT
    )
    assert isinstance(command, Drive)
    assert command.speed == pytest.approx(speed)
    assert command.front_steer == pytest.approx(angle)
    session.receive(CONF % b"SkidSteered" + LIMITS)
    assert session.car is None
    assert drive(left, right, session.car).startswith(b"DRIVE {Left ")
