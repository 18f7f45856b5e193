import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from parts import layer, rays_ahead

from radarsim.raycast.rays import DEFAULT_CLASSES, RADAR, EventKind, Outcome, RayClass
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material
from radarsim.scene.scene import Part

LAYERS = st.lists(
    st.tuples(
        st.floats(0.001, 20).map(lambda x: round(x, 6)),
        st.floats(0.001, 5).map(lambda x: round(x, 6)),
        st.floats(0, 2).map(lambda x: round(x, 6)),
    ),
    max_size=12,
)


def expected_end(
    layers: list[tuple[float, float, float]], power: float, wall: float
) -> tuple[float, Outcome, float]:
    """Compute the end in a stack of layers (start, thickness, density)."""
    edges = sorted({0.0, wall, *(x for a, d, _ in layers for x in (a, a + d))})
    for start, end in pairwise(edges):
        if start >= wall:
            break
        middle = (start + end) / 2
        density = math.fsum(r for a, d, r in layers if a < middle < a + d)
        cost = density * (end - start)
        if density and cost >= power - 1e-10:
            return min(start + power / density, end), Outcome.SPENT, 0.0
        power -= cost
    return wall, Outcome.HIT, power


@settings(max_examples=25)
@given(
    layers=LAYERS,
    power=st.floats(0.01, 10),
    wall=st.floats(0.5, 40),
    scale=st.floats(0.01, 1) | st.none(),
)
def test_random_stacks_of_layers_match_a_direct_sum(
    layers: list[tuple[float, float, float]],
    power: float,
    wall: float,
    scale: float | None,
) -> None:
    """Layers take units of power, or decibels, which take ``scale`` units each."""
    stack = []
    for start, depth, loss in layers:
        leaf = Material("leaf", density=loss)
        if scale:
            leaf = Material("leaf", density=0.0, radar_db=(0, 0, loss / scale))
        stack.append(layer("leaf", leaf, start, start + depth))
    classes = (RayClass(RADAR, power_per_db=scale),) if scale else DEFAULT_CLASSES
    tracer = Tracer([*stack, layer("wall", Material("wall"), wall, wall + 1.0)])
    found = tracer.trace(rays_ahead(power=power, ray_classes=classes))
    t, outcome, left = expected_end(layers, power, wall)
    if found.outcomes[0] != outcome:  # spent at the very last, or just not
        assert abs(found.power[0] - left) < 1e-7
        return
    assert found.ranges[0] == pytest.approx(t, abs=1e-7)
    assert found.power[0] == pytest.approx(left, abs=1e-7)


@settings(max_examples=25)
@given(
    st.lists(
        st.tuples(st.sampled_from([0.5, 1.0, 2.5]), st.integers(0, 3)), max_size=60
    )
)
def test_surfaces_are_crossed_by_distance_and_then_by_part(
    crossings: list[tuple[float, int]],
) -> None:
    corners = np.array([[0.0, -9, -9], [0, 9, -9], [0, 0, 9]])
    parts = []
    for part in range(4):
        places = [t for t, owner in crossings if owner == part]
        vertices = np.vstack(
            [np.zeros((0, 3)), *(corners + np.array([t, 0.0, 0.0]) for t in places)]
        )
        faces = np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)
        sheet = Material("leaf", density=0.0, sheet_loss=0.01)
        parts.append(Part("leaves", sheet, vertices, faces))
    events = Tracer(parts).trace(rays_ahead(), events=True).events[:-1]
    found = [(round(float(t), 9), int(part)) for t, part in events[["t", "part"]]]
    assert found == sorted(crossings)


def test_volume_is_entered_before_another_of_the_same_part_is_left() -> None:
    leaf = Material("leaf", density=0.1)
    near, far = (layer("leaf", leaf, x, x + 1.0) for x in (1.0, 2.0))
    vertices = np.vstack([near.vertices, far.vertices])
    faces = np.vstack([near.faces, far.faces + len(near.vertices)])
    events = Tracer([Part("leaves", leaf, vertices, faces)]).explain(rays_ahead())[0]
    found = [(event.kind, round(event.t, 9)) for event in events[:-1]]
    assert found == [(EventKind.ENTER, 1.0), (EventKind.LEAVE, 3.0)]
