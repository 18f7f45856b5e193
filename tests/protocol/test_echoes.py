import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.echoes import ECHOES_A_LINE
from radarsim.protocol.message import decode_message
from radarsim.protocol.reports import EchoLine, TargetEchoes, to_bytes

DIALECTS = [COMPAT, UDK]
WALL = TargetEchoes(
    object="wall",
    material="concrete",
    density=math.inf,
    transparency=0.0,
    laser_passes=False,
    robot_passes=False,
    beams=np.array([90]),
    ranges=np.array([6.4]),
    kinds=("hit",),
    power=np.array([1.0]),
    strength=np.array([1.0]),
)


def encoded(target: TargetEchoes, dialect: Dialect = COMPAT) -> str:
    return EchoLine(1.0, "lms200", 1, 1, target).encode(dialect)


def field(target: TargetEchoes, key: str, dialect: Dialect = COMPAT) -> str | None:
    return decode_message(encoded(target, dialect)).get(key)


@pytest.mark.parametrize("dialect", DIALECTS, ids=lambda dialect: dialect.name)
@pytest.mark.parametrize(
    "name",
    [
        pytest.param("W" * 250, id="ASCII"),
        pytest.param("\N{LATIN SMALL LETTER E WITH ACUTE}" * 250, id="no ASCII"),
        pytest.param("\N{OLIVE}" * 250, id="beyond 16 bits"),
    ],
)
def test_the_longest_line_fits_into_one_read(dialect: Dialect, name: str) -> None:
    beams = np.full(ECHOES_A_LINE, 999_999)
    longest = TargetEchoes(
        object=name,
        material=name,
        density=1e308,
        transparency=1.0,
        laser_passes=False,
        robot_passes=False,
        beams=beams,
        ranges=np.full(ECHOES_A_LINE, 1e5),
        kinds=("spent",) * ECHOES_A_LINE,
        power=np.ones(ECHOES_A_LINE),
        strength=np.ones(ECHOES_A_LINE),
    )
    report = EchoLine(2e9, "S" * 60, 999_999, 999_999, longest)
    line = to_bytes([report.encode(dialect)])
    assert 4000 < len(line) <= 4095
    assert line.count(b" 999999,100000.00,Spent,1.0000,1.0000") == ECHOES_A_LINE


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        pytest.param("bush 4", "bush 4", id="blank"),
        pytest.param("  bush\t \xa04 ", "bush 4", id="blanks of all kinds"),
        pytest.param("a{b}|~c", "a?b?|~c", id="braces"),
        pytest.param("a\x00\x07\x7fb", "a???b", id="control characters"),
        pytest.param("Stra\xdfe", "Stra?e", id="no ASCII"),
        pytest.param("x" * 300, "x" * 210, id="endless"),
        pytest.param("x" * 209 + " y", "x" * 209, id="cut at a blank"),
        pytest.param("", "?", id="empty"),
    ],
)
def test_names_are_cleaned_for_the_line(name: str, expected: str) -> None:
    target = replace(WALL, object=name, material=name)
    assert field(target, "Object") == expected
    assert field(target, "Material") == expected


@given(name=st.text(), dialect=st.sampled_from(DIALECTS))
def test_no_name_breaks_a_line(name: str, dialect: Dialect) -> None:
    line = encoded(replace(WALL, object=name, material=name), dialect)
    assert line.isascii()
    assert re.fullmatch(r"SEN( \{[^{}\s]+( [^{}\s]+)+\})+", line)
    assert len(decode_message(line).segments) == 12


@pytest.mark.parametrize("dialect", DIALECTS, ids=lambda dialect: dialect.name)
@pytest.mark.parametrize(
    ("density", "text"),
    [
        pytest.param(math.inf, "Opaque", id="opaque"),
        pytest.param(0.0, "0.0000", id="nothing"),
        pytest.param(1e-300, "0.0000", id="next to nothing"),
        pytest.param(0.7, "0.7000", id="foliage"),
        pytest.param(1e300, "1000000000.0000", id="beyond 32 bits"),
    ],
)
def test_every_density_of_a_map_can_be_written(
    dialect: Dialect, density: float, text: str
) -> None:
    assert field(replace(WALL, density=density), "Density", dialect) == text


@pytest.mark.parametrize("dialect", DIALECTS, ids=lambda dialect: dialect.name)
@given(ranges=st.lists(st.floats(0, 1e5), min_size=1, max_size=20).map(np.array))
def test_echo_ranges_are_formatted_as_in_a_scan(
    dialect: Dialect, ranges: np.ndarray
) -> None:
    count = len(ranges)
    target = replace(
        WALL,
        beams=np.arange(count),
        ranges=ranges,
        kinds=("hit",) * count,
        power=np.ones(count),
        strength=np.ones(count),
    )
    echoes = (field(target, "Echoes", dialect) or "").split(" ")
    assert [echo.split(",")[1] for echo in echoes] == [
        dialect.ranges.format(r) for r in ranges.tolist()
    ]
