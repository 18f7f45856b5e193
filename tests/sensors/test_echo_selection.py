"""Merging and selection of echoes, against the same rules in plain Python."""

from itertools import groupby
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarsim.presets.sensors import load_settings
from radarsim.raycast.rays import EventKind
from radarsim.sensors import echo_extraction as extraction

ENTER, HIT, SPENT = EventKind.ENTER, EventKind.HIT, EventKind.SPENT


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
    front: float = 0.0


def table_of(rows: list[Row]) -> extraction.EchoTable:
    table = np.zeros(len(rows), extraction.ECHO)
    for name in Row._fields:
        table[name] = [getattr(row, name) for row in rows]
    return table


@st.composite
def sorted_rows(draw: st.DrawFn) -> list[Row]:
    rows = []
    for i in range(draw(st.integers(0, 12))):
        t = draw(st.one_of(st.floats(0, 3), st.integers(0, 6).map(lambda n: n / 2)))
        strength = draw(st.sampled_from([0.0, 0.1, 0.1, 0.3, 1.0]))
        ends = draw(st.integers(0, 1))
        beam = draw(st.integers(0, 2))
        kind, power = ENTER + i % 5, 1.0 / (i + 1)
        front = t - draw(st.floats(0, 1)) if kind == ENTER else t
        rows.append(Row(beam, 10 * beam + i, t, kind, i, power, strength, ends, front))
    return sorted(rows, key=lambda row: (row.beam, row.t, row.row))


def merge_in_python(beam: list[Row], cell: float) -> list[Row]:
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
        front = best.front if best.kind == ENTER else t
        if len(near) == 1 and best.kind != ENTER:
            front = best.front
        merged.append(best._replace(t=t, strength=min(total, 1.0), front=front))
    return merged


@settings(max_examples=60)
@given(sorted_rows(), st.sampled_from([0.0, 0.25, 0.5, 1.0]))
def test_echoes_within_the_resolution_merge_from_the_nearest_on(
    rows: list[Row], cell: float
) -> None:
    wanted: list[Row] = []
    for _, group in groupby(rows, key=lambda row: row.beam):
        beam = list(group)
        wanted += merge_in_python(beam, cell) if cell else beam
    found = extraction.merge_echoes(table_of(rows), cell)
    for name in Row._fields:
        assert found[name].tolist() == pytest.approx(
            [getattr(row, name) for row in wanted]
        ), name


def test_merging_does_not_change_its_input() -> None:
    rows = [Row(0, i, 1 + i / 10, HIT, i, 1.0, 0.5, 1) for i in range(3)]
    given_ = table_of(rows)
    extraction.merge_echoes(given_, 1.0)
    assert given_["t"].tolist() == pytest.approx([1.0, 1.1, 1.2])


@pytest.mark.parametrize("mode", ["last", "first", "strongest"])
@pytest.mark.parametrize("spent_reads", ["range", "nothing"])
@settings(max_examples=25)
@given(sorted_rows())
def test_each_mode_selects_its_echo(
    mode: str, spent_reads: str, rows: list[Row]
) -> None:
    settings = load_settings("radar", return_mode=mode, spent_reads=spent_reads)
    ranges, rays = np.full(3, np.inf), np.full(3, -1)
    found = extraction.select_echoes(table_of(rows), settings, ranges, rays).tolist()
    for beam in range(3):
        mine = [(i, row) for i, row in enumerate(rows) if row.beam == beam]
        ends = [i for i, row in mine if row.ends]
        giving = [i for i, row in mine if row.strength > 0]
        wanted = ends[-1] if ends else -1
        if giving and mode == "first":
            wanted = giving[0]
        elif giving and mode == "strongest":
            wanted = max(giving, key=lambda i: (rows[i].strength, -i))
        if wanted >= 0 and spent_reads == "nothing" and rows[wanted].kind == SPENT:
            wanted = -1
        selected = [i for i in found if rows[i].beam == beam]
        assert selected == [wanted] * (wanted >= 0)
        of_echo = (rows[wanted].t, rows[wanted].row) if wanted >= 0 else (np.inf, -1)
        assert (ranges[beam], rays[beam]) == of_echo
    assert found == sorted(found)
