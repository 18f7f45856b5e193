"""Positions of leaves, and the loss of beams at them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from radarsim.generators.plants.growth import LEAVES
from radarsim.generators.plants.plant import make_plant, rhombi
from radarsim.generators.plants.species import SHRUB, TREE, YOUNG_TREE, PlantParameters
from radarsim.geometry import Floats
from radarsim.raycast.rays import RADAR, Rays, Traces
from radarsim.raycast.tracer import Tracer
from radarsim.rng import generator_for
from radarsim.scene.material import Material
from radarsim.scene.scene import Part

LOSS = 0.25
LEAF = Material("leaf", density=0.0, sheet_loss=LOSS)


def leaves_at(middles: Floats, seed: int = 0) -> Part:
    rng = generator_for(seed, "leaves")
    mesh = rhombi(SHRUB, middles, rng.standard_normal(middles.shape), rng)
    return Part("leaves", LEAF, *mesh)


def cast(
    part: Part, through: Floats, directions: Floats, medium: int = RADAR
) -> Traces:
    """Cast rays of power 1 that start 1 m before some points."""
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    rays = Rays.uniform(
        through - directions, directions, max_range=2.0, power=1.0, medium=medium
    )
    return Tracer([part]).trace(rays)


def upright_leaf() -> Part:
    """Return a leaf across the x axis whose midrib is its diagonal y = z."""
    corners = np.array([[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1.0]])
    return Part("leaf", LEAF, corners, np.array([[0, 1, 2], [0, 2, 3]]))


@given(st.integers(0, 2**32))
def test_ray_through_the_midrib_loses_one_sheet_loss(seed: int) -> None:
    rng = generator_for(seed, "rays")
    part = leaves_at(rng.uniform(-5, 5, (1, 3)), seed)
    base, _, tip, _ = part.vertices
    through = base + rng.uniform(0.01, 0.99, (50, 1)) * (tip - base)
    traces = cast(part, through, rng.standard_normal((50, 3)))
    assert traces.power.tolist() == [1 - LOSS] * 50


@pytest.mark.parametrize(
    "direction", [(1, 0, 0), (-1, 0, 0), (1, 0.5, 0.25), (1, 1, 1)]
)
def test_ray_exactly_through_the_midrib_loses_one_sheet_loss(
    direction: tuple[float, float, float],
) -> None:
    through = np.array([[0.0, share, share] for share in (0.125, 0.25, 0.5, 0.75)])
    traces = cast(upright_leaf(), through, np.tile(np.array(direction), (4, 1)))
    assert traces.power.tolist() == [1 - LOSS] * 4


def test_ray_along_a_leaf_loses_at_most_one_sheet_loss() -> None:
    through = np.array([[0.0, 0.5, 0.5]])
    power = cast(upright_leaf(), through, np.array([[0.0, 1.0, 1.0]])).power[0]
    assert power in (1.0, 1 - LOSS)


@pytest.mark.parametrize(
    "parameters",
    [
        pytest.param(SHRUB, id="shrub"),
        pytest.param(TREE, id="tree"),
        pytest.param(YOUNG_TREE, id="young tree"),
    ],
)
def test_all_leaves_are_in_the_crown(parameters: PlantParameters) -> None:
    vertices, faces = make_plant(parameters, 3, "test").pieces[LEAVES]
    places = (vertices - parameters.centre) / parameters.half_axes
    assert np.linalg.norm(places, axis=1).max() <= 1
    assert len(faces) == 2 * parameters.leaves


def test_leaves_have_the_size_of_the_parameters_and_face_all_directions_equally() -> (
    None
):
    part = leaves_at(np.zeros((4000, 3)))
    a, b, c = (part.vertices[part.faces[:, i]] for i in range(3))
    crosses = np.cross(b - a, c - a)
    areas = np.linalg.norm(crosses, axis=1) / 2
    assert areas == pytest.approx(SHRUB.leaf_length * SHRUB.leaf_width / 4)
    normals = crosses / (2 * areas[:, None])
    assert (normals**2).mean(axis=0) == pytest.approx(1 / 3, abs=0.02)
