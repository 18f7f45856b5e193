import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radarsim.raycast.attenuation import EventKind, Outcome
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import Tracer
from radarsim.scene.material import Material
from radarsim.scene.scene import Part
from radarsim.scene.shapes import box

LAYERS = st.lists(
    st.tuples(
        st.floats(0.001, 20).map(lambda x: round(x, 6)),
        st.floats(0.001, 5).map(lambda x: round(x, 6)),
        st.floats(0, 2).map(lambda x: round(x, 6)),
    ),
    max_size=12,
)


def layer(material: Material, start: float, thickness: float) -> Part:
    vertices, faces = box(thickness, 4, 4)
    middle = np.array([start + thickness / 2, 0.3, 0.2])
    return Part(material.name, material, vertices + middle, faces)


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
@given(layers=LAYERS, power=st.floats(0.01, 10), wall=st.floats(0.5, 40))
def test_random_stacks_of_layers_match_a_direct_sum(
    layers: list[tuple[float, float, float]], power: float, wall: float
) -> None:
    stack = [layer(Material("leaf", density=r), a, d) for a, d, r in layers]
    tracer = Tracer([*stack, layer(Material("wall"), wall, 1.0)])
    rays = Rays.uniform(np.zeros((1, 3)), np.eye(3)[:1], max_range=50.0, power=power)
    found = tracer.trace(rays)
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
    rays = Rays.uniform(np.zeros((1, 3)), np.eye(3)[:1], max_range=9.0)
    events = Tracer(parts).trace(rays, events=True).events[:-1]
    found = [(round(float(t), 9), int(part)) for t, part in events[["t", "part"]]]
    assert found == sorted(crossings)


def test_volume_is_entered_before_another_of_the_same_part_is_left() -> None:
    near, far = (layer(Material("leaf", density=0.1), x, 1.0) for x in (1.0, 2.0))
    vertices = np.vstack([near.vertices, far.vertices])
    faces = np.vstack([near.faces, far.faces + len(near.vertices)])
    both = Part("leaves", near.material, vertices, faces)
    rays = Rays.uniform(np.zeros((1, 3)), np.eye(3)[:1], max_range=9.0)
    events = Tracer([both]).explain(rays)[0]
    found = [(event.kind, round(event.t, 9)) for event in events[:-1]]
    assert found == [(EventKind.ENTER, 1.0), (EventKind.LEAVE, 3.0)]
