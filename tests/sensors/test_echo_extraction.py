"""The echoes of beams, by closed forms, and by the same law in plain Python."""

import math
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.geometry import Floats
from radarsim.presets.sensors import load_settings
from radarsim.raycast.attenuation import EVENT, EventKind
from radarsim.raycast.rays import DEFAULT_CLASSES, Rays, Traces
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import box
from radarsim.sensors.echo_extraction import (
    LEAF_BACKSCATTER,
    EchoColumns,
    backscatter,
    extract_echoes,
    extract_ray_ends,
)
from radarsim.sensors.echo_selection import (
    FIRST,
    LAST,
    STRONGEST,
    merge_echoes,
    select_echoes,
)

WALL = Material("wall")
SMOKE = Material("smoke", density=0.0, solid=False)
SHEET = Material("leaves", density=0.0, sheet_loss=0.25)
ENTER, LEAVE, CROSS, HIT, SPENT = (
    EventKind.ENTER,
    EventKind.LEAVE,
    EventKind.SHEET,
    EventKind.HIT,
    EventKind.SPENT,
)


def layer(name: str, material: Material, near: float, far: float) -> Part:
    vertices, faces = box(far - near, 4, 4)
    return Part(name, material, vertices + np.array([(near + far) / 2, 0, 0]), faces)


def leaf(density: float) -> Material:
    return Material("leaf", density=density)


def traced(
    parts: list[Part], power: float = 1.0, count: int = 1, *, incidence: bool = False
) -> Traces:
    """Cast rays ahead, all alike, from the origin."""
    ways = np.tile([1.0, 0.0, 0.0], (count, 1))
    rays = Rays.uniform(np.zeros((count, 3)), ways, max_range=50.0, power=power)
    return Tracer(parts).trace(rays, events=True, incidence=incidence)


def gathered(
    parts: list[Part],
    traces: Traces,
    power: float = 1.0,
    weights: Floats | None = None,
    of_a_beam: int = 1,
) -> EchoColumns:
    settings = load_settings("radar", penetration_power=power)
    weights = np.ones(len(traces.ranges)) if weights is None else weights
    densities = Tracer(parts).densities(DEFAULT_CLASSES[0])
    return extract_echoes(traces, weights, of_a_beam, densities, settings)


def echoes(parts: list[Part], power: float = 1.0) -> list[tuple[Any, ...]]:
    """Give kind, range, power and strength of all echoes of one ray."""
    traces = traced(parts, power)
    found = gathered(parts, traces, power)
    kinds = [EventKind(int(kind)) for kind in found.kind]
    numbers = zip(
        found.t.round(9).tolist(),
        found.power.round(9).tolist(),
        found.strength.round(9).tolist(),
        strict=True,
    )
    return [(kind, *row) for kind, row in zip(kinds, numbers, strict=True)]


def test_a_bush_gives_back_what_it_takes_and_the_wall_the_rest() -> None:
    parts = [layer("bush", leaf(0.2), 2, 5), layer("wall", WALL, 8, 9)]
    assert echoes(parts) == [
        (ENTER, 2.0, 1.0, 0.6),
        (LEAVE, 5.0, 0.4, 0.0),
        (HIT, 8.0, 0.4, 0.4),
    ]


def test_a_bush_that_spends_a_beam_gives_all_of_it_back_at_its_front() -> None:
    assert echoes([layer("bush", leaf(0.5), 2, 9)]) == [
        (ENTER, 2.0, 1.0, 1.0),
        (SPENT, 4.0, 0.0, 0.0),
    ]


def test_smoke_that_takes_nothing_gives_nothing_back() -> None:
    parts = [layer("smoke", SMOKE, 2, 5), layer("wall", WALL, 8, 9)]
    assert echoes(parts) == [
        (ENTER, 2.0, 1.0, 0.0),
        (LEAVE, 5.0, 1.0, 0.0),
        (HIT, 8.0, 1.0, 1.0),
    ]


def test_a_sheet_gives_back_what_each_crossing_takes() -> None:
    parts = [layer("leaves", SHEET, 2, 3), layer("wall", WALL, 8, 9)]
    assert echoes(parts) == [
        (CROSS, 2.0, 1.0, 0.25),
        (CROSS, 3.0, 0.75, 0.25),
        (HIT, 8.0, 0.5, 0.5),
    ]


def test_overlapping_volumes_share_what_is_lost_by_density() -> None:
    parts = [layer("one", leaf(0.1), 1, 4), layer("other", leaf(0.2), 2, 3)]
    assert echoes(parts) == [
        (ENTER, 1.0, 1.0, 0.3),
        (ENTER, 2.0, 0.9, 0.2),
        (LEAVE, 3.0, 0.6, 0.0),
        (LEAVE, 4.0, 0.5, 0.0),
    ]


def test_smoke_within_a_bush_gives_nothing_back_for_it() -> None:
    parts = [
        layer("smoke", SMOKE, 1, 3),
        layer("bush", leaf(0.2), 2, 6),
        layer("puff", SMOKE, 4, 5),
        layer("wall", WALL, 8, 9),
    ]
    given_back = {(kind, t): strength for kind, t, _, strength in echoes(parts)}
    assert given_back.pop((ENTER, 2.0)) == pytest.approx(0.8)
    assert given_back.pop((HIT, 8.0)) == pytest.approx(0.2)
    assert set(given_back.values()) == {0.0}


def test_a_sheet_on_the_face_of_a_bush_takes_its_own_in_any_order() -> None:
    parts = [layer("leaves", SHEET, 4, 9), layer("bush", leaf(0.1), 4, 6)]
    for ordered in (parts, parts[::-1]):
        at_four = [row for row in echoes(ordered) if row[1] == 4.0]
        assert {kind: row[-1] for kind, *row in at_four} == {
            CROSS: pytest.approx(0.25),
            ENTER: pytest.approx(0.2),
        }


def test_what_the_air_takes_nobody_gives_back() -> None:
    bush, wall = layer("bush", leaf(0.1), 2, 4), layer("wall", WALL, 8, 9)
    mist = Material("mist", density=0.05, solid=False)
    tracer = Tracer([bush, wall], mist)
    rays = Rays.uniform(np.zeros((1, 3)), np.eye(3)[:1], max_range=50.0, power=1.0)
    traces = tracer.trace(rays, events=True)
    settings = load_settings("radar")
    found = extract_echoes(
        traces, np.ones(1), 1, tracer.densities(DEFAULT_CLASSES[0]), settings
    )
    assert found.strength == pytest.approx([0.2, 0.0, 1 - 8 * 0.05 - 0.2])


def test_what_is_lost_around_the_start_nobody_gives_back() -> None:
    parts = [layer("bush", leaf(0.25), -1, 2), layer("wall", WALL, 8, 9)]
    assert echoes(parts) == [(LEAVE, 2.0, 0.5, 0.0), (HIT, 8.0, 0.5, 0.5)]


def test_unlimited_power_comes_back_whole_from_what_it_hits() -> None:
    parts = [layer("bush", leaf(0.2), 2, 5), layer("wall", WALL, 8, 9)]
    found = echoes(parts, math.inf)
    assert [(kind, strength) for kind, _, _, strength in found] == [
        (ENTER, 0.0),
        (LEAVE, 0.0),
        (HIT, 1.0),
    ]


@pytest.mark.parametrize(
    ("material", "wanted"),
    [
        pytest.param(leaf(0.5), [(ENTER, 1.0), (SPENT, 0.0)], id="foliage"),
        pytest.param(SMOKE, [(ENTER, 0.0), (LEAVE, 0.0), (HIT, 1.0)], id="smoke"),
    ],
)
def test_a_beam_without_power(
    material: Material, wanted: list[tuple[EventKind, float]]
) -> None:
    parts = [layer("first", material, 2, 5), layer("wall", WALL, 8, 9)]
    found = echoes(parts, 0.0)
    assert [(kind, strength) for kind, _, _, strength in found] == wanted


@given(
    st.lists(
        st.tuples(st.floats(0.01, 2), st.floats(0.01, 2), st.floats(0, 0.4)),
        min_size=1,
        max_size=6,
    ),
    st.floats(0.1, 3),
)
def test_the_strengths_of_a_ray_that_ends_add_up_to_one(
    stack: list[tuple[float, float, float]], power: float
) -> None:
    at, parts = 1.0, []
    for gap, depth, density in stack:
        parts.append(layer("leaf", leaf(density), at + gap, at + gap + depth))
        at += gap + depth
    parts.append(layer("wall", WALL, at + 1, at + 2))
    traces = traced(parts, power)
    found = gathered(parts, traces, power)
    assert found.strength.sum() == pytest.approx(1.0)
    assert (found.strength >= 0).all()
    assert (np.diff(found.t) >= 0).all()
    assert found.ends.tolist() == [0] * (len(found.t) - 1) + [1]


def test_rays_that_answer_together_share_the_beam() -> None:
    parts = [layer("bush", leaf(0.2), 2, 5), layer("wall", WALL, 8, 9)]
    traces = traced(parts, count=6)
    weights = np.tile([0.25, 0.5, 0.25], 2)
    found = gathered(parts, traces, 1.0, weights, 3)
    assert found.beam.tolist() == [0] * 9 + [1] * 9
    assert found.t[:9].round(9).tolist() == [2.0] * 3 + [5.0] * 3 + [8.0] * 3
    assert found.row[:9].tolist() == [0, 1, 2] * 3
    assert found.strength[:3].tolist() == pytest.approx([0.15, 0.3, 0.15])
    assert [found.strength[:9].sum(), found.strength[9:].sum()] == pytest.approx([1, 1])


def test_a_ray_without_weight_is_left_out() -> None:
    parts = [layer("wall", WALL, 8, 9)]
    traces = traced(parts, count=3)
    found = gathered(parts, traces, 1.0, np.array([0.0, 1.0, 0.0]), 3)
    assert found.row.tolist() == [1]


def test_with_incidence_a_tilted_wall_gives_back_less_and_leaves_a_third() -> None:
    vertices, faces = box(1, 40, 40)
    turn = math.radians(60)
    turned = np.array(
        [[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0]]
    )
    corners = np.column_stack([vertices @ turned.T, vertices[:, 2]])
    wall = Part("wall", WALL, corners + np.array([30, 0, 0]), faces)
    parts = [layer("bush", leaf(0.2), 2, 4), wall]
    traces = traced(parts, incidence=True)
    found = gathered(parts, traces)
    assert found.strength == pytest.approx([0.4 * LEAF_BACKSCATTER, 0, 0.6 * 0.25])


@pytest.mark.parametrize(
    ("cosine", "outcome", "wanted"),
    [
        pytest.param(1.0, 1, 1.0, id="head-on"),
        pytest.param(0.0, 1, 0.0, id="grazing"),
        pytest.param(0.5, 1, 0.25, id="at 60 degrees"),
        pytest.param(math.nan, 2, LEAF_BACKSCATTER, id="in foliage"),
        pytest.param(math.nan, 0, 0.0, id="nowhere"),
    ],
)
def test_what_the_end_of_a_ray_sends_back(
    cosine: float, outcome: int, wanted: float
) -> None:
    traces = Traces(
        np.array([5.0 if outcome else math.inf]),
        np.array([outcome], np.uint8),
        np.zeros(1, np.int64),
        np.zeros(1),
        np.array([cosine]),
        np.zeros(0, EVENT),
    )
    assert backscatter(traces).tolist() == pytest.approx([wanted])


def test_the_ends_alone_are_the_last_echoes() -> None:
    parts = [layer("bush", leaf(0.2), 2, 5), layer("wall", WALL, 8, 9)]
    for last, power in ((True, 1.0), (True, 0.5), (False, 0.5), (True, math.inf)):
        there = parts if last else parts[:1]
        traces = traced(there, power, incidence=last)
        found = gathered(there, traces, power)
        ends = extract_ray_ends(traces, np.zeros(1, np.int64), power)
        rows = select_echoes(found, LAST, 1, 0.0)
        for name in EchoColumns._fields:
            wanted = getattr(found, name)[rows[rows >= 0]]
            assert getattr(ends, name).tolist() == wanted.tolist(), name


class Row(NamedTuple):
    """An echo in plain Python."""

    beam: int
    row: int
    t: float
    kind: int
    part: int
    power: float
    strength: float
    ends: int


def columns_of(rows: list[Row]) -> EchoColumns:
    names = ("i8", "i8", "f8", "u1", "i8", "f8", "f8", "u1")
    columns = zip(*rows, strict=True) if rows else [()] * 8
    arrays: list[Any] = [
        np.array(column, name) for column, name in zip(columns, names, strict=True)
    ]
    return EchoColumns(*arrays)


@st.composite
def sorted_rows(draw: st.DrawFn) -> list[Row]:
    rows = []
    for i in range(draw(st.integers(0, 12))):
        t = draw(st.one_of(st.floats(0, 3), st.integers(0, 6).map(lambda n: n / 2)))
        strength = draw(st.sampled_from([0.0, 0.1, 0.1, 0.3, 1.0]))
        ends = draw(st.integers(0, 1))
        beam = draw(st.integers(0, 2))
        rows.append(
            Row(beam, 10 * beam + i, t, ENTER + i % 5, i, 1.0 / (i + 1), strength, ends)
        )
    return sorted(rows, key=lambda row: (row.beam, row.t, row.row))


def merged_by_hand(beam: list[Row], cell: float) -> list[Row]:
    """Merge the echoes of one beam, sorted by range."""
    merged = []
    while beam:
        giving = [row for row in beam if row.strength > 0 or row.ends]
        if giving and giving[0].t - beam[0].t < cell:
            near = [row for row in beam if row.t < giving[0].t + cell]
        else:
            near = beam[:1]
        beam = beam[len(near) :]
        total = sum(row.strength for row in near)
        best = max(near, key=lambda r: (r.ends, r.strength, -near.index(r)))
        t = giving[0].t if giving and giving[0] in near else near[0].t
        if total > 0:
            t = sum(row.strength * row.t for row in near) / total
        merged.append(best._replace(t=t, strength=min(total, 1.0)))
    return merged


@given(sorted_rows(), st.sampled_from([0.0, 0.25, 0.5, 1.0]))
def test_echoes_within_a_cell_merge_from_the_nearest_on(
    rows: list[Row], cell: float
) -> None:
    wanted: list[Row] = []
    for _, group in groupby(rows, key=lambda row: row.beam):
        beam = list(group)
        wanted += merged_by_hand(beam, cell) if cell else beam
    found = merge_echoes(columns_of(rows), cell)
    for name in Row._fields:
        assert getattr(found, name).tolist() == pytest.approx(
            [getattr(row, name) for row in wanted]
        ), name


def test_merging_leaves_what_it_is_given_as_it_is() -> None:
    rows = [Row(0, i, 1 + i / 10, HIT, i, 1.0, 0.5, 1) for i in range(3)]
    given_ = columns_of(rows)
    merge_echoes(given_, 1.0)
    assert given_.t.tolist() == pytest.approx([1.0, 1.1, 1.2])


@given(sorted_rows())
def test_one_echo_of_a_beam_is_chosen(rows: list[Row]) -> None:
    found = {
        mode: select_echoes(columns_of(rows), mode, 3, 0.0)
        for mode in (LAST, FIRST, STRONGEST)
    }
    for beam in range(3):
        mine = [(i, row) for i, row in enumerate(rows) if row.beam == beam]
        ends = [i for i, row in mine if row.ends]
        giving = [i for i, row in mine if row.strength > 0]
        last = ends[-1] if ends else -1
        assert found[LAST][beam] == last
        assert found[FIRST][beam] == (giving[0] if giving else last)
        strongest = max(giving, key=lambda i: (rows[i].strength, -i), default=last)
        assert found[STRONGEST][beam] == strongest


def test_many_rays_are_sorted_whatever_their_order() -> None:
    rng = np.random.Generator(np.random.PCG64(1))
    count = 700
    events = np.zeros(2 * count, EVENT)
    events["ray"] = np.arange(2 * count)
    events["t"] = rng.uniform(0, 9, 2 * count).round(2)
    events["kind"] = HIT
    events["power"] = 1.0
    n = 2 * count
    traces = Traces(
        events["t"].copy(),
        np.ones(n, np.uint8),
        np.zeros(n, np.int64),
        np.ones(n),
        np.zeros(0),
        events,
    )
    found = gathered([], traces, 1.0, np.ones(n), count)
    for beam in range(2):
        mine = slice(beam * count, (beam + 1) * count)
        order = np.lexsort([np.arange(count), events["t"][mine]]) + beam * count
        assert found.row[mine].tolist() == order.tolist()
