import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarsim.raycast import attenuation
from radarsim.raycast.attenuation import (
    EVENT,
    EventKind,
    Outcome,
    RayCosts,
    RayEnd,
    RayState,
    SegmentEnd,
    advance_ray,
    end_ray,
    new_ray_state,
    start_ray,
    update_winding,
)
from radarsim.raycast.crossings import CROSSING, sort_crossings

Crossing = tuple[float, int, int]


def state_of(crossings: list[Crossing], parts: int, events: int = 0) -> RayState:
    """Return a state with given crossings, sorted, without casting a ray."""
    rows = np.zeros(max(len(crossings), 1), CROSSING)
    rows[: len(crossings)] = crossings
    sort_crossings(rows, len(crossings))
    notes = np.zeros(events + 1 if events else 0, EVENT)
    return new_ray_state(parts, rows, notes)


def follow(
    ray: int, power: float, limit: SegmentEnd, costs: RayCosts, state: RayState
) -> RayEnd:
    """Follow a ray of one segment from its start to where it ends."""
    progress = advance_ray(ray, start_ray(ray, power, state), limit, costs, state)
    end = end_ray(ray, progress, limit, 0.0, state)
    assert isinstance(end, RayEnd)
    return end


def ended(
    crossings: list[Crossing],
    densities: list[float],
    *,
    power: float = 1.0,
    max_range: float = 100.0,
    hit: int = -1,
    sheets: dict[int, float] | None = None,
    within: tuple[int, ...] = (),
) -> RayEnd:
    state = state_of(crossings, len(densities))
    losses = np.full(len(densities), np.nan)
    for part, loss in (sheets or {}).items():
        losses[part] = loss
    for part in within:
        update_winding(state, part, 1)
    ending = follow(
        0,
        power,
        SegmentEnd(len(crossings), max_range, hit),
        RayCosts(np.array(densities), losses),
        state,
    )
    assert isinstance(ending, RayEnd)
    assert not state.winding.any(), "winding numbers are forgotten"
    assert not state.seen.any()
    assert state.sizes.tolist() == [0, 0]
    return ending


def test_power_runs_out_after_power_divided_by_density() -> None:
    ending = ended([(2, 0, 1), (6, 0, -1)], [0.5])
    assert ending == RayEnd(4.0, Outcome.SPENT, 0, 0.0)


def test_remaining_power_arrives_at_the_wall() -> None:
    ending = ended([(2, 0, 1), (3, 0, -1)], [0.5], max_range=7.0, hit=4)
    assert ending == RayEnd(7.0, Outcome.HIT, 4, 0.5)


def test_ray_that_meets_nothing_ends_at_its_maximum_range() -> None:
    assert ended([], [], max_range=9.0) == RayEnd(9.0, Outcome.NOTHING, -1, 1.0)


def test_densities_of_enclosing_volumes_add_up_and_the_last_entered_is_reported() -> (
    None
):
    ending = ended([(1, 0, 1), (2, 1, 1), (9, 1, -1), (9, 0, -1)], [0.25, 0.5])
    assert ending == RayEnd(3.0, Outcome.SPENT, 1, 0.0)


def test_start_inside_a_volume_loses_power_from_there() -> None:
    ending = ended([(3, 0, -1), (5, 1, -1)], [0.05, 0.1], within=(0, 1), max_range=8.0)
    assert ending.power == pytest.approx(1 - 3 * 0.05 - 5 * 0.1)


def test_overlapping_shells_of_one_part_count_once() -> None:
    ending = ended([(1, 0, 1), (2, 0, 1), (3, 0, -1), (4, 0, -1)], [0.1])
    assert ending.power == pytest.approx(0.7)


def test_cavity_costs_nothing() -> None:
    ending = ended([(1, 0, 1), (2, 0, -1), (5, 0, 1), (6, 0, -1)], [0.1])
    assert ending.power == pytest.approx(0.8)


@pytest.mark.parametrize("first", [1, -1], ids=["in first", "out first"])
def test_grazed_edge_costs_nothing_in_either_order(first: int) -> None:
    ending = ended([(1, 0, first), (np.nextafter(1, 2), 0, -first)], [1.0])
    assert ending.power == pytest.approx(1.0, abs=1e-15)


def test_each_surface_of_a_sheet_takes_its_loss() -> None:
    ending = ended([(1, 0, 1), (2, 0, 1), (3, 0, -1)], [0.0], sheets={0: 0.25})
    assert ending == RayEnd(100.0, Outcome.NOTHING, -1, 0.25)


def test_sheet_that_takes_the_rest_is_where_power_is_spent() -> None:
    crossings = [(float(t), 0, 1) for t in range(1, 12)]
    ending = ended(crossings, [0.0], sheets={0: 0.1})
    assert ending == RayEnd(10.0, Outcome.SPENT, 0, 0.0)


def test_power_of_the_size_of_rounding_errors_is_spent() -> None:
    thirds = [(0.1 + 0.2, 0, 1), (0.1 + 0.2 + 0.7 / 0.7, 0, -1)]
    ending = ended(thirds, [1.0], max_range=50.0, hit=0)
    assert ending.outcome == Outcome.SPENT
    assert ending.t == pytest.approx(1.3)


@pytest.mark.parametrize("power", [math.inf, 1e300])
def test_infinite_power_is_never_spent(power: float) -> None:
    ending = ended([(1, 0, 1), (5, 0, -1)], [3.0], power=power, max_range=6, hit=1)
    assert ending == RayEnd(6.0, Outcome.HIT, 1, power)


def test_ray_without_power_ends_at_the_first_density() -> None:
    ending = ended([(1, 0, 1), (2, 1, 1)], [0.0, 0.5], power=0.0)
    assert ending == RayEnd(2.0, Outcome.SPENT, 1, 0.0)


LAYERS = st.lists(
    st.tuples(
        st.floats(0, 20).map(lambda x: round(x, 6)),
        st.floats(0, 5).map(lambda x: round(x, 6)),
        st.floats(0, 2).map(lambda x: round(x, 6)),
    ),
    max_size=12,
)


def expected_end(
    layers: list[tuple[float, float, float]], power: float, max_range: float
) -> tuple[float, Outcome, float]:
    """Compute the end in a stack of layers (start, thickness, density)."""
    edges = sorted({0.0, max_range, *(x for a, d, _ in layers for x in (a, a + d))})
    for start, end in pairwise(edges):
        if start >= max_range:
            break
        middle = (start + end) / 2
        density = math.fsum(r for a, d, r in layers if a < middle < a + d)
        cost = density * (end - start)
        if density and cost >= power - 1e-10:
            return min(start + power / density, end), Outcome.SPENT, 0.0
        power -= cost
    return max_range, Outcome.HIT, power


@settings(deadline=None)  # the first call compiles
@given(layers=LAYERS, power=st.floats(0.01, 10), max_range=st.floats(0.5, 40))
def test_random_stacks_of_layers_match_a_direct_sum(
    layers: list[tuple[float, float, float]], power: float, max_range: float
) -> None:
    crossings = [
        crossing
        for part, (start, thickness, _) in enumerate(layers)
        for crossing in ((start, part, 1), (start + thickness, part, -1))
        if crossing[0] <= max_range
    ]
    ending = ended(
        crossings,
        [density for _, _, density in layers] or [0.0],
        power=power,
        max_range=max_range,
        hit=99,
    )
    t, outcome, left = expected_end(layers, power, max_range)
    if ending.outcome != outcome:  # spent at the very last, or just not
        assert abs(ending.power - left) < 1e-9
        return
    assert ending.t == pytest.approx(t, abs=1e-9)
    assert ending.power == pytest.approx(left, abs=1e-9)


@settings(deadline=None)  # the first call compiles
@given(
    st.lists(
        st.tuples(
            st.sampled_from([0.0, 0.5, 1.0, 2.5]),
            st.integers(0, 3),
            st.sampled_from([1, -1]),
        ),
        max_size=60,
    )
)
def test_crossings_are_sorted_by_distance_then_part_then_entering_first(
    crossings: list[Crossing],
) -> None:
    rows = np.array(crossings, CROSSING)
    sort_crossings(rows, len(rows))
    wanted = sorted(crossings, key=lambda c: (c[0], c[1], -c[2]))
    assert [tuple(row) for row in rows.tolist()] == wanted


def test_events_beyond_the_capacity_are_counted() -> None:
    state = state_of([(1, 0, 1), (2, 0, -1)], 1, events=2)
    costs = RayCosts(np.array([0.1]), np.array([np.nan]))
    follow(7, 1.0, SegmentEnd(2, 5.0, -1), costs, state)
    assert state.events[-1]["ray"] == 3
    assert state.events[:2].tolist() == [
        (7, 1.0, 0, EventKind.ENTER, 1.0, 0.0, 0.0, 0.0, 0.0),
        (7, 2.0, 0, EventKind.LEAVE, 0.9, 0.0, 0.0, 0.0, 0.0),
    ]


@pytest.mark.parametrize("power", [0.3, 50.0])
@pytest.mark.parametrize("hit", [-1, 5])
@pytest.mark.parametrize(
    ("crossings", "within"),
    [
        pytest.param([(1, 0, 1), (2, 1, 1), (9, 0, -1)], (), id="in and out"),
        pytest.param([(1, 0, -1), (2, 2, 1), (3, 2, 1)], (1, 0), id="sheets"),
        pytest.param([(1, 0, 1), (1, 0, 1), (2, 0, -1), (3, 0, -1)], (), id="twice in"),
    ],
)
def test_python_and_machine_code_agree(
    monkeypatch: pytest.MonkeyPatch,
    crossings: list[Crossing],
    within: tuple[int, ...],
    hit: int,
    power: float,
) -> None:
    costs = RayCosts(np.array([0.1, 0.3, 0.0]), np.array([np.nan, np.nan, 0.2]))
    stop = SegmentEnd(len(crossings), 100.0, hit)

    def run(state: RayState) -> tuple[Any, Any]:
        for part in within:
            attenuation.update_winding(state, part, 1)
        progress = attenuation.start_ray(0, power, state)
        progress = attenuation.advance_ray(0, progress, stop, costs, state)
        end = attenuation.end_ray(0, progress, stop, 0.0, state)
        return end, state.events.tolist()

    wanted = run(state_of(crossings, 3, events=20))
    state = state_of(crossings, 3, events=20)
    for name, function in list(vars(attenuation).items()):
        if hasattr(function, "py_func"):
            monkeypatch.setattr(attenuation, name, function.py_func)
    records = {
        name: getattr(state, name).view(np.recarray) for name in ("crossings", "events")
    }
    assert run(state._replace(**records)) == wanted
