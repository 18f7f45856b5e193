import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from radarsim.errors import EngineError
from radarsim.geometry import Pose2, Pose3, wrap_angle
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.fields import LineReport, ReportGroup
from radarsim.protocol.line_template import (
    Block,
    NumberFormat,
    Rounding,
    encode_blocks,
)
from radarsim.protocol.reports import (
    MOST_KEPT,
    Encoder,
    GroundTruth,
    Ins,
    NameConf,
    Odometry,
    RangeScan,
    Sonar,
    Status,
    Tachometer,
    Touch,
)

DIALECTS = [COMPAT, COMPAT.of_generation("ut2004"), UDK]

# Where rounding is hard: halves of a decimal and their neighbours, halves in binary,
# numbers of single precision, zeros of both signs, and the ends of the written range.
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


def block(
    reports: Sequence[LineReport],
    dialect: Dialect,
    group: ReportGroup | None = None,
    numbers: Sequence[float] = (),
) -> Block:
    return reports, dialect, group, numbers


def encode(report: LineReport, dialect: Dialect) -> bytes:
    (line,) = encode_blocks([block([report], dialect)])
    return line


def digits(form: NumberFormat, value: float) -> str:
    """Write a number in Python, without the engine."""
    if form.rounding is Rounding.NEAREST:
        text = f"{value:.{form.decimals}f}"
        return text.lstrip("-") if float(text) == 0 else text
    single = np.float32(value)
    if form.rounding is Rounding.FLOAT32:
        return f"{float(single):.{form.decimals}f}"
    whole = int(abs(single))
    rest = int((abs(single) - np.float32(whole)) * np.float32(10.0**form.decimals))
    return f"{'-' if single < 0 else ''}{whole}.{rest:0{form.decimals}d}"


def joined(form: NumberFormat, values: Sequence[float]) -> str:
    return ",".join([digits(form, value) for value in values])


FORMS = st.builds(NumberFormat, st.integers(1, 6), st.sampled_from(Rounding))


@given(
    values=st.lists(NUMBERS, min_size=1, max_size=4),
    form=FORMS,
    dialect=st.sampled_from(DIALECTS),
)
@example(values=[-0.99999994], form=NumberFormat(4, Rounding.TRUNCATED), dialect=COMPAT)
def test_numbers_have_the_digits_of_their_format(
    values: list[float], form: NumberFormat, dialect: Dialect
) -> None:
    changed = replace(dialect, ranges=form, plain=form, truth=form, ins=form)
    texts = [digits(form, value) for value in values]
    scan = RangeScan(math.nan, "radar", 0.1, 0.2, np.array(values))
    assert b"{Range %s}" % ",".join(texts).encode() in encode(scan, changed)
    wheels = Tachometer(1.0, "T", tuple(values), (1.0,))
    assert b"{Vel %s}" % ",".join(texts).encode() in encode(wheels, changed)


@given(numbers=st.tuples(*[NUMBERS] * 6), form=FORMS, dialect=st.sampled_from(DIALECTS))
def test_poses_are_in_the_axes_of_the_wire(
    numbers: tuple[float, ...], form: NumberFormat, dialect: Dialect
) -> None:
    x, y, z, *angles = numbers
    turned = [angles[0], 0.0 - angles[1], 0.0 - angles[2]]
    wrapped = [wrap_angle(angle) for angle in turned]
    place = joined(form, [x, 0.0 - y, 0.0 - z])
    changed = replace(dialect, truth=form, ins=form)
    line = encode(GroundTruth(1.0, "G", Pose3(*numbers)), changed).decode()
    assert f"{{Location {place}}} {{Orientation {joined(form, wrapped)}}}" in line
    if dialect is UDK:
        wrapped = [angle % math.tau for angle in wrapped]
    line = encode(Ins(1.0, "I", Pose3(*numbers)), changed).decode()
    assert f"{{Location {place}}} {{Orientation {joined(form, wrapped)}}}" in line


@pytest.mark.parametrize("rounding", list(Rounding))
@pytest.mark.parametrize("decimals", [1, 2, 4, 6])
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
    line = encode(scan, replace(COMPAT, ranges=form))
    texts = line.decode().partition("{Range ")[2].removesuffix("}\r\n").split(",")
    assert texts == [digits(form, value) for value in values.tolist()]


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf, 2.0**31])
def test_number_that_cannot_be_written_is_clipped(
    dialect: Dialect, number: float
) -> None:
    good = GroundTruth(1.0, "GndTruth", Pose3(1.0, 2.0, 3.0))
    near = 0.0 if math.isnan(number) else math.copysign(2.0**31 - 128, number)

    def bad(value: float) -> list[LineReport]:
        return [
            GroundTruth(1.0, "GndTruth", Pose3(value, 2.0, 3.0)),
            RangeScan(1.0, "radar", 0.1, 0.2, np.array([1.0, value])),
            RangeScan(1.0, "radar", value, 0.2, np.array([1.0])),
        ]

    with pytest.warns(RuntimeWarning, match="was clipped"):
        written = encode_blocks([block([good, *bad(number), good], dialect)])
    expected = encode_blocks([block([good, *bad(near), good], dialect)])
    assert written == expected


def test_lines_of_reports_and_groups_are_in_blocks() -> None:
    samples = [Status(0.0, 0, light=True), Encoder(0.0, (("W1", 0), ("W2", 0)))]
    group = ReportGroup(samples, COMPAT)
    numbers = [1.5, 3599, 1.5, 9, -9]
    conf = NameConf("Touch", ("Bumper",))
    touches = [Touch(1.5, "Bumper", touched=flag) for flag in (True, False)]
    alone = block([], COMPAT, group, numbers)
    followed = block([*touches, conf], COMPAT, group, numbers)
    head = (
        b"STA {Type GroundVehicle} {Time 1.50} {FrontSteer 0.0000} {RearSteer 0.0000}"
        b" {LightToggle True} {LightIntensity 100} {Battery 3599} {View -1}\r\n"
        b"SEN {Time 1.50} {Type Encoder} {Name W1} {Tick 9} {Name W2} {Tick -9}\r\n"
    )
    assert encode_blocks([alone, block([], UDK), followed]) == [
        head,
        b"",
        head + b"SEN {Time 1.50} {Type Touch} {Name Bumper Touch True}\r\n"
        b"SEN {Time 1.50} {Type Touch} {Name Bumper Touch False}\r\n"
        b"CONF {Type Touch} {Name Bumper}\r\n",
    ]
    assert encode_blocks([]) == []


def test_a_thousand_scans_are_written_at_once() -> None:
    scan = RangeScan(1.0, "radar", 0.1, 0.2, np.full(181, -(2.0**31) + 1))
    line = encode(scan, COMPAT)
    assert encode_blocks([block([scan], COMPAT)] * 1000) == [line] * 1000
    assert line.count(b"-2147483647.00") == 181


def test_number_of_a_group_that_cannot_be_written_is_clipped() -> None:
    group = ReportGroup([Odometry(0.0, "Odometer", Pose2(0, 0))], COMPAT)
    with pytest.warns(RuntimeWarning, match="was clipped"):
        (line,) = encode_blocks([block([], COMPAT, group, [1.0, math.nan, 0.0, 0.0])])
    assert b"{Pose 0.0000,0.0000,0.0000}" in line


@pytest.mark.parametrize("numbers", [[1.0] * 3, [1.0] * 5])
def test_group_needs_a_number_for_each_mark(numbers: list[float]) -> None:
    group = ReportGroup([Odometry(0.0, "Odometer", Pose2(0, 0))], COMPAT)
    with pytest.raises(EngineError, match=f"^{len(numbers)} numbers, and 0 in series"):
        encode_blocks([block([], COMPAT, group, numbers)])


def test_angles_of_any_size_are_wrapped() -> None:
    turns = [k * math.pi / 3 + e for k in range(-50, 50) for e in (0, 1e-9, -1e-9)]
    turns += [math.pi, -math.pi, 3 * math.pi, -3 * math.pi, 1e9, -1e9]
    for angle in turns:
        wrapped = digits(COMPAT.ins, wrap_angle(angle))
        line = encode(Ins(1.0, "I", Pose3(0, 0, 0, angle)), COMPAT).decode()
        assert f"{{Orientation {wrapped},0.0000,0.0000}}" in line


@pytest.mark.parametrize("names", [("A", "B"), ("B", "A")])
def test_templates_that_are_kept_are_those_of_their_reports(
    names: tuple[str, str],
) -> None:
    for name in names * 2:
        for time in (1.0, math.nan):
            sonar = Sonar(time, ((name, 2.0), ("C", 3.0)))
            scan = RangeScan(time, name, 0.5, 1.0, np.array([1.0, 2.0]))
            stamp = "" if math.isnan(time) else "{Time 1.00} "
            assert sonar.encode(COMPAT) == (
                f"SEN {stamp}{{Type Sonar}} {{Name {name} Range 2.0000}}"
                " {Name C Range 3.0000}"
            )
            assert scan.encode(COMPAT) == (
                f"SEN {stamp}{{Type RangeScanner}} {{Name {name}}}"
                " {Resolution 0.500000} {FOV 1.000000} {Range 1.00,2.00}"
            )


def test_few_templates_are_kept() -> None:
    for number in range(MOST_KEPT + 10):  # clients can change their settings
        scan = RangeScan(1.0, "radar", 0.1, 1.0 + number, np.array([1.0]))
        assert scan.encode(COMPAT).count(f"{{FOV {1 + number}.0") == 1
