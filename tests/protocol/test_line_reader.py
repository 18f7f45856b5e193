"""Lines are read as an independent, slow reader does, to the last bit."""

import math
import struct
from collections.abc import Callable, Iterable

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st
from oracles.line_reader import (
    read_list,
    read_number,
    read_segments,
    read_triple,
)

from radarsim.errors import MalformedMessage
from radarsim.geometry import Pose3, wrap_angle
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.message import decode_message
from radarsim.protocol.reports import (
    GroundTruth,
    RangeScan,
    Report,
    Tachometer,
    decode_report,
)

NUMBERS = st.floats(-1e3, 1e3) | st.floats(-1e9, 1e9) | st.just(-0.0)
LISTS = st.lists(NUMBERS, min_size=1, max_size=8)
RANGES = st.lists(st.floats(0, 1e4), min_size=1, max_size=30).map(np.array)
SCANS = st.builds(RangeScan, NUMBERS, st.just("S 1"), NUMBERS, NUMBERS, RANGES)
POSES = st.builds(Pose3, *[NUMBERS] * 6)
TRUTHS = st.builds(GroundTruth, NUMBERS, st.just("G"), POSES)
TURNS = st.builds(Tachometer, NUMBERS, st.just("T"), *[LISTS.map(tuple)] * 2)
REPORTS = SCANS | TRUTHS | TURNS
# What numbers, lists, JSON and blanks of all kinds are made of.
SIGNS = st.sampled_from([*'0123456789.,-+eE{}[]"_ \t\n\x1c\xa0nafItruSN', "-0,", "²"])
CHANGES = st.lists(st.tuples(st.integers(0, 400), st.integers(0, 2), SIGNS), max_size=4)


def bits(numbers: Iterable[float]) -> list[bytes]:
    return [struct.pack("d", number) for number in numbers]


def flip(triple: list[float]) -> list[float]:
    return [triple[0], 0.0 - triple[1], 0.0 - triple[2]]


def read_report(line: str) -> tuple[str, list[float]] | None:
    """Return name and numbers of a reading; None if it has to be refused."""
    read = read_segments(line)
    if read is None:
        return None
    values: dict[str, str] = {}
    for key, value in read[1]:
        values.setdefault(key.lower(), value)
    time = values.get("time") or ""
    parts: list[list[float] | float | None] = [read_number(time) if time else math.nan]
    kind = values.get("type", "").lower()
    if kind == "rangescanner":
        parts += [read_number(values.get(key, "")) for key in ("resolution", "fov")]
        parts.append(read_list(values.get("range", "")))
    elif kind == "tachometer":
        parts += [read_list(values.get(key, "")) for key in ("vel", "pos")]
    elif kind == "groundtruth":
        place = read_triple(values.get("location", ""))
        angles = read_triple(values.get("orientation", ""))
        parts.append(place and flip(place))
        parts.append(angles and [wrap_angle(angle) for angle in flip(angles)])
    if any(part is None for part in parts):
        return None
    found = [part if isinstance(part, list) else [part] for part in parts]
    return values.get("name", ""), [
        number for part in found for number in part if number is not None
    ]


def numbers_of(report: Report) -> list[float]:
    match report:
        case RangeScan():
            return [report.time, report.resolution, report.fov, *report.ranges.tolist()]
        case Tachometer():
            return [report.time, *report.velocities, *report.positions]
        case GroundTruth():
            return [report.time, *report.pose.numbers()]
        case _:
            raise AssertionError(report)


def change(line: str, changes: list[tuple[int, int, str]]) -> str:
    """Insert, replace and remove characters."""
    for place, removed, text in changes:
        at = place % (len(line) + 1)
        line = line[:at] + text * (removed < 2) + line[at + min(removed, 1) :]
    return line


def refused_as_none(read: Callable[[str], Report | None], line: str) -> Report | None:
    try:
        return read(line)
    except MalformedMessage:
        return None


@given(report=REPORTS, dialect=st.sampled_from([COMPAT, UDK]), changes=CHANGES)
def test_readings_are_read_to_the_last_bit(
    report: RangeScan | GroundTruth | Tachometer,
    dialect: Dialect,
    changes: list[tuple[int, int, str]],
) -> None:
    line = change(report.encode(dialect), changes)
    check_reading(line)


def check_reading(line: str) -> None:
    read = refused_as_none(decode_report, line)
    if read is None:
        segments = read_segments(line)
        kinds = (
            [value for key, value in segments[1] if key.lower() == "type"]
            if segments
            else []
        )
        known = kinds and kinds[0].lower() in (
            "rangescanner",
            "tachometer",
            "groundtruth",
        )
        is_reading = segments and segments[0].upper() == "SEN" and known
        assert not is_reading or read_report(line) is None
    else:
        expected = read_report(line)
        assert expected is not None
        assert isinstance(read, RangeScan | GroundTruth | Tachometer)
        assert read.name == expected[0]
        assert bits(numbers_of(read)) == bits(expected[1])


SCAN = "SEN {Type RangeScanner} {Name S} {Resolution 1} {FOV 1} {Range %s}"


@given(
    text=st.text(st.sampled_from('0019.,-+eE \t[]"NaInfity_²'), max_size=12)
    | st.text(st.sampled_from("0123456789.,-"), max_size=30)
)
@example(text="-0,1.0")
@example(text="1.0,-0")
@example(text="1,2.5,-3")
@example(text="01.5")
@example(text="1.5\t,2.5")
@example(text="9" * 400)
@example(text="9" * 4000)
@example(text="2147483648,-2147483648.0")
@example(text="2147483648.1")
@example(text="1.5,[2.5]")
@example(text="NaN")
@example(text="\ud800")
@example(text=("0.1" * 30 + ",").strip(","))
@example(text="0.1000000000000000055511151231257827021181583404541015625")
def test_lists_are_read_to_the_last_bit(text: str) -> None:
    read = refused_as_none(decode_report, SCAN % text)
    expected = None if set(text) & {*"{}"} else read_list(text.strip())
    assert (read is None) == (expected is None)
    if isinstance(read, RangeScan) and expected is not None:
        assert read.ranges.dtype == np.float64
        assert bits(read.ranges) == bits(expected)


@given(text=st.text(st.sampled_from("A{} {}b\t\xa0"), max_size=20))
def test_segments_are_those_of_the_reader(text: str) -> None:
    expected = read_segments(text)
    try:
        message = decode_message(text)
    except MalformedMessage:
        assert expected is None
    else:
        assert expected == (message.verb, list(message.segments))
