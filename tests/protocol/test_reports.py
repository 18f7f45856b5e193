import re
from dataclasses import replace
from math import inf, isinf, isnan, nan, pi, radians
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose2, Pose3, wrap_angle
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.message import Message, decode_message
from radarsim.protocol.reports import (
    EchoLine,
    Encoder,
    EncoderConf,
    Greeting,
    GroundTruth,
    Ins,
    IntervalConf,
    ItemGeo,
    NameConf,
    Odometry,
    RangeScan,
    Report,
    RobotConf,
    RobotGeo,
    ScannerConf,
    StartPoses,
    Status,
    Tachometer,
    TargetEchoes,
    Touch,
    TouchConf,
    decode_report,
    to_bytes,
)


def test_lines_end_with_crlf_and_are_ascii() -> None:
    greeting = Greeting("DM-Straße").encode(COMPAT)
    assert to_bytes([greeting, "NFO {StartPoses 0}"]) == (
        b"NFO {Gametype BotDeathMatch} {Level DM-Stra?e} {TimeLimit 0}\r\n"
        b"NFO {StartPoses 0}\r\n"
    )
    assert to_bytes([]) == b""


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=lambda dialect: dialect.name)
@pytest.mark.parametrize("count", [1, 70, 80, 90, 1000])
def test_start_poses_fit_into_one_read_and_their_count_is_right(
    dialect: Dialect, count: int
) -> None:
    poses = [(f"RobotStart{i}", Pose3(-100, 100, 0.146)) for i in range(1, count + 1)]
    line = StartPoses(tuple(poses)).encode(dialect)
    assert len(to_bytes([line])) <= 4095
    message = decode_message(line)
    names = [message.segments[1][0], *message.segments[1][1].split()][::3]
    assert int(message.get("StartPoses") or "") == len(names)
    assert names == [name for name, _ in poses][: len(names)]
    spare = 4095 - len(to_bytes([line]))
    assert len(names) == count or spare < len(line) / len(names) + 5


@pytest.mark.parametrize("beams", [181, 192])
def test_a_full_scan_of_a_p3at_fits_into_one_read(beams: int) -> None:
    scan = RangeScan(99999.99, "lms200", radians(1), pi, np.full(beams, 80.0))
    assert len(to_bytes([scan.encode(COMPAT)])) <= 4095


@pytest.mark.parametrize(
    ("step", "fov"),
    [
        pytest.param(radians(1), pi, id="one degree"),
        pytest.param(radians(0.5), radians(90), id="half a degree"),
        pytest.param(radians(1), radians(359), id="full circle"),
        pytest.param(0.0184086914, 4.189, id="Hokuyo"),
    ],
)
def test_the_number_of_beams_follows_from_what_is_printed(
    step: float, fov: float
) -> None:
    scan = RangeScan(1.0, "lms200", step, fov, np.zeros(1))
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
def test_clients_of_the_original_count_the_beams_by_cutting(
    step: float, fov: float, beams: int
) -> None:
    scan = RangeScan(1.0, "lms200", step, fov, np.zeros(1))
    message = decode_message(scan.encode(UDK))
    printed_fov = float(message.get("FOV") or "")
    assert int(printed_fov / float(message.get("Resolution") or "")) + 1 == beams


@pytest.mark.parametrize("dialect", [COMPAT, UDK], ids=lambda dialect: dialect.name)
def test_a_range_that_is_not_finite_never_gets_onto_the_wire(dialect: Dialect) -> None:
    with pytest.raises(ValueError, match="number inf, expected less"):
        RangeScan(1.0, "lms200", 0.1, 0.1, np.array([1.0, np.inf])).encode(dialect)


NUMBERS = st.floats(-1e6, 1e6) | st.floats(-1e-4, 1e-4)
NAMES = st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,9}", fullmatch=True)
POSES = st.builds(Pose3, *[NUMBERS] * 6)
NAMED = st.lists(st.tuples(NAMES, NUMBERS), max_size=3).map(tuple)
TRIPLES = st.tuples(*[NUMBERS] * 3)
TIMES = st.floats(0.01, 1e6)
VECTORS = st.lists(NUMBERS, min_size=1, max_size=4).map(tuple)
SHARES = st.floats(0, 1)
SEEN = st.integers(1, 4).flatmap(
    lambda count: st.builds(
        TargetEchoes,
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
    st.builds(Greeting, NAMES),
    st.builds(StartPoses, st.lists(st.tuples(NAMES, POSES), max_size=3).map(tuple)),
    st.builds(Status, TIMES, st.integers(-5, 99999), st.booleans()),
    st.builds(RangeScan, TIMES, NAMES, NUMBERS, NUMBERS, VECTORS.map(np.array)),
    st.builds(EchoLine, TIMES, NAMES, *[st.integers(0, 999_999)] * 2, st.none() | SEEN),
    st.builds(GroundTruth, TIMES, NAMES, POSES),
    st.builds(Ins, TIMES, NAMES, POSES),
    st.builds(Odometry, TIMES, NAMES, st.builds(Pose2, *[NUMBERS] * 3)),
    st.builds(Tachometer, TIMES, NAMES, VECTORS, VECTORS),
    st.builds(
        Encoder,
        TIMES,
        st.lists(st.tuples(NAMES, st.integers(-360, 360)), min_size=1).map(tuple),
    ),
    st.builds(Touch, TIMES, NAMES, st.booleans()),
    st.builds(RobotGeo, NAMES, TRIPLES, TRIPLES, NUMBERS, NUMBERS, NUMBERS),
    st.builds(RobotConf, NAMES, NUMBERS, NUMBERS, NUMBERS),
    st.builds(
        ItemGeo, NAMES, st.lists(st.tuples(NAMES, POSES), max_size=3).map(tuple), NAMES
    ),
    st.builds(
        ScannerConf,
        NAMES,
        st.lists(st.tuples(NAMES, *[NUMBERS] * 4), max_size=3).map(tuple),
    ),
    st.builds(IntervalConf, NAMES, NAMED),
    st.builds(EncoderConf, NAMES, NAMED),
    st.builds(TouchConf, NAMES, NAMED),
    st.builds(NameConf, NAMES, st.lists(NAMES, max_size=3).map(tuple)),
)
VALUE = r"[A-Za-z0-9_]+|-?[0-9]+(\.[0-9]+)?(,-?[0-9]+\.[0-9]+)*"
VALUE += r"|[0-9]+,[0-9]+\.[0-9]+,[A-Z][a-z]+(,[01]\.[0-9]+){2}"
LINE = re.compile(rf"(NFO|STA|SEN|GEO|CONF)( \{{[A-Za-z0-9_]+( ({VALUE}))+\}})+")


@given(report=REPORTS)
def test_every_line_has_the_form_that_all_clients_read(report: Report) -> None:
    line = report.encode(COMPAT)
    assert LINE.fullmatch(line)
    assert not re.search(r"-0\.0+(?![0-9])", line)


@given(report=REPORTS, dialect=st.sampled_from([COMPAT, UDK]))
def test_the_grammar_of_a_line_is_that_of_all_lines(
    report: Report, dialect: Dialect
) -> None:
    line = report.encode(dialect)
    assert decode_message(line).encode() == line.replace("}{", "} {")


@given(pose=st.builds(Pose3, *[NUMBERS] * 6), dialect=st.sampled_from([COMPAT, UDK]))
def test_angles_on_the_wire_stay_within_a_turn(pose: Pose3, dialect: Dialect) -> None:
    low, high = (-pi, pi) if dialect is COMPAT else (0, 2 * pi)
    line = Ins(1.0, "InsTest", pose).encode(dialect)
    angles = (decode_message(line).get("Orientation") or "").split(",")
    for angle in angles:
        assert low - 0.005 <= float(angle) <= high + 0.005


@given(report=REPORTS)
def test_a_report_that_was_read_is_written_as_it_was(report: Report) -> None:
    line = report.encode(COMPAT)
    assume("3.1416" not in line)  # a little more than pi, which is read as -pi
    read = decode_report(line)
    assert read is not None
    assert read.encode(COMPAT) == line


@given(report=REPORTS, dialect=st.sampled_from([COMPAT, UDK]))
def test_a_report_is_read_as_it_was_up_to_the_digits(
    report: Report, dialect: Dialect
) -> None:
    read = decode_report(report.encode(dialect))
    sent = _sent(report, dialect)
    assert type(read) is type(sent)
    assert _is_close(_numbers_and_texts(read), _numbers_and_texts(sent))


@given(report=REPORTS, dialect=st.sampled_from([COMPAT, UDK]), data=st.data())
def test_the_order_of_fields_is_free_where_one_thing_is_told_of(
    report: Report, dialect: Dialect, data: st.DataObject
) -> None:
    assume(isinstance(report, Status | RangeScan | EchoLine | Ins | Odometry | Touch))
    line = report.encode(dialect)
    message = decode_message(line)
    mixed = Message(
        message.verb.lower(), tuple(data.draw(st.permutations(message.segments)))
    )
    read, same = decode_report(line), decode_report(mixed.encode())
    assert _is_close(_numbers_and_texts(same), _numbers_and_texts(read))


@given(
    report=REPORTS,
    dialect=st.sampled_from([COMPAT, UDK]),
    place=st.floats(0, 1),
    what=st.sampled_from(["", "{", "}", " ", ",", "nan", "1e9999", "\xe9", "_", "-"]),
    length=st.integers(0, 20),
)
def test_a_line_that_was_damaged_is_refused_or_read_and_nothing_else(
    report: Report, dialect: Dialect, place: float, what: str, length: int
) -> None:
    line = report.encode(dialect)
    start = int(place * len(line))
    try:
        read = decode_report(line[:start] + what + line[start + length :])
    except MalformedMessage:
        return
    for number in _numbers_and_texts(read):
        assert not isinstance(number, float) or abs(number) <= 1e9 or not number < inf


def _sent(report: Report, dialect: Dialect) -> Report:
    """Give what of a report a dialect tells at all."""
    changes: dict[str, Any] = {}
    match report:
        case Status():
            changes["battery"] = max(report.battery, dialect is COMPAT)
        case Ins() if dialect is UDK:
            changes["time"] = nan
        case RobotGeo() if dialect is UDK:
            changes["dimensions"] = (report.wheel_base, report.wheel_separation, 0.0)
        case ItemGeo(mounts=mounts) if dialect is COMPAT or not mounts:
            changes["robot"] = ""
        case EchoLine(echoes=TargetEchoes() as echoes) if 1e9 < echoes.density < inf:
            changes["echoes"] = replace(echoes, density=1e9)
        case ScannerConf() | IntervalConf() | EncoderConf() | TouchConf():
            return report if report.items else NameConf(report.type, ())
        case _:
            pass
    return replace(report, **changes)


class Angle(float):
    """A number of which whole turns do not count."""


def _numbers_and_texts(value: Any) -> list[Any]:
    """Take a report apart."""
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
    """Compare up to two digits after the point, and the 24 bits of the original."""
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
