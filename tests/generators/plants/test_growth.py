"""Growth of wood, its radii, and its surface."""

import numpy as np
import pytest

from radarsim.generators.plants.growth import Skeleton, grow
from radarsim.generators.plants.plant import ball, bark, tube
from radarsim.generators.plants.species import SHRUB, TREE, YOUNG_TREE, PlantParameters
from radarsim.geometry import Floats
from radarsim.rng import generator_for
from radarsim.scene.shapes import Faces
from radarsim.scene.topology import connect_faces, is_closed

FORMS = [
    pytest.param(SHRUB, id="shrub"),
    pytest.param(TREE, id="tree"),
    pytest.param(YOUNG_TREE, id="young tree"),
]


def grown(parameters: PlantParameters, seed: int = 0) -> Skeleton:
    return grow(parameters, generator_for(seed, "test"))


def volumes(vertices: Floats, faces: Faces) -> Floats:
    """Return the signed volume of each connected component, m³."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    sixths = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    return np.bincount(connect_faces(faces).labels, weights=sixths).astype(np.float64)


@pytest.mark.parametrize("parameters", FORMS)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_every_twig_ends_in_the_crown(parameters: PlantParameters, seed: int) -> None:
    skeleton = grown(parameters, seed)
    assert len(skeleton.tips) == parameters.twigs
    places = (skeleton.points[skeleton.tips] - parameters.centre) / parameters.half_axes
    assert np.linalg.norm(places, axis=1).max() < 1


@pytest.mark.parametrize("parameters", FORMS)
def test_all_wood_is_connected_to_the_ground(parameters: PlantParameters) -> None:
    skeleton = grown(parameters)
    roots = np.flatnonzero(skeleton.parents < 0)
    assert len(roots) == parameters.stems
    assert np.abs(skeleton.points[roots, 2]).max() == 0
    rooted = np.flatnonzero(skeleton.parents >= 0)
    assert (skeleton.parents[rooted] < rooted).all()


@pytest.mark.parametrize("parameters", FORMS)
def test_branches_are_no_thicker_than_their_parents(
    parameters: PlantParameters,
) -> None:
    skeleton = grown(parameters)
    rooted = skeleton.parents >= 0
    thinner = skeleton.radii[rooted] <= skeleton.radii[skeleton.parents[rooted]]
    assert thinner.all()
    assert skeleton.radii.max() == pytest.approx(parameters.stem_radius)
    assert skeleton.radii.min() == pytest.approx(parameters.tip_radius)


@pytest.mark.parametrize("parameters", FORMS)
def test_nothing_branches_off_below_the_clear_height(
    parameters: PlantParameters,
) -> None:
    skeleton = grown(parameters)
    children = np.bincount(skeleton.parents[skeleton.parents >= 0])
    forks = np.flatnonzero(children > 1)
    assert len(forks) > parameters.twigs / 4
    assert skeleton.points[forks, 2].min() >= parameters.clear_height


@pytest.mark.parametrize("parameters", FORMS)
def test_bark_is_closed_tubes_oriented_outward(parameters: PlantParameters) -> None:
    skeleton = grown(parameters)
    vertices, faces = bark(skeleton)
    assert is_closed(faces)
    assert volumes(vertices, faces).min() > 0
    ends = set(range(len(skeleton.points))) - set(skeleton.parents.tolist())
    assert connect_faces(faces).components == len(ends)


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, -2, 3)])
def test_tube_has_the_volume_of_its_frustum_and_its_tip(
    direction: tuple[float, float, float],
) -> None:
    along = np.array(direction) / np.linalg.norm(direction)
    middle = np.outer([0.0, 2.0, 3.0], along)
    vertices, faces = tube(middle, np.array([0.2, 0.1, 0.0]), 256)
    frustum = np.pi * 2.0 * (0.2**2 + 0.2 * 0.1 + 0.1**2) / 3
    tip = np.pi * 1.0 * 0.1**2 / 3
    assert volumes(vertices, faces) == pytest.approx([frustum + tip], rel=1e-3)


def test_ball_lies_on_its_sphere_and_fills_most_of_it() -> None:
    centre = np.array([1.0, 2.0, 3.0])
    vertices, faces = ball(centre, 0.25)
    assert np.linalg.norm(vertices - centre, axis=1) == pytest.approx(0.25)
    assert is_closed(faces)
    sphere = 4 / 3 * np.pi * 0.25**3
    assert 0.75 * sphere < volumes(vertices, faces)[0] < sphere
