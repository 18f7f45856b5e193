import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from radarsim.geometry import Pose2, Pose3
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.line_writer import ReportBlock, encode_blocks, encode_lines
from radarsim.protocol.numbers import NumberFormat, Rounding
from radarsim.protocol.periodic_reports import (
    NumberedReport,
    ReportForm,
    ReportGroup,
)
from radarsim.protocol.reports import (
    EchoLine,
    Encoder,
    Gps,
    Greeting,
    GroundTruth,
    Ins,
    NameConf,
    Odometry,
    RangeScan,
    Report,
    Sonar,
    Status,
    Tachometer,
    TargetEchoes,
    Touch,
    to_bytes,
)

DIALECTS = [COMPAT, COMPAT.of_generation("ut2004"), UDK]

# Where rounding is hard: halves of a decimal and their neighbours, halves in binary,
# numbers of single precision, zeros of both signs, and the ends of what is written.
DECIMALS = st.tuples(st.integers(-(10**9), 10**9), st.integers(0, 7)).map(
    lambda pair: pair[0] / 10 ** pair[1]
)
HALVES = st.tuples(st.integers(-(10**7), 10**7), st.integers(0, 6)).map(
    lambda pair: (pair[0] + 0.5) / 10 ** pair[1]
)
NUMBERS = st.one_of(
    DECIMALS,
    HALVES,
    HALVES.map(lambda half: math.nextafter(half, math.inf)),
    HALVES.map(lambda half: math.nextafter(half, -math.inf)),
    st.integers(-(2**20), 2**20).map(lambda n: n / 2**10),
    st.floats(-100, 100, width=32),
    st.floats(-(2.0**31), 2.0**31, exclude_min=True, exclude_max=True),
    st.sampled_from([0.0, -0.0, 5e-324, -5e-324, 0.99999994]),
)
NAMES = st.sampled_from(["Radar", "", "Lidar 1 ", "Straße", "\xf2\xc2"])
POSES = st.builds(Pose3, *[NUMBERS] * 6)
VECTORS = st.lists(NUMBERS, max_size=2).map(tuple)
WHOLE = st.integers(-400, 400) | st.integers(2**31 - 1, 2**80)


def arrays(elements: st.SearchStrategy[float], count: int) -> st.SearchStrategy[object]:
    return st.lists(elements, min_size=count, max_size=count).map(
        lambda values: np.array(values, np.float64)
    )


ECHOES = st.integers(1, 2).flatmap(
    lambda count: st.builds(
        TargetEchoes,
        *(NAMES, NAMES, NUMBERS | st.just(math.inf), NUMBERS),
        *(st.booleans(), st.booleans()),
        arrays(st.integers(0, 999_999), count),
        arrays(NUMBERS, count),
        st.tuples(*[st.sampled_from(["enter", "leave", "hit"])] * count),
        *(arrays(NUMBERS, count), arrays(NUMBERS, count)),
    )
)
TIMES = NUMBERS | st.just(math.nan)
REPORTS = st.one_of(
    st.builds(Status, NUMBERS, WHOLE, st.booleans()),
    st.builds(RangeScan, TIMES, NAMES, NUMBERS, NUMBERS, VECTORS.map(np.array)),
    st.builds(EchoLine, TIMES, NAMES, WHOLE, WHOLE, st.none() | ECHOES),
    st.builds(GroundTruth, TIMES, NAMES, POSES),
    st.builds(Ins, TIMES, NAMES, POSES),
    st.builds(Odometry, TIMES, NAMES, st.builds(Pose2, *[NUMBERS] * 3)),
    st.builds(Tachometer, TIMES, NAMES, VECTORS, VECTORS),
    st.builds(Encoder, TIMES, st.lists(st.tuples(NAMES, WHOLE), max_size=2).map(tuple)),
    st.builds(Touch, TIMES, NAMES, st.booleans()),
    st.builds(Sonar, TIMES, st.lists(st.tuples(NAMES, NUMBERS), max_size=2).map(tuple)),
    st.builds(Gps, TIMES, NAMES, st.none() | st.tuples(NUMBERS, NUMBERS), WHOLE),
    st.builds(Greeting, NAMES),
)


@given(
    reports=st.lists(st.tuples(REPORTS, st.sampled_from(DIALECTS)), max_size=2),
)
@example(reports=[(Sonar(1.0, (("S1", -0.99999994),)), UDK)])
def test_lines_equal_those_that_the_reports_encode(
    reports: list[tuple[Report, Dialect]],
) -> None:
    expected = [to_bytes([report.encode(dialect)]) for report, dialect in reports]
    assert encode_lines(reports) == expected


@pytest.mark.parametrize("rounding", list(Rounding))
@pytest.mark.parametrize("decimals", [1, 2, 4, 6, 7])
def test_numbers_around_halves_have_the_digits_of_each_number(
    decimals: int, rounding: Rounding
) -> None:
    form = NumberFormat(decimals, rounding)
    sizes = 10.0 ** np.random.default_rng(decimals).uniform(0, 15, 1000)
    halves = (np.floor(sizes) + 0.5) / 10**decimals
    near = [halves, np.nextafter(halves, 0), np.nextafter(halves, np.inf)]
    exact = np.arange(-300, 300) / 64
    values = np.concatenate([*near, -halves, halves.astype(np.float32), exact])
    values = values[np.abs(values) < 2**31]
    scan = RangeScan(math.nan, "radar", 0.1, 0.2, values)
    (line,) = encode_lines([(scan, replace(COMPAT, ranges=form))])
    texts = line.decode().partition("{Range ")[2].removesuffix("}\r\n").split(",")
    assert texts == [form.format(value) for value in values.tolist()]


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, 2.0**31])
def test_number_that_cannot_be_written_is_an_error(
    dialect: Dialect, number: float
) -> None:
    good = GroundTruth(1.0, "GndTruth", Pose3(1.0, 2.0, 3.0))
    for bad in (
        GroundTruth(1.0, "GndTruth", Pose3(number, 2.0, 3.0)),
        RangeScan(1.0, "radar", 0.1, 0.2, np.array([1.0, number])),
        RangeScan(1.0, "radar", number, 0.2, np.array([1.0])),
    ):
        with pytest.raises(ValueError, match="expected less than"):
            encode_lines([(good, dialect), (bad, dialect), (good, dialect)])


def test_replies_are_written_among_readings() -> None:
    touch = Touch(1.0, "Bumper", touched=True)
    reply = NameConf("Touch", ("Bumper",))
    lines = encode_lines([(touch, UDK), (reply, UDK), (touch, COMPAT), (reply, COMPAT)])
    assert lines == [
        b"SEN {Time 1.0000} {Type Touch} {Name Bumper} {Touch True}\r\n",
        b"CONF {Type Touch} {Name Bumper}\r\n",
        b"SEN {Time 1.00} {Type Touch} {Name Bumper Touch True}\r\n",
        b"CONF {Type Touch} {Name Bumper}\r\n",
    ]


def test_no_reports_have_no_lines() -> None:
    assert encode_lines([]) == []


def test_a_thousand_scans_are_written_at_once() -> None:
    scan = RangeScan(1.0, "radar", 0.1, 0.2, np.full(181, -(2.0**31) + 1))
    line = to_bytes([scan.encode(COMPAT)])
    assert encode_lines([(scan, COMPAT)] * 1000) == [line] * 1000


NUMBERED = [
    (Status(1.5, 3599, light=True), True),
    (GroundTruth(1.5, "GndTruth", Pose3(1, 2, 3, 0.1, 0.2, 0.3)), "GndTruth"),
    (Ins(1.5, "InsTest", Pose3(1, 2, -0.0, -0.0, -9.0, 1e-9)), "InsTest"),
    (Odometry(1.5, "Odometer", Pose2(1, 0, -9)), "Odometer"),
    (Tachometer(1.5, "TachTest", (1.0, 2.0), (3.0, 4.0)), ("TachTest", 2, 2)),
    (Encoder(1.5, (("W1", 9), ("W2", -9))), ("W1", "W2")),
    (Touch(1.5, "Bumper", touched=True), "Bumper"),
    (Touch(1.5, "Bumper", touched=False), "Bumper"),
]


@pytest.mark.parametrize("dialect", DIALECTS)
def test_group_of_reports_is_its_forms_and_their_numbers(dialect: Dialect) -> None:
    reports: list[NumberedReport] = [report for report, _ in NUMBERED]
    group = ReportGroup(
        [ReportForm(type(report), fixed) for report, fixed in NUMBERED], dialect
    )
    numbers = [number for report in reports for number in report.split(dialect)[1]]
    scan = RangeScan(1.5, "radar", 0.1, 0.2, np.array([1.0, 2.0]))
    lines = [report.encode(dialect) for report in reports]
    assert [each.encode(dialect) for each in group.build(numbers)] == lines
    alone = ReportBlock([], dialect, group, numbers)
    followed = ReportBlock([scan], dialect, group, numbers)
    empty = ReportBlock([], dialect)
    assert encode_blocks([alone, empty, followed]) == [
        to_bytes(lines),
        b"",
        to_bytes([*lines, scan.encode(dialect)]),
    ]


def test_number_of_a_group_that_cannot_be_written_is_an_error() -> None:
    group = ReportGroup([ReportForm(Odometry, "Odometer")], COMPAT)
    with pytest.raises(ValueError, match="expected less than"):
        encode_blocks([ReportBlock([], COMPAT, group, [1.0, math.nan, 0.0, 0.0])])


def test_angles_of_any_size_are_wrapped() -> None:
    turns = [k * math.pi / 3 + e for k in range(-50, 50) for e in (0, 1e-9, -1e-9)]
    turns += [math.pi, -math.pi, 3 * math.pi, -3 * math.pi, 1e9, -1e9, 2.0**31]
    for dialect in DIALECTS:
        reports = [(Ins(1.0, "I", Pose3(0, 0, 0, a, a, a)), dialect) for a in turns]
        expected = [to_bytes([report.encode(dialect)]) for report, _ in reports]
        assert encode_lines(reports) == expected
