"""The state of a connection, from its lines and from defaults."""

import math
from collections.abc import Callable

import pytest

from radarsim.autonomy.proxy import ConnectionState, ScannerDefaults
from radarsim.geometry import Pose3
from radarsim.protocol.commands import Drive, GetStartPoses, Init
from radarsim.protocol.reports import GroundTruth, RangeScan

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
def connection() -> ConnectionState:
    return ConnectionState(7)


def test_scanner_is_unknown_before_its_first_scan(
    connection: ConnectionState, scan_line: ScanLine
) -> None:
    connection.receive_server_line(GEO)
    connection.receive_server_line(CONF)
    assert connection.scanner() is None
    connection.receive_server_line(scan_line(1))
    assert connection.scanner("another") is None


def test_answers_of_the_server_override_defaults(
    connection: ConnectionState, scan_line: ScanLine
) -> None:
    given = ScannerDefaults(Pose3(9, 9, 9), 5.0)
    connection.receive_server_line(scan_line(1))
    assert not connection.is_described("lms200")
    connection.receive_server_line(GEO)
    assert not connection.is_described("lms200")
    connection.receive_server_line(CONF)
    assert connection.is_described("lms200")
    scanner = connection.scanner(defaults=given)
    assert scanner is not None
    assert scanner.mount == Pose3(0.2085, -0.1, 0.2, yaw=-0.5)
    assert (scanner.min_range, scanner.max_range) == (0.1, 80.0)
    assert (scanner.name, scanner.beams) == ("lms200", 3)


def test_defaults_replace_answers_that_were_not_requested(
    connection: ConnectionState, scan_line: ScanLine
) -> None:
    connection.receive_server_line(scan_line(1, OPEN))
    scanner = connection.scanner("lms200", ScannerDefaults(MOUNT, 5.0))
    assert scanner is not None
    assert (scanner.mount, scanner.max_range) == (MOUNT, 5.0)
    assert (scanner.min_range, scanner.beams) == (0.0, 5)
    assert scanner.fov == pytest.approx(math.pi)


def test_defaults_complete_half_of_the_answers(
    connection: ConnectionState, scan_line: ScanLine
) -> None:
    connection.receive_server_line(scan_line(1))
    connection.receive_server_line(GEO)
    scanner = connection.scanner(defaults=ScannerDefaults(MOUNT, 5.0))
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
    connection: ConnectionState, scan_line: ScanLine, ranges: list[str], limit: float
) -> None:
    for k, text in enumerate(ranges):
        connection.receive_server_line(scan_line(k, text))
    scanner = connection.scanner()
    assert scanner is not None
    assert (scanner.mount, scanner.max_range) == (Pose3(0, 0, 0), limit)


def test_scanner_with_the_first_scan_is_selected(
    connection: ConnectionState, scan_line: ScanLine
) -> None:
    for name in ("second", "first", "second"):
        connection.receive_server_line(scan_line(1, name=name))
    names = [s.name for s in (connection.scanner(), connection.scanner("first")) if s]
    assert names == ["second", "first"]


def test_lines_are_parsed(connection: ConnectionState, scan_line: ScanLine) -> None:
    truth = "SEN {Type GroundTruth} {Name t} {Location 1,2,3} {Orientation 0,0,0}"
    assert isinstance(connection.receive_server_line(scan_line(1)), RangeScan)
    said = connection.receive_server_line(truth)
    assert isinstance(said, GroundTruth)
    assert (said.time, said.pose) == (1.0, Pose3(1, -2, -3))
    assert connection.receive_server_line("SEN {Type Sonar} {Name s}") is None
    assert connection.receive_server_line("\xff{{") is None
    assert connection.session.unread == 2
    assert connection.receive_client_line("getstartposes") == GetStartPoses()
    assert connection.receive_client_line("DRIVE {Left 1} {Right 2}") == Drive(1.0, 2.0)
    assert connection.receive_client_line("DRIVE {Left x}") is None
    assert connection.skipped_lines == 1


def test_robot_is_that_of_the_init_command(
    connection: ConnectionState,
) -> None:
    connection.receive_client_line("INIT {ClassName USARBot.P3AT} {Name Rob} {Start A}")
    assert connection.robot == Init("P3AT", "Rob", "A")
    assert connection.geometry is None
    connection.receive_server_line(ROBOT)
    assert connection.geometry is not None
    assert connection.geometry.dimensions == (0.552, 0.497, 0.46)


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
def test_echoes_are_expected_after_they_were_enabled(
    connection: ConnectionState, orders: list[str], echoes: bool
) -> None:
    connection.receive_client_line("SET {Type INS} {Opcode ECHOES} {Params true}")
    for order in orders:
        connection.receive_client_line(f"SET {{Type RangeScanner}} {order}")
    assert connection.asks_for_echoes("LMS200") is echoes


def test_names_ignore_case(scan_line: ScanLine) -> None:
    connection = ConnectionState(1)
    connection.receive_server_line(
        "GEO {Type RangeScanner} {Name LMS200 Location 0.2,0,0 Orientation 0,0,0"
        " Mount HARD}"
    )
    connection.receive_server_line(scan_line(1.0))
    facts = connection.scanner("lms200")
    assert facts is not None
    assert facts.mount.x == 0.2
