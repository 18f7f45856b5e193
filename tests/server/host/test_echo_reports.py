"""Distribution of echoes over report lines: order, size and values."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarsim.presets.sensors import load_settings
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.echoes import ECHOES_A_LINE
from radarsim.protocol.reports import EchoLine, TargetEchoes, decode_report, to_bytes
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.sensors.scan import KINDS, Echoes
from radarsim.server.host import echo_lines
from radarsim.server.host.echo_lines import EchoWriter

FOLIAGE = Material("foliage", density=0.7)
SMOKE = Material("smoke", density=0.0, laser_density=0.5, solid=False)
PARTS = tuple(
    Part(name, material, np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    for name, material in (
        ("wall", Material("concrete")),
        ("bush", FOLIAGE),
        ("oak", FOLIAGE),
        ("oak", Material("bark")),
        ("cloud", SMOKE),
    )
)
WALL, BUSH, LEAVES, BARK, SMOKE_CELL = range(5)
ROBOTS = {1: "R1", 7: "R7"}

Row = tuple[int, int]  # beam and part


def echoes_of(rows: Sequence[Row], **settings: Any) -> Echoes:
    """Create echoes with different values in every column."""
    count = len(rows)
    beams, parts = np.array(rows, np.int64).reshape(-1, 2).T
    made = load_settings("radar", **settings)
    full = made.penetration_power
    counted = np.arange(count) / max(count, 1)
    return Echoes(
        beams=beams,
        sides=np.zeros(count, np.int8),
        ranges=1.5 + np.arange(count, dtype=np.float64),
        fronts=1.0 + np.arange(count, dtype=np.float64),
        kinds=np.resize(np.array([int(kind) for kind in KINDS], np.uint8), count),
        power=counted * full if math.isfinite(full) else np.full(count, math.inf),
        strength=counted[::-1].copy(),
        parts=parts,
        scene_parts=PARTS,
        settings=made,
    )


WRITER = EchoWriter(lambda: ROBOTS)  # keeps what it knows from test to test


def read(data: bytes) -> list[EchoLine]:
    reports = [decode_report(line) for line in data.decode("ascii").splitlines()]
    lines = [each for each in reports if isinstance(each, EchoLine)]
    assert len(lines) == len(reports)
    return lines


def targets_of(rows: Sequence[Row], **settings: Any) -> list[TargetEchoes]:
    data = WRITER.write(14.2, "lms200", echoes_of(rows, **settings), COMPAT)
    return [line.echoes for line in read(data) if line.echoes is not None]


ROWS = st.lists(
    st.tuples(st.integers(0, 180), st.sampled_from([*range(5), 5 + 1, 5 + 7])),
    max_size=300,
).map(lambda rows: sorted(rows, key=lambda row: row[0]))


@settings(max_examples=50)
@given(
    rows=ROWS,
    seed=st.integers(0, 99),
    dialect=st.sampled_from([COMPAT, UDK]),
    power=st.sampled_from([0.0, 0.7, math.inf]),
)
def test_every_echo_is_reported_once_in_order_and_with_its_values(
    rows: list[Row], seed: int, dialect: Dialect, power: float
) -> None:
    """Objects by first beam and part, full lines first, echoes by beam and range."""
    echoes = echoes_of(rows, penetration_power=power)
    echoes.fronts[:] = np.random.default_rng(seed).permutation(len(rows))
    first = {part: min(b for b, p in rows if p == part) for _, part in rows}
    expected = []
    for part in sorted(first, key=lambda part: (first[part], part)):
        own = np.flatnonzero(echoes.parts == part)
        own = own[np.lexsort([echoes.fronts[own], echoes.beams[own]])]
        expected += [*np.split(own, range(ECHOES_A_LINE, len(own), ECHOES_A_LINE))]
    data = WRITER.write(14.2, "lms200", echoes, dialect)
    lines = read(data)
    assert to_bytes([line.encode(dialect) for line in lines]) == data
    for line in lines:
        assert line.time == pytest.approx(14.2)
        assert line.name == "lms200"
    if not rows:
        (line,) = lines
        assert (line.line, line.lines, line.echoes) == (0, 0, None)
        return
    assert [line.line for line in lines] == [*range(1, len(expected) + 1)]
    assert {line.lines for line in lines} == {len(expected)}
    for line, own in zip(lines, expected, strict=True):
        assert line.echoes is not None
        assert line.echoes.beams.tolist() == echoes.beams[own].tolist()
        assert line.echoes.ranges == pytest.approx(echoes.fronts[own])
        assert [*line.echoes.kinds] == [KINDS[kind] for kind in echoes.kinds[own]]
        assert line.echoes.strength == pytest.approx(echoes.strength[own], abs=1.1e-4)


def test_object_of_two_materials_gets_two_lines() -> None:
    targets = targets_of([(3, LEAVES), (3, BARK), (4, LEAVES)])
    found = [(each.object, each.material, len(each.kinds)) for each in targets]
    assert found == [("oak", "foliage", 2), ("oak", "bark", 1)]


@pytest.mark.parametrize(
    ("part", "expected"),
    [
        (WALL, ("concrete", math.inf, 0.0, False, False)),
        (BUSH, ("foliage", 0.7, 0.3, False, False)),
        (SMOKE_CELL, ("smoke", 0.0, 1.0, True, True)),
        (5 + 7, ("robot", math.inf, 0.0, False, False)),
    ],
)
def test_line_has_the_material_properties_of_its_object(
    part: int, expected: tuple[Any, ...]
) -> None:
    (target,) = targets_of([(90, part)])
    assert (
        target.material,
        target.density,
        pytest.approx(target.transparency),
        target.laser_passes,
        target.robot_passes,
    ) == expected


@pytest.mark.parametrize(
    ("full", "shares"),
    [
        (1.0, [0.0, 0.25, 0.5, 0.75]),
        (8.0, [0.0, 0.25, 0.5, 0.75]),
        (math.inf, [1.0] * 4),
        (0.0, [0.0] * 4),
    ],
)
def test_power_is_a_fraction_of_full_power(full: float, shares: list[float]) -> None:
    (target,) = targets_of([(90, BUSH)] * 4, penetration_power=full)
    assert target.power.tolist() == shares


def test_fractions_are_clipped_to_zero_and_one() -> None:
    made = echoes_of([(90, BUSH)] * 4)
    made.power[:] = made.strength[:] = [-1e-17, -0.0, 0.5, 1 + 1e-12]
    (line,) = WRITER.write(1.0, "lms200", made, COMPAT).decode().splitlines()
    echoes = line.partition("{Echoes ")[2].rstrip("}").split()
    shares = [echo.split(",")[3:] for echo in echoes]
    assert shares == [[text] * 2 for text in ("0.0000", "0.0000", "0.5000", "1.0000")]


def test_number_that_no_line_can_hold_is_clipped() -> None:
    with pytest.warns(RuntimeWarning, match="was clipped"):
        line = WRITER.write(1e10, "lms200", echoes_of([(90, 0)]), COMPAT)
    assert b"{Time 2147483520.00}" in line


def test_lines_are_right_also_when_too_much_is_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(echo_lines, "MOST_SENSORS", 3)
    monkeypatch.setattr(echo_lines, "MOST_HEADS", 20)
    writer = EchoWriter(lambda: {number: f"R{number}" for number in range(60)})
    for number in range(5):  # a client changes its settings
        echoes = echoes_of([(90, 0)], penetration_power=1 + number)
        assert len(read(writer.write(1.0, "lms200", echoes, COMPAT))) == 1
    for first in range(0, 60, 10):  # robots come and go
        rows = [(0, 5 + number) for number in range(first, first + 10)]
        lines = read(writer.write(1.0, "lms200", echoes_of(rows), COMPAT))
        names = [line.echoes.object for line in lines if line.echoes is not None]
        assert names == [f"R{number}" for number in range(first, first + 10)]
