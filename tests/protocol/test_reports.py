import re
from dataclasses import replace
from math import inf, isinf, isnan, nan, pi, radians
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose2, Pose3, wrap_angle
from radarsim.protocol import reports
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.echoes import target_lines
from radarsim.protocol.message import Message, decode_message
from radarsim.protocol.packages import PackageState


def test_lines_end_with_crlf_and_are_ascii() -> None:
    greeting = reports.Greeting("DM-Straße").encode(COMPAT)
    assert reports.to_bytes([greeting, "NFO {StartPoses 0}"]) == (
        b"NFO {Gametype BotDeathMatch} {Level DM-Stra?e} {TimeLimit 0}\r\n"
        b"NFO {StartPoses 0}\r\n"
    )
    assert reports.to_bytes([]) == b""


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=lambda dialect: dialect.name)
@pytest.mark.parametrize("count", [1, 70, 80, 90, 1000])
def test_start_poses_fit_into_one_read_and_their_count_is_right(
    dialect: Dialect, count: int
) -> None:
    poses = [(f"RobotStart{i}", Pose3(-100, 100, 0.146)) for i in range(1, count + 1)]
    line = reports.StartPoses(tuple(poses)).encode(dialect)
    assert len(reports.to_bytes([line])) <= 4095
    message = decode_message(line)
    names = [message.segments[1][0], *message.segments[1][1].split()][::3]
    assert int(message.get("StartPoses") or "") == len(names)
    assert names == [name for name, _ in poses][: len(names)]
    spare = 4095 - len(reports.to_bytes([line]))
    assert len(names) == count or spare < len(line) / len(names) + 5


def test_angles_of_a_scan_are_even_steps_around_the_front() -> None:
    scan = reports.RangeScan(1.0, "lms200", 0.0, pi / 2, np.zeros(3))
    assert scan.angles.tolist() == [-pi / 4, 0.0, pi / 4]


@pytest.mark.parametrize("beams", [181, 192])
def test_a_full_scan_of_a_p3at_fits_into_one_read(beams: int) -> None:
    scan = reports.RangeScan(99999.99, "lms200", radians(1), pi, np.full(beams, 80.0))
    assert len(reports.to_bytes([scan.encode(COMPAT)])) <= 4095


@pytest.mark.parametrize(
    ("step", "fov"),
    [
        pytest.param(radians(1), pi, id="one degree"),
        pytest.param(radians(1), radians(359), id="full circle"),
        pytest.param(0.0184086914, 4.189, id="Hokuyo"),
    ],
)
def test_beam_count_follows_from_printed_fov_and_resolution(
    step: float, fov: float
) -> None:
    scan = reports.RangeScan(1.0, "lms200", step, fov, np.zeros(1))
    message = decode_message(scan.encode(COMPAT))
    printed_fov = float(message.get("FOV") or "")
    printed_step = float(message.get("Resolution") or "")
    assert round(printed_fov / printed_step) == round(fov / step)


@pytest.mark.parametrize(
    ("step", "fov", "beams"),
    [
        pytest.param(0.01745, 3.14159, 181, id="SICK"),
        pytest.param(radians(1), pi, 181, id="whole degrees"),
        pytest.param(0.0184086914, 4.189, 228, id="Hokuyo"),
    ],
)
def test_beam_count_follows_by_truncation_in_the_udk_dialect(
    step: float, fov: float, beams: int
) -> None:
    scan = reports.RangeScan(1.0, "lms200", step, fov, np.zeros(1))
    message = decode_message(scan.encode(UDK))
    printed_fov = float(message.get("FOV") or "")
    assert int(printed_fov / float(message.get("Resolution") or "")) + 1 == beams


UT2004 = COMPAT.of_generation("ut2004")
DIALECTS = [COMPAT, UT2004, UDK]
UNSTAMPED = [(UDK, reports.Ins), (UT2004, reports.Odometry), (UT2004, reports.Encoder)]
NUMBERS = st.floats(-1e6, 1e6) | st.floats(-1e-4, 1e-4)
NAMES = st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,9}", fullmatch=True)
POSES = st.builds(Pose3, *[NUMBERS] * 6)
NAMED = st.lists(st.tuples(NAMES, NUMBERS), max_size=3).map(tuple)
TRIPLES = st.tuples(*[NUMBERS] * 3)
TIMES = st.floats(0.01, 1e6)
ANY_TIMES = TIMES | st.just(nan)
VECTORS = st.lists(NUMBERS, min_size=1, max_size=4).map(tuple)
SHARES = st.floats(0, 1)
SEEN = st.integers(1, 4).flatmap(
    lambda count: st.builds(
        reports.TargetEchoes,
        NAMES,
        NAMES,
        st.floats(0, allow_nan=False),
        SHARES,
        st.booleans(),
        st.booleans(),
        st.lists(st.integers(0, 999_999), min_size=count, max_size=count).map(np.array),
        *[st.lists(st.floats(0, 1e5), min_size=count, max_size=count).map(np.array)],
        st.tuples(
            *[st.sampled_from(["enter", "leave", "sheet", "hit", "spent"])] * count
        ),
        *[st.lists(SHARES, min_size=count, max_size=count).map(np.array)] * 2,
    )
)
REPORTS = st.one_of(
    st.builds(reports.Greeting, NAMES),
    st.builds(
        reports.StartPoses, st.lists(st.tuples(NAMES, POSES), max_size=3).map(tuple)
    ),
    st.builds(
        reports.Status,
        *(TIMES, st.integers(-5, 99999), st.booleans()),
        st.none() | st.tuples(st.floats(0.01, 1.5), NUMBERS),
    ),
    st.builds(
        PackageState,
        *(TIMES, NAMES),
        st.lists(st.tuples(NUMBERS, st.just(-20.0)), max_size=3).map(tuple),
    ),
    # Not of motion, whose two blanks one client needs.
    st.builds(reports.Sound, TIMES, NAMES, NUMBERS, NUMBERS),
    st.builds(reports.GasDensity, TIMES, NAMES, NAMES, NUMBERS),
    st.builds(reports.RangeScan, TIMES, NAMES, NUMBERS, NUMBERS, VECTORS.map(np.array)),
    st.builds(
        reports.EchoLine, TIMES, NAMES, *[st.integers(0, 999_999)] * 2, st.none() | SEEN
    ),
    st.integers(0, 3).flatmap(
        lambda count: st.builds(
            reports.RadarTargets,
            *(TIMES, NAMES, st.integers(0, 999_999), st.integers(0, 999_999)),
            *[
                st.lists(each, min_size=count, max_size=count).map(np.array)
                for each in (st.integers(0, 999_999), NUMBERS, NUMBERS)
            ],
        )
    ),
    st.builds(reports.GroundTruth, ANY_TIMES, NAMES, POSES),
    st.builds(reports.Ins, ANY_TIMES, NAMES, POSES),
    st.builds(reports.Odometry, ANY_TIMES, NAMES, st.builds(Pose2, *[NUMBERS] * 3)),
    st.builds(reports.Tachometer, TIMES, NAMES, VECTORS, VECTORS),
    st.builds(
        reports.Encoder,
        TIMES,
        st.lists(st.tuples(NAMES, st.integers(-360, 360)), min_size=1).map(tuple),
    ),
    st.builds(reports.Touch, TIMES, NAMES, st.booleans()),
    st.builds(reports.Acceleration, TIMES, NAMES, TRIPLES),
    st.builds(reports.ProperAcceleration, TIMES, NAMES, TRIPLES),
    st.builds(
        reports.Imu,
        TIMES,
        NAMES,
        *[TRIPLES] * 3,
        st.tuples(*[st.floats(-3.1, 3.1)] * 3),
    ),
    st.builds(reports.Sonar, TIMES, NAMED),
    st.builds(
        reports.Gps,
        TIMES,
        NAMES,
        st.none() | st.tuples(st.floats(-90, 90), st.floats(-180, 180)),
        st.integers(0, 31),
    ),
    st.builds(reports.RobotGeo, NAMES, TRIPLES, TRIPLES, NUMBERS, NUMBERS, NUMBERS),
    st.builds(
        reports.RobotConf,
        *(NAMES, NUMBERS, NUMBERS, NUMBERS),
        st.none() | st.tuples(NUMBERS, NUMBERS),
    ),
    st.builds(
        reports.ItemGeo,
        NAMES,
        st.lists(st.tuples(NAMES, POSES), max_size=3).map(tuple),
        NAMES,
    ),
    st.builds(
        reports.ScannerConf,
        NAMES,
        st.lists(st.tuples(NAMES, *[NUMBERS] * 4), max_size=3).map(tuple),
    ),
    st.builds(
        reports.SonarConf,
        NAMES,
        st.lists(st.tuples(NAMES, *[NUMBERS] * 4), max_size=3).map(tuple),
    ),
    st.builds(reports.IntervalConf, NAMES, NAMED),
    st.builds(reports.EncoderConf, NAMES, NAMED),
    st.builds(reports.TouchConf, NAMES, NAMED),
    st.builds(reports.NameConf, NAMES, st.lists(NAMES, max_size=3).map(tuple)),
)
VALUE = r"[A-Za-z0-9_]+|-?[0-9]+(\.[0-9]+)?(,-?[0-9]+\.[0-9]+)*"
VALUE += r"|[0-9]+,[0-9]+\.[0-9]+,[NSEW]"
VALUE += r"|[0-9]+,[0-9]+\.[0-9]+,[A-Z][a-z]+(,[01]\.[0-9]+){2}"
LINE = re.compile(rf"(NFO|STA|MISSTA|SEN|GEO|CONF)( \{{[A-Za-z0-9_]+( ({VALUE}))+\}})+")


@given(report=REPORTS)
def test_every_line_has_the_form_that_all_clients_accept(
    report: reports.Report,
) -> None:
    line = report.encode(COMPAT)
    assert LINE.fullmatch(line)
    assert not re.search(r"-0\.0+(?![0-9])", line)


@given(report=REPORTS, dialect=st.sampled_from(DIALECTS))
def test_every_line_follows_the_message_grammar(
    report: reports.Report, dialect: Dialect
) -> None:
    line = report.encode(dialect)
    assert decode_message(line).encode() == line.replace("}{", "} {")


@given(pose=st.builds(Pose3, *[NUMBERS] * 6), dialect=st.sampled_from(DIALECTS))
def test_angles_on_the_wire_are_within_one_turn(pose: Pose3, dialect: Dialect) -> None:
    low, high = (0, 2 * pi) if dialect is UDK else (-pi, pi)
    line = reports.Ins(1.0, "InsTest", pose).encode(dialect)
    angles = (decode_message(line).get("Orientation") or "").split(",")
    for angle in angles:
        assert low - 0.005 <= float(angle) <= high + 0.005


@given(report=REPORTS)
def test_decoded_report_encodes_to_the_same_line(report: reports.Report) -> None:
    line = report.encode(COMPAT)
    assume("3.1416" not in line)  # a little more than pi, which is read as -pi
    read = reports.decode_report(line)
    assert read is not None
    assert read.encode(COMPAT) == line


@given(report=REPORTS, dialect=st.sampled_from(DIALECTS))
def test_decoded_report_equals_the_sent_one_up_to_rounding(
    report: reports.Report, dialect: Dialect
) -> None:
    read = reports.decode_report(report.encode(dialect))
    sent = _transmitted(report, dialect)
    assert type(read) is type(sent)
    assert _is_close(_numbers_and_texts(read), _numbers_and_texts(sent))


@settings(max_examples=25, suppress_health_check=[HealthCheck.filter_too_much])
@given(report=REPORTS, dialect=st.sampled_from(DIALECTS), data=st.data())
def test_field_order_does_not_matter_in_reports_of_one_item(
    report: reports.Report, dialect: Dialect, data: st.DataObject
) -> None:
    assume(
        isinstance(
            report,
            reports.Status
            | reports.RangeScan
            | reports.EchoLine
            | reports.Ins
            | reports.Odometry
            | reports.Touch
            | reports.Gps
            | reports.Sound
            | reports.GasDensity,
        )
    )
    line = report.encode(dialect)
    message = decode_message(line)
    mixed = Message(
        message.verb.lower(), tuple(data.draw(st.permutations(message.segments)))
    )
    read, same = reports.decode_report(line), reports.decode_report(mixed.encode())
    assert _is_close(_numbers_and_texts(same), _numbers_and_texts(read))


@given(
    report=REPORTS,
    dialect=st.sampled_from(DIALECTS),
    place=st.floats(0, 1),
    inserted=st.sampled_from(
        ["", "{", "}", " ", ",", "nan", "1e9999", "\xe9", "_", "-"]
    ),
    length=st.integers(0, 20),
)
def test_damaged_line_is_decoded_or_malformed(
    report: reports.Report, dialect: Dialect, place: float, inserted: str, length: int
) -> None:
    line = report.encode(dialect)
    start = int(place * len(line))
    try:
        read = reports.decode_report(line[:start] + inserted + line[start + length :])
    except MalformedMessage:
        return
    for number in _numbers_and_texts(read):
        assert not isinstance(number, float) or abs(number) <= 2**31 or not number < inf


def _transmitted(report: reports.Report, dialect: Dialect) -> reports.Report:
    """Return a report with only the values that a dialect transmits."""
    changes: dict[str, Any] = {}
    if (dialect, type(report)) in UNSTAMPED:
        changes["time"] = nan
    match report:
        case reports.Status():
            changes["battery"] = max(report.battery, dialect is not UDK)
        case PackageState(links=links) if dialect is UDK:
            changes["links"] = tuple((angle, nan) for angle, _ in links)
        case reports.RobotGeo() if dialect is UDK:
            changes["dimensions"] = (report.wheel_base, report.wheel_separation, 0.0)
        case reports.ItemGeo(mounts=mounts) if dialect is not UDK or not mounts:
            changes["robot"] = ""
        case reports.EchoLine(echoes=reports.TargetEchoes() as echoes) if (
            1e9 < echoes.density < inf
        ):
            changes["echoes"] = replace(echoes, density=1e9)
        case reports.SonarConf(items=items) if items and dialect is not UDK:
            changes["items"] = tuple((*item[:4], nan) for item in items)
        case reports.ItemConf():
            return report if report.items else reports.NameConf(report.type, ())
        case _:
            pass
    transmitted: reports.Report = replace(cast(Any, report), **changes)
    return transmitted


class Angle(float):
    """An angle, compared modulo full turns."""


def _numbers_and_texts(value: Any) -> list[Any]:
    """Return all numbers and texts in a report."""
    match value:
        case np.ndarray():
            return list(value)
        case Pose3():
            return [*value.numbers()[:3], *map(Angle, value.numbers()[3:])]
        case tuple() | list():
            return [leaf for part in value for leaf in _numbers_and_texts(part)]
        case _ if hasattr(value, "__dataclass_fields__"):
            parts = [getattr(value, name) for name in value.__dataclass_fields__]
            return _numbers_and_texts(parts)
    return [value]


def _is_close(some: list[Any], others: list[Any]) -> bool:
    """Compare up to two decimals and the 24 bits of single precision."""
    return len(some) == len(others) and all(map(_is_same, some, others))


def _is_same(one: Any, other: Any) -> bool:
    if not isinstance(one, float) or isinf(one):
        return bool(one == other)
    if isnan(one):
        return isnan(other)
    difference = one - other
    if isinstance(one, Angle):
        difference = wrap_angle(difference)
    return bool(abs(difference) < 0.011 + 2e-7 * abs(other))


OTHERS = {
    "a map without a name": ("NFO {Level }", reports.Greeting("")),
    "start poses": (
        "NFO {StartPoses 2} {A 1,2,3 0,0,1.57 B 0,0,0 0,0,4}",
        reports.StartPoses(
            (
                ("A", Pose3(1, -2, -3, 0, 0, -1.57)),
                ("B", Pose3(0, 0, 0, 0, 0, 2 * pi - 4)),
            )
        ),
    ),
    "status": (
        "STA {Type LeggedRobot} {Time 4.5} {Battery 12.7} {LightToggle true}",
        reports.Status(4.5, 12, True),
    ),
    "status of nothing but time": ("STA {Time 4.5}", reports.Status(4.5, 0, False)),
    "whole turns, blanks, any case": (
        "SEN {Time 1} {Type groundtruth} {Name G} {Location 1 2 3}"
        " {Orientation 0, 0, 6.0}",
        reports.GroundTruth(1, "G", Pose3(1, -2, -3, 0, 0, 2 * pi - 6)),
    ),
    "no encoder at all": ("SEN {Time 2} {Type Encoder}", reports.Encoder(2, ())),
    "GPS": (
        "SEN {Time 2} {Type GPS} {Name G} {Latitude 39, 30, s} {Satellites 8}"
        " {Longitude 122,15.0,W} {Fix 1}",
        reports.Gps(2, "G", (-39.5, -122.25), 8),
    ),
    "settings of a sonar without a minimum range": (
        "CONF {Type Sonar} {Name F1} {MaxRange 10.668} {BeamAngle 0.35}"
        " {ScanInterval 0.5}",
        reports.SonarConf("Sonar", (("F1", 10.668, 0.0, 0.35, 0.5),)),
    ),
    "touch in one segment": (
        "SEN {Time 2} {Type Touch} {Name T  touch  false}",
        reports.Touch(2, "T", False),
    ),
    "a scan without echoes": (
        "SEN {Time 2} {Type Echoes} {Name lms200} {Line 0} {Lines 0}",
        reports.EchoLine(2, "lms200", 0, 0, None),
    ),
}


@pytest.mark.parametrize(("line", "expected"), OTHERS.values(), ids=OTHERS)
def test_lines_of_other_servers_are_decoded(
    line: str, expected: reports.Report
) -> None:
    assert reports.decode_report(line) == expected


@pytest.mark.parametrize(
    "ranges", ["1.5,2,3.25", "1.5, 2, 3.25", "1.5 2 3.25", "1.5,2,3.25,"]
)
def test_ranges_are_decoded_with_any_separator(ranges: str) -> None:
    read = reports.decode_report(
        f"SEN {{Range {ranges}}} {{FOV 2}} {{Resolution 1}} {{Type RangeScanner}}"
    )
    assert isinstance(read, reports.RangeScan)
    assert np.array_equal(read.ranges, [1.5, 2, 3.25])
    assert (read.name, read.resolution, read.fov) == ("", 1, 2)


@pytest.mark.parametrize(
    "line",
    [
        pytest.param("RES {Type Camera}", id="other verb"),
        pytest.param("NFO {Gametype Nothing}", id="nothing in the info"),
        pytest.param("SEN {Time 1} {Type IR} {Name F1 Range 2}", id="other sensor"),
        pytest.param("hello", id="a word"),
    ],
)
def test_unknown_report_decodes_to_none(line: str) -> None:
    assert reports.decode_report(line) is None


SCAN = "SEN {Time 1} {Type RangeScanner} {Name S} {Resolution 1}"
ECHOES = "SEN {Type Echoes} {Line 1} {Lines 1} {Object a} {Material b} {Density 1}"
ECHOES += " {Transparency 1} {LaserPasses False} {RobotPasses False}"


MALFORMED = {
    "no range": ("SEN {Type Sonar} {Name F1}", "expected a field '{Range ...}'"),
    "latitude without a letter": (
        "SEN {Type GPS} {Name G} {Fix 1} {Latitude 39,8.0}",
        "SEN Latitude: '39,8.0', expected degrees, minutes, and N, S, E or W",
    ),
    "latitude without minutes": (
        "SEN {Type GPS} {Name G} {Fix 1} {Latitude 39,N}",
        "SEN Latitude: '39', expected 2 numbers",
    ),
    "GPS of no known state": (
        "SEN {Type GPS} {Name G} {Satellites 3}",
        "expected a field '{Fix ...}'",
    ),
    "no ranges": (f"{SCAN} {{FOV 1}} {{Range }}", "'{Range ...}'"),
    "no number": (
        f"{SCAN} {{FOV 1}} {{Range 1,nan}}",
        "SEN Range: '1,nan', expected numbers",
    ),
    "two points": (f"{SCAN} {{FOV 1}} {{Range 1.2.3}}", "expected numbers"),
    "too far": (f"{SCAN} {{FOV 1}} {{Range 1,1e10}}", "expected at most .* each"),
    "half a start pose": (
        "NFO {StartPoses 1} {A 1,2,3}",
        r"start poses 'A 1,2,3', expected 'name x,y,z roll,pitch,yaw'",
    ),
    "no touch": ("SEN {Type Touch} {Name T}", "'{Touch ...}'"),
    "short echo": (
        f"{ECHOES} {{Echoes 1,2,Hit,1}}",
        "echo '1,2,Hit,1', expected five values",
    ),
    "echo of no range": (
        f"{ECHOES} {{Echoes 1,,Hit,1,1}}",
        "'1,,1,1', expected numbers",
    ),
    "target without power": (
        "SEN {Type RadarTargets} {Name N} {Line 1} {Lines 1} {Targets 1,2}",
        "target '1,2', expected three numbers",
    ),
    "empty echoes": (f"{ECHOES} {{Echoes }}", "'{Echoes ...}'"),
}


@pytest.mark.parametrize(("line", "message"), MALFORMED.values(), ids=MALFORMED)
def test_malformed_report_of_a_known_type_raises_an_error(
    line: str, message: str
) -> None:
    with pytest.raises(MalformedMessage, match=message):
        reports.decode_report(line)


def test_echoes_with_blanks_in_names_are_decoded() -> None:
    line = ECHOES.replace("Object a", "Object box of tin") + " {Echoes 3,2.5,Hit,1,0.5}"
    read = reports.decode_report(line)
    assert isinstance(read, reports.EchoLine)
    assert isnan(read.time)
    assert read.echoes is not None
    assert (read.echoes.object, read.echoes.kinds) == ("box of tin", ("hit",))
    assert read.echoes.beams.tolist() == [3]
    assert read.echoes.beams.dtype == np.int64
    assert read.echoes.ranges.tolist() == [2.5]


@pytest.mark.parametrize(
    ("targets", "sizes"), [(0, [0]), (1, [1]), (130, [130]), (131, [130, 1])]
)
def test_targets_of_a_turn_fill_lines(targets: int, sizes: list[int]) -> None:
    ranges = np.linspace(0.5, 40.0, targets)
    lines = target_lines(4.0, "N", np.arange(targets), ranges, -60.0 - ranges)
    count = len(sizes) if targets else 0
    numbers = range(1, count + 1) if targets else [0]
    assert [(line.line, line.lines) for line in lines] == [(n, count) for n in numbers]
    assert [len(line.beams) for line in lines] == sizes
    for line in lines:
        text = line.encode(COMPAT)
        assert len(text) < 4096
        read = reports.decode_report(text)
        assert isinstance(read, reports.RadarTargets)
        assert read.beams.tolist() == line.beams.tolist()
        assert read.ranges == pytest.approx(line.ranges, abs=0.0051)
        assert read.dbm == pytest.approx(line.dbm, abs=0.0051)


@pytest.mark.parametrize(
    "line",
    [
        "GEO {Type MisPkg} {Name Cam} {Link 1} {ParentLink -1} {Location 0,0,0}",
        "CONF {Type MisPkg} {Name Cam} {Link 1} {MaxRange 2} {JointType Revolute}",
        "CONF {Type Camera} {Name Camera} {CameraDefFov 0.8} {CameraMinFov 0.4}",
    ],
)
def test_links_and_cameras_are_of_unknown_kinds(line: str) -> None:
    assert reports.decode_report(line) is None


def test_a_package_may_have_no_links() -> None:
    message = decode_message("MISSTA {Time 1.00} {Name Arm}")
    assert PackageState.decode(message) == PackageState(1.0, "Arm", ())
