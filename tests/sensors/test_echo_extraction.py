"""Echoes extracted from events, against closed forms."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from parts import brick, layer, rays_ahead

from radarsim.errors import EngineError
from radarsim.presets.sensors import load_settings
from radarsim.raycast.rays import (
    DEFAULT_CLASSES,
    EVENT,
    RADAR,
    EventKind,
    RayClass,
    Traces,
)
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.sensors.echo_extraction import (
    ECHO,
    LEAF_BACKSCATTER,
    EchoTable,
    extract_echoes,
    extract_ray_ends,
    select_echoes,
)

WALL = Material("wall")
SMOKE = Material("smoke", density=0.0, solid=False)
SHEET = Material("leaves", density=0.0, sheet_loss=0.25)
ENTER, LEAVE, CROSS = EventKind.ENTER, EventKind.LEAVE, EventKind.SHEET
HIT, SPENT = EventKind.HIT, EventKind.SPENT


def leaf(density: float) -> Material:
    return Material("leaf", density=density)


def returned(left: float) -> float:
    """Return what comes back of a beam with this share of its power left.

    All of its power is 25 dB one way, half of the margin, and 50 dB out and back.
    """
    return float(10 ** (-5 * (1 - left)))


def trace_ahead(
    parts: Tracer | list[Part], power: float = 1.0, *, incidence: bool = False
) -> Traces:
    tracer = parts if isinstance(parts, Tracer) else Tracer(parts)
    return tracer.trace(rays_ahead(power=power), events=True, incidence=incidence)


def extract(
    parts: Tracer | list[Part],
    traces: Traces,
    power: float = 1.0,
    weights: Any = None,
    of_a_beam: int = 1,
) -> EchoTable:
    settings = load_settings("radar", penetration_power=power)
    weights = np.ones(len(traces.ranges)) if weights is None else weights
    tracer = parts if isinstance(parts, Tracer) else Tracer(parts)
    losses = tracer.losses(DEFAULT_CLASSES[0])
    return extract_echoes(traces, weights, of_a_beam, losses, settings)


def echoes(parts: list[Part], power: float = 1.0) -> list[tuple[Any, ...]]:
    """Return kind, front, power and strength of all echoes of one ray."""
    traces = trace_ahead(parts, power)
    found = extract(parts, traces, power)
    kinds = [EventKind(int(kind)) for kind in found["kind"]]
    numbers = zip(
        found["front"].round(9).tolist(),
        found["power"].round(9).tolist(),
        found["strength"].round(9).tolist(),
        strict=True,
    )
    return [(kind, *row) for kind, row in zip(kinds, numbers, strict=True)]


def rounded(row: tuple[Any, ...]) -> tuple[Any, ...]:
    return (row[0], *(round(number, 9) for number in row[1:]))


def test_bush_returns_what_it_takes_out_and_back_and_wall_the_rest() -> None:
    parts = [layer("bush", leaf(0.1), 2, 5), layer("wall", WALL, 8, 9)]
    behind = returned(0.7)  # 15 dB
    assert behind == pytest.approx(10**-1.5)
    assert echoes(parts) == [
        rounded((ENTER, 2.0, 1.0, 1 - behind)),
        (LEAVE, 5.0, 0.7, 0.0),
        rounded((HIT, 8.0, 0.7, behind)),
    ]


@pytest.mark.parametrize("albedo", [0.0, 0.05, 0.1, 0.2])
def test_volume_and_sheet_return_in_proportion_to_their_albedo(albedo: float) -> None:
    cloud = Material("cloud", density=0.02, albedo=albedo)
    curtain = Material("curtain", density=0.0, sheet_loss=0.1, albedo=albedo)
    of_cloud = {kind: row[-1] for kind, *row in echoes([layer("c", cloud, 2, 5)])}
    assert of_cloud[ENTER] == pytest.approx(albedo / 0.2 * (1 - returned(0.94)))
    first, second = echoes([layer("curtain", curtain, 2, 5)])
    assert first[-1] == pytest.approx(albedo / 0.2 * (1 - returned(0.9)))
    lost = returned(0.9) - returned(0.8)
    assert second[-1] == pytest.approx(albedo / 0.2 * lost)


def test_sheet_returns_what_each_crossing_takes() -> None:
    parts = [layer("leaves", SHEET, 2, 3), layer("wall", WALL, 8, 9)]
    first, second = returned(0.75), returned(0.5)
    assert echoes(parts) == [
        rounded((CROSS, 2.0, 1.0, 1 - first)),
        rounded((CROSS, 3.0, 0.75, first - second)),
        rounded((HIT, 8.0, 0.5, second)),
    ]


def test_absorbed_decibels_are_missing_from_the_echo_of_a_wall() -> None:
    dark = Material("dark", absorption_db=13.0)
    ray_classes = (RayClass(RADAR, power_per_db=1 / 25),)
    tracer = Tracer([layer("wall", dark, 8, 9)])
    rays = rays_ahead(power=1.0, ray_classes=ray_classes)
    traces = tracer.trace(rays, events=True)
    found = extract(tracer, traces)
    assert 10 * np.log10(found["strength"]) == pytest.approx([-13.0])
    ends = extract_ray_ends(traces, np.zeros(1, np.int64), load_settings("radar"))
    assert ends["strength"] == pytest.approx(found["strength"])


def test_overlapping_volumes_share_the_loss_by_density() -> None:
    parts = [layer("one", leaf(0.1), 1, 4), layer("other", leaf(0.2), 2, 3)]
    one, both, rest = (
        returned(before) - returned(behind)
        for before, behind in ((1.0, 0.9), (0.9, 0.6), (0.6, 0.5))
    )
    assert echoes(parts) == [
        rounded((ENTER, 1.0, 1.0, one + both / 3 + rest)),
        rounded((ENTER, 2.0, 0.9, both * 2 / 3)),
        (LEAVE, 3.0, 0.6, 0.0),
        (LEAVE, 4.0, 0.5, 0.0),
    ]


def test_smoke_inside_a_bush_gets_no_share_of_its_loss() -> None:
    parts = [
        layer("smoke", SMOKE, 1, 3),
        layer("bush", leaf(0.05), 2, 6),
        layer("puff", SMOKE, 4, 5),
        layer("wall", WALL, 8, 9),
    ]
    given_back = {(kind, t): strength for kind, t, _, strength in echoes(parts)}
    assert given_back.pop((ENTER, 2.0)) == pytest.approx(0.9)
    assert given_back.pop((HIT, 8.0)) == pytest.approx(0.1)
    assert set(given_back.values()) == {0.0}


def test_sheet_on_the_face_of_a_bush_keeps_its_own_loss_in_any_order() -> None:
    parts = [layer("leaves", SHEET, 4, 9), layer("bush", leaf(0.1), 4, 6)]
    for ordered in (parts, parts[::-1]):
        at_four = [row for row in echoes(ordered) if row[1] == 4.0]
        assert {kind: row[-1] for kind, *row in at_four} == {
            CROSS: pytest.approx(1 - returned(0.75)),
            ENTER: pytest.approx(returned(0.75) - returned(0.55)),
        }


def test_loss_in_the_air_returns_no_echo() -> None:
    bush, wall = layer("bush", leaf(0.1), 2, 4), layer("wall", WALL, 8, 9)
    mist = Material("mist", density=0.05, solid=False)
    tracer = Tracer([bush, wall], mist)
    found = extract(tracer, trace_ahead(tracer))
    of_bush = (returned(0.9) - returned(0.6)) * 2 / 3
    assert found["strength"] == pytest.approx([of_bush, 0.0, returned(0.4)])


def test_loss_in_a_volume_around_the_start_returns_no_echo() -> None:
    parts = [layer("bush", leaf(0.25), -1, 2), layer("wall", WALL, 8, 9)]
    assert echoes(parts) == [
        (LEAVE, 2.0, 0.5, 0.0),
        rounded((HIT, 8.0, 0.5, returned(0.5))),
    ]


@pytest.mark.parametrize(
    ("power", "material", "wanted"),
    [
        (0.0, leaf(0.5), [(ENTER, 1.0), (SPENT, 0.0)]),
        (0.0, SMOKE, [(ENTER, 0.0), (LEAVE, 0.0), (HIT, 1.0)]),
        (math.inf, leaf(0.2), [(ENTER, 0.0), (LEAVE, 0.0), (HIT, 1.0)]),
    ],
    ids=["foliage", "smoke", "unlimited power"],
)
def test_strengths_of_a_beam_without_power_or_without_limit(
    power: float, material: Material, wanted: list[tuple[EventKind, float]]
) -> None:
    parts = [layer("first", material, 2, 5), layer("wall", WALL, 8, 9)]
    found = echoes(parts, power)
    assert [(kind, strength) for kind, _, _, strength in found] == wanted


def middles(parts: list[Part], power: float = 1.0) -> dict[float, float]:
    """Return the ranges of volumes by their fronts."""
    found = extract(parts, trace_ahead(parts, power), power)
    entered = found["kind"] == ENTER
    fronts = found["front"][entered].round(6).tolist()
    return dict(zip(fronts, found["t"][entered].tolist(), strict=True))


@pytest.mark.parametrize("density", [1e-4, 0.01, 0.1, 0.2])
def test_range_of_a_bush_is_that_of_half_its_power(density: float) -> None:
    # 10^(-5 density d) falls to the mean of 1 and the rest behind 4 m
    half = (1 + math.pow(10, -5 * density * 4)) / 2
    parts = [layer("bush", leaf(density), 2, 6), layer("wall", WALL, 8, 9)]
    depth = -math.log10(half) / (5 * density)
    assert middles(parts) == {2.0: pytest.approx(2 + depth)}
    assert depth <= 2.0


def test_range_of_what_returns_nothing_is_its_front() -> None:
    parts = [layer("smoke", SMOKE, 2, 5), layer("wall", WALL, 8, 9)]
    assert middles(parts) == {2.0: 2.0}
    assert middles([layer("bush", leaf(0.2), 2, 5)], math.inf) == {2.0: 2.0}


@settings(max_examples=20)
@given(
    st.lists(
        st.tuples(st.integers(0, 60), st.integers(1, 40), st.floats(0.02, 0.3)),
        min_size=1,
        max_size=4,
        unique_by=lambda each: each[0],
    )
)
def test_ranges_of_overlapping_volumes_match_a_sum_over_short_steps(
    stack: list[tuple[int, int, float]],
) -> None:
    """Each step of 0.1 mm returns what the beam loses in it, to each by density."""
    edges = [(1 + at / 10, 1 + (at + depth) / 10) for at, depth, _ in stack]
    parts = [
        layer(f"bush {i}", leaf(density), *edge)
        for i, (edge, (_, _, density)) in enumerate(zip(edges, stack, strict=True))
    ]
    step = 1e-4
    t = np.arange(0.0, 12.0, step) + step / 2
    inside = np.array([(near < t) & (t < far) for near, far in edges])
    rates = inside * np.array([density for *_, density in stack])[:, None]
    total = rates.sum(axis=0)
    left = np.maximum(1 - np.cumsum(total) * step, 0.0)
    came = np.where(left > 0, 10 ** (-5 * (1 - left)), 0.0)
    lost = -np.diff(came, prepend=1.0)
    found = middles(parts)
    for (near, _), own in zip(edges, rates, strict=True):
        shares = np.divide(own, total, out=np.zeros(len(t)), where=total > 0)
        grown = np.cumsum(lost * shares)
        if round(near, 6) in found and grown[-1] > 1e-4:
            wanted = t[np.searchsorted(grown, grown[-1] / 2)]
            assert found[round(near, 6)] == pytest.approx(wanted, abs=2e-3)


@settings(max_examples=25)
@given(
    st.lists(
        st.tuples(st.floats(0.01, 2), st.floats(0.01, 2), st.floats(0, 0.4)),
        min_size=1,
        max_size=6,
    ),
    st.floats(0.1, 3),
)
def test_strengths_of_a_ray_that_ends_add_up_to_1(
    stack: list[tuple[float, float, float]], power: float
) -> None:
    at, parts = 1.0, []
    for gap, depth, density in stack:
        parts.append(layer("leaf", leaf(density), at + gap, at + gap + depth))
        at += gap + depth
    parts.append(layer("wall", WALL, at + 1, at + 2))
    traces = trace_ahead(parts, power)
    found = extract(parts, traces, power)
    assert found["strength"].sum() == pytest.approx(1.0)
    assert (found["strength"] >= 0).all()
    assert (np.diff(found["t"]) >= 0).all()
    assert (found["front"] <= found["t"] + 1e-9).all()
    assert found["ends"].tolist() == [0] * (len(found["t"]) - 1) + [1]


def test_combined_rays_share_the_beam() -> None:
    parts = [layer("bush", leaf(0.1), 2, 5), layer("wall", WALL, 8, 9)]
    traces = Tracer(parts).trace(rays_ahead(6, power=1.0), events=True)
    weights = np.tile([0.25, 0.5, 0.25], 2)
    found = extract(parts, traces, 1.0, weights, 3)
    assert found["beam"].tolist() == [0] * 9 + [1] * 9
    assert found["front"][:9].round(9).tolist() == [2.0] * 3 + [5.0] * 3 + [8.0] * 3
    assert found["row"][:9].tolist() == [0, 1, 2] * 3
    bush = 1 - returned(0.7)
    assert found["strength"][:3] == pytest.approx(bush * np.array([0.25, 0.5, 0.25]))
    assert found["strength"].reshape(2, 9).sum(axis=1) == pytest.approx([1, 1])


@pytest.mark.parametrize(
    ("weights", "parts"), [(0, 1), (1, 0)], ids=["other rays", "other parts"]
)
def test_events_of_others_are_refused(weights: int, parts: int) -> None:
    bush = [layer("bush", leaf(0.1), 2, 5)]
    traces = trace_ahead(bush)
    with pytest.raises(EngineError, match="rays or parts that"):
        extract(bush[:parts], traces, weights=np.ones(weights))


def test_incidence_weakens_a_tilted_wall_and_leaves() -> None:
    wall = brick(WALL, (1, 40, 40), (30, 0, 0), yaw_deg=60)
    parts = [layer("bush", leaf(0.2), 2, 4), wall]
    traces = trace_ahead(parts, incidence=True)
    found = extract(parts, traces)
    behind = returned(0.6)
    wanted = [(1 - behind) * LEAF_BACKSCATTER, 0, behind / 2]
    assert found["strength"] == pytest.approx(wanted)


def test_ray_ends_equal_the_last_echoes() -> None:
    parts = [layer("bush", leaf(0.2), 2, 5), layer("wall", WALL, 8, 9)]
    for last, power in ((True, 1.0), (True, 0.5), (False, 0.5), (True, math.inf)):
        there = parts if last else parts[:1]
        traces = trace_ahead(there, power, incidence=last)
        found = extract(there, traces, power)
        settings = load_settings("radar", penetration_power=power)
        ends = extract_ray_ends(traces, np.zeros(1, np.int64), settings)
        rows = select_echoes(found, settings, np.zeros(1), np.zeros(1, np.int64))
        for name in ECHO.names or ():
            wanted = found[name][rows]
            assert ends[name] == pytest.approx(wanted), name


@pytest.mark.parametrize("count", [1, 7, 16, 17, 32, 33, 100, 700])
def test_echoes_of_combined_rays_are_sorted_by_range_and_ray(count: int) -> None:
    rng = np.random.Generator(np.random.PCG64(1))
    events = np.zeros(2 * count, EVENT)
    events["ray"] = np.arange(2 * count)
    events["t"] = rng.uniform(0, 9, 2 * count).round(1)
    events["kind"] = HIT
    events["power"] = 1.0
    n = 2 * count
    ends = np.ones(n, np.uint8), np.zeros(n, np.int64), np.ones(n)
    traces = Traces(events["t"].copy(), *ends, np.zeros(0), events)
    found = extract([], traces, 1.0, np.ones(n), count)
    for beam in range(2):
        mine = slice(beam * count, (beam + 1) * count)
        order = np.lexsort([np.arange(count), events["t"][mine]]) + beam * count
        assert found["row"][mine].tolist() == order.tolist()
