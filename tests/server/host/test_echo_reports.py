"""Distribution of echoes over report lines: order, size and values."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.presets.sensors import load_settings
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.protocol.echoes import ECHOES_A_LINE
from radarsim.protocol.reports import EchoLine, TargetEchoes, to_bytes
from radarsim.raycast.attenuation import EventKind
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.sensors.scan import KINDS, Echoes
from radarsim.server.host.echo_lines import (
    KIND_NAMES,
    MOST_HEADS,
    MOST_SENSORS,
    EchoRows,
    EchoWriter,
    describe_target,
)

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


def echo_lines(
    time: float, scanner: str, echoes: Echoes, robot_names: Mapping[int, str]
) -> tuple[EchoLine, ...]:
    """Return the reports of the lines that ``EchoWriter`` writes, not rounded."""
    numbers, kinds, rows = EchoRows.of(echoes)
    if not rows:
        return (EchoLine(time, scanner, 0, 0, None),)
    lines = []
    for number, (part, start, end) in enumerate(rows, start=1):
        beams, ranges, power, strength = numbers[start:end].T
        seen = replace(
            describe_target(echoes, part, robot_names),
            beams=beams.astype(np.int64),
            ranges=ranges,
            kinds=tuple([KIND_NAMES[kind] for kind in kinds[start:end]]),
            power=power,
            strength=strength,
        )
        lines.append(EchoLine(time, scanner, number, len(rows), seen))
    return tuple(lines)


def lines_of(rows: Sequence[Row], **settings: Any) -> tuple[EchoLine, ...]:
    return echo_lines(14.2, "lms200", echoes_of(rows, **settings), ROBOTS)


def targets_of(lines: Sequence[EchoLine]) -> list[TargetEchoes]:
    targets = [line.echoes for line in lines if line.echoes is not None]
    assert len(targets) == len(lines)
    return targets


ROWS = st.lists(
    st.tuples(st.integers(0, 180), st.sampled_from([*range(5), 5 + 1, 5 + 7])),
    max_size=300,
).map(lambda rows: sorted(rows, key=lambda row: row[0]))


@given(rows=ROWS)
def test_lines_are_numbered_from_one_to_their_count(rows: list[Row]) -> None:
    lines = lines_of(rows)
    assert {(line.time, line.name) for line in lines} == {(14.2, "lms200")}
    assert {line.lines for line in lines} == {len(lines) if rows else 0}
    assert [line.line for line in lines] == [*range(1, len(lines) + 1)] or not rows


@given(rows=ROWS)
def test_every_echo_is_reported_once_with_all_its_values(rows: list[Row]) -> None:
    echoes = echoes_of(rows)
    reported = [
        row
        for line in echo_lines(1.0, "lms200", echoes, ROBOTS)
        if line.echoes is not None
        for row in zip(
            line.echoes.beams.tolist(),
            line.echoes.ranges.tolist(),
            line.echoes.kinds,
            line.echoes.power.tolist(),
            line.echoes.strength.tolist(),
            strict=True,
        )
    ]
    expected = zip(
        echoes.beams.tolist(),
        echoes.fronts.tolist(),
        [KINDS[EventKind(kind)] for kind in echoes.kinds.tolist()],
        echoes.power.tolist(),  # of a full power of 1
        echoes.strength.tolist(),
        strict=True,
    )
    assert sorted(reported) == sorted(expected)


@given(rows=ROWS.filter(bool))
def test_objects_are_ordered_by_first_beam_then_part(
    rows: list[Row],
) -> None:
    echoes = echoes_of(rows)
    part_at = dict(zip(echoes.fronts.tolist(), echoes.parts.tolist(), strict=True))
    reported = [
        (int(beam), part_at[far], far)
        for target in targets_of(echo_lines(1.0, "lms200", echoes, ROBOTS))
        for beam, far in zip(target.beams.tolist(), target.ranges.tolist(), strict=True)
    ]
    first = {part: min(b for b, p in rows if p == part) for _, part in rows}
    assert reported == sorted(
        reported, key=lambda echo: (first[echo[1]], echo[1], echo[2])
    )


@given(rows=ROWS.filter(bool))
def test_lines_of_an_object_are_filled_in_turn(
    rows: list[Row],
) -> None:
    parts = [part for _, part in rows]
    expected: list[int] = []
    for part in dict.fromkeys(
        part for _, part in sorted(rows, key=lambda row: (row[0], row[1]))
    ):
        full, rest = divmod(parts.count(part), ECHOES_A_LINE)
        expected += [ECHOES_A_LINE] * full + [rest] * (rest > 0)
    assert [len(target.kinds) for target in targets_of(lines_of(rows))] == expected


def test_object_of_two_materials_gets_two_lines() -> None:
    targets = targets_of(lines_of([(3, LEAVES), (3, BARK), (4, LEAVES)]))
    assert [
        (target.object, target.material, len(target.kinds)) for target in targets
    ] == [
        ("oak", "foliage", 2),
        ("oak", "bark", 1),
    ]


@pytest.mark.parametrize(
    ("part", "expected"),
    [
        pytest.param(WALL, ("concrete", math.inf, 0.0, False, False), id="opaque"),
        pytest.param(BUSH, ("foliage", 0.7, 0.3, False, False), id="shrub"),
        pytest.param(SMOKE_CELL, ("smoke", 0.0, 1.0, True, True), id="smoke"),
        pytest.param(5 + 7, ("robot", math.inf, 0.0, False, False), id="robot"),
    ],
)
def test_line_has_the_material_properties_of_its_object(
    part: int, expected: tuple[Any, ...]
) -> None:
    (target,) = targets_of(lines_of([(90, part)]))
    assert (
        target.material,
        target.density,
        pytest.approx(target.transparency),
        target.laser_passes,
        target.robot_passes,
    ) == expected


def test_echoes_of_robots_have_their_names() -> None:
    targets = targets_of(lines_of([(10, 5 + 7), (20, 5 + 1), (30, 5 + 7)]))
    assert [target.object for target in targets] == ["R7", "R1"]


@pytest.mark.parametrize(
    ("full", "shares"),
    [
        pytest.param(1.0, [0.0, 0.25, 0.5, 0.75], id="one"),
        pytest.param(8.0, [0.0, 0.25, 0.5, 0.75], id="strong"),
        pytest.param(math.inf, [1.0] * 4, id="unlimited"),
        pytest.param(0.0, [0.0] * 4, id="none at all"),
    ],
)
def test_power_is_a_fraction_of_full_power(full: float, shares: list[float]) -> None:
    (target,) = targets_of(lines_of([(90, BUSH)] * 4, penetration_power=full))
    assert target.power.tolist() == shares


def test_fractions_are_clipped_to_zero_and_one() -> None:
    made = echoes_of([(90, BUSH)] * 4)
    made.power[:] = made.strength[:] = [-1e-17, -0.0, 0.5, 1 + 1e-12]
    (target,) = targets_of(echo_lines(1.0, "lms200", made, ROBOTS))
    for shares in (target.power, target.strength):
        assert shares.tolist() == [0.0, 0.0, 0.5, 1.0]
        assert not np.signbit(shares).any()


WRITER = EchoWriter(lambda: ROBOTS)


def expected(rows: Sequence[Row], dialect: Dialect, power: float) -> bytes:
    echoes = echoes_of(rows, penetration_power=power)
    reports = echo_lines(14.2, "lms200", echoes, ROBOTS)
    return to_bytes([report.encode(dialect) for report in reports])


@given(
    scans=st.lists(
        st.tuples(
            ROWS, st.sampled_from([COMPAT, UDK]), st.sampled_from([0.0, 0.7, math.inf])
        ),
        max_size=3,
    )
)
def test_lines_are_those_of_the_reports_however_much_is_kept(
    scans: list[tuple[list[Row], Dialect, float]],
) -> None:
    for rows, dialect, power in scans:
        echoes = echoes_of(rows, penetration_power=power)
        lines = WRITER.write(14.2, "lms200", echoes, dialect)
        assert lines == expected(rows, dialect, power)


def test_number_that_no_line_can_hold_is_clipped() -> None:
    with pytest.warns(RuntimeWarning, match="is clipped"):
        line = WRITER.write(1e10, "lms200", echoes_of([(90, 0)]), COMPAT)
    assert b"{Time 2147483520.00}" in line


def test_what_is_kept_has_a_limit() -> None:
    writer = EchoWriter(lambda: dict.fromkeys(range(3 * MOST_HEADS), "R"))
    for number in range(MOST_SENSORS + 2):  # a client changes its settings
        echoes = echoes_of([(90, 0)], penetration_power=1 + number)
        assert writer.write(1.0, "lms200", echoes, COMPAT).count(b"\r\n") == 1
    for first in range(0, 2 * MOST_HEADS + 2, 100):  # robots come and go
        rows = [(0, 5 + number) for number in range(first, first + 100)]
        lines = writer.write(1.0, "lms200", echoes_of(rows), COMPAT)
        assert lines.count(b"\r\n") == 100


@given(rows=ROWS, seed=st.integers(0, 99))
def test_echoes_of_a_line_are_sorted_by_beam_and_where_they_begin(
    rows: list[Row], seed: int
) -> None:
    made = echoes_of(rows)
    made.fronts[:] = np.random.default_rng(seed).permutation(len(rows))
    found = []
    for target in echo_lines(1.0, "lms200", made, ROBOTS):
        if target.echoes is not None:
            seen = target.echoes
            pairs = [*zip(seen.beams.tolist(), seen.ranges.tolist(), strict=True)]
            assert pairs == sorted(pairs)
            found += pairs
    assert sorted(found) == sorted(
        zip(made.beams.tolist(), made.fronts.tolist(), strict=True)
    )
