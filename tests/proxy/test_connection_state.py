"""What a listener knows of a scanner, by what was asked and by what it was given."""

import math
from collections.abc import Callable

import pytest

from radarsim.geometry import Pose3
from radarsim.protocol.commands import Drive, GetStartPoses, Init
from radarsim.protocol.reports import GroundTruth, RangeScan
from radarsim.proxy import ConnectionState, ScannerDefaults

ScanLine = Callable[..., str]
GEO = (
    "GEO {Type RangeScanner} {Name lms200 Location 0.2085,0.1,-0.2 "
    "Orientation 0,0,0.5 Mount HARD}"
)
CONF = (
    "CONF {Type RangeScanner} {Name lms200} {ScanInterval 0.1} {MinRange 0.1} "
    "{MaxRange 80.0} {Resolution 1.570796} {Fov 3.141593}"
)
ROBOT = (
    "GEO {Type GroundVehicle} {Name P3AT} {Dimensions 0.552,0.497,0.46} "
    "{COG 0,0,0} {WheelRadius 0.098} {WheelSeparation 0.36} {WheelBase 0.248}"
)
MOUNT = Pose3(0.1, 0.2, 0.3, yaw=0.4)
OPEN = "1.00,20.00,20.00,20.00,20.00"


@pytest.fixture
def overheard() -> ConnectionState:
    return ConnectionState(7)


def test_before_a_scan_nothing_is_known_of_its_scanner(
    overheard: ConnectionState, scan_line: ScanLine
) -> None:
    overheard.receive_server_line(GEO)
    overheard.receive_server_line(CONF)
    assert overheard.scanner() is None
    overheard.receive_server_line(scan_line(1))
    assert overheard.scanner("another") is None


def test_answers_of_the_server_outweigh_defaults(
    overheard: ConnectionState, scan_line: ScanLine
) -> None:
    given = ScannerDefaults(Pose3(9, 9, 9), 5.0)
    overheard.receive_server_line(scan_line(1))
    assert not overheard.is_described("lms200")
    overheard.receive_server_line(GEO)
    assert not overheard.is_described("lms200")
    overheard.receive_server_line(CONF)
    assert overheard.is_described("lms200")
    scanner = overheard.scanner(defaults=given)
    assert scanner is not None
    assert scanner.mount == Pose3(0.2085, -0.1, 0.2, yaw=-0.5)
    assert (scanner.min_range, scanner.max_range) == (0.1, 80.0)
    assert (scanner.name, scanner.beams) == ("lms200", 3)


def test_defaults_fill_what_nobody_asks_for(
    overheard: ConnectionState, scan_line: ScanLine
) -> None:
    overheard.receive_server_line(scan_line(1, OPEN))
    scanner = overheard.scanner("lms200", ScannerDefaults(MOUNT, 5.0))
    assert scanner is not None
    assert (scanner.mount, scanner.max_range) == (MOUNT, 5.0)
    assert (scanner.min_range, scanner.beams) == (0.0, 5)
    assert scanner.fov == pytest.approx(math.pi)


def test_defaults_complete_half_of_the_answers(
    overheard: ConnectionState, scan_line: ScanLine
) -> None:
    overheard.receive_server_line(scan_line(1))
    overheard.receive_server_line(GEO)
    scanner = overheard.scanner(defaults=ScannerDefaults(MOUNT, 5.0))
    assert scanner is not None
    assert (scanner.mount.x, scanner.max_range) == (0.2085, 5.0)


@pytest.mark.parametrize(
    ("ranges", "limit"),
    [
        pytest.param([OPEN, "1.00,1.00,1.00,1.00,1.00"], 20.0, id="many read the same"),
        pytest.param(["1.00,7.00,3.00,7.00,2.00"], math.inf, id="two corners"),
        pytest.param(["9.00,20.00,20.00,20.00,20.01"], math.inf, id="one read more"),
    ],
)
def test_largest_shared_range_is_the_maximum_range(
    overheard: ConnectionState, scan_line: ScanLine, ranges: list[str], limit: float
) -> None:
    for k, text in enumerate(ranges):
        overheard.receive_server_line(scan_line(k, text))
    scanner = overheard.scanner()
    assert scanner is not None
    assert (scanner.mount, scanner.max_range) == (Pose3(0, 0, 0), limit)


def test_the_scanner_that_scans_first_is_the_one(
    overheard: ConnectionState, scan_line: ScanLine
) -> None:
    for name in ("second", "first", "second"):
        overheard.receive_server_line(scan_line(1, name=name))
    names = [s.name for s in (overheard.scanner(), overheard.scanner("first")) if s]
    assert names == ["second", "first"]


def test_lines_are_parsed(overheard: ConnectionState, scan_line: ScanLine) -> None:
    truth = "SEN {Type GroundTruth} {Name t} {Location 1,2,3} {Orientation 0,0,0}"
    assert isinstance(overheard.receive_server_line(scan_line(1)), RangeScan)
    said = overheard.receive_server_line(truth)
    assert isinstance(said, GroundTruth)
    assert (said.time, said.pose) == (1.0, Pose3(1, -2, -3))
    assert overheard.receive_server_line("SEN {Type Sonar} {Name s}") is None
    assert overheard.receive_server_line("\xff{{") is None
    assert overheard.session.unread == 2
    assert overheard.receive_client_line("getstartposes") == GetStartPoses()
    assert overheard.receive_client_line("DRIVE {Left 1} {Right 2}") == Drive(1.0, 2.0)
    assert overheard.receive_client_line("DRIVE {Left x}") is None
    assert overheard.skipped_lines == 1


def test_robot_is_that_of_the_init_command(
    overheard: ConnectionState,
) -> None:
    overheard.receive_client_line("INIT {ClassName USARBot.P3AT} {Name Rob} {Start A}")
    assert overheard.robot == Init("P3AT", "Rob", "A")
    assert overheard.geometry is None
    overheard.receive_server_line(ROBOT)
    assert overheard.geometry is not None
    assert overheard.geometry.dimensions == (0.552, 0.497, 0.46)


@pytest.mark.parametrize(
    ("orders", "echoes"),
    [
        pytest.param([], False, id="none"),
        pytest.param(["{Name lms200} {Opcode ECHOES} {Params true}"], True, id="one"),
        pytest.param(["{Opcode echoes} {Params True}"], True, id="all"),
        pytest.param(["{Name b} {Opcode ECHOES} {Params true}"], False, id="another"),
        pytest.param(["{Opcode ECHOES} {Params maybe}"], False, id="neither"),
        pytest.param(["{Opcode SCAN}"], False, id="another order"),
        pytest.param(
            [
                "{Name lms200} {Opcode ECHOES} {Params true}",
                "{Opcode ECHOES} {Params false}",
            ],
            False,
            id="one, then none",
        ),
    ],
)
def test_echoes_are_expected_of_a_scanner_that_was_told_to_send_them(
    overheard: ConnectionState, orders: list[str], echoes: bool
) -> None:
    overheard.receive_client_line("SET {Type INS} {Opcode ECHOES} {Params true}")
    for order in orders:
        overheard.receive_client_line(f"SET {{Type RangeScanner}} {order}")
    assert overheard.asks_for_echoes("LMS200") is echoes


def test_names_are_the_same_in_any_case(scan_line: ScanLine) -> None:
    heard = ConnectionState(1)
    heard.receive_server_line(
        "GEO {Type RangeScanner} {Name LMS200 Location 0.2,0,0 Orientation 0,0,0"
        " Mount HARD}"
    )
    heard.receive_server_line(scan_line(1.0))
    facts = heard.scanner("lms200")
    assert facts is not None
    assert facts.mount.x == 0.2
