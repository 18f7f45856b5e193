"""Wood: where it grows, how thick it is, and the bark around it."""

from dataclasses import replace

import numpy as np
import pytest

from radarsim.geometry import Floats
from radarsim.plants.growth import (
    SHRUB,
    TREE,
    YOUNG_TREE,
    PlantParameters,
    Skeleton,
    grow,
)
from radarsim.plants.mesh import ball, bark, join, tube
from radarsim.rng import generator_for
from radarsim.scene.shapes import Faces
from radarsim.scene.topology import is_closed, label_components

FORMS = [
    pytest.param(SHRUB, id="shrub"),
    pytest.param(TREE, id="tree"),
    pytest.param(YOUNG_TREE, id="young tree"),
]


def grown(form: PlantParameters, seed: int = 0) -> Skeleton:
    return grow(form, generator_for(seed, "test"))


def volumes(vertices: Floats, faces: Faces) -> Floats:
    """Give the signed volume of each shell, m³."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    sixths = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    return np.bincount(label_components(faces), weights=sixths).astype(np.float64)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_every_twig_ends_in_the_crown(form: PlantParameters, seed: int) -> None:
    skeleton = grown(form, seed)
    assert len(skeleton.tips) == form.twigs
    places = (skeleton.points[skeleton.tips] - form.centre) / form.half_axes
    assert np.linalg.norm(places, axis=1).max() < 1


@pytest.mark.parametrize("form", FORMS)
def test_all_wood_comes_out_of_the_ground(form: PlantParameters) -> None:
    skeleton = grown(form)
    roots = np.flatnonzero(skeleton.parents < 0)
    assert len(roots) == form.stems
    assert np.abs(skeleton.points[roots, 2]).max() == 0
    rooted = np.flatnonzero(skeleton.parents >= 0)
    assert (skeleton.parents[rooted] < rooted).all()


@pytest.mark.parametrize("form", FORMS)
def test_wood_is_no_thicker_than_what_it_grows_out_of(form: PlantParameters) -> None:
    skeleton = grown(form)
    rooted = skeleton.parents >= 0
    thinner = skeleton.radii[rooted] <= skeleton.radii[skeleton.parents[rooted]]
    assert thinner.all()
    assert skeleton.radii.max() == pytest.approx(form.stem_radius)
    assert skeleton.radii.min() == pytest.approx(form.tip_radius)


@pytest.mark.parametrize("form", FORMS)
def test_nothing_branches_off_below_the_clear_height(form: PlantParameters) -> None:
    skeleton = grown(form)
    children = np.bincount(skeleton.parents[skeleton.parents >= 0])
    forks = np.flatnonzero(children > 1)
    assert len(forks) > form.twigs / 4
    assert skeleton.points[forks, 2].min() >= form.clear_height


def test_wood_that_may_branch_once_has_twigs_on_its_stems_alone() -> None:
    skeleton = grown(replace(TREE, levels=1))
    children = np.bincount(skeleton.parents[skeleton.parents >= 0])
    forks = skeleton.points[np.flatnonzero(children > 1)]
    assert np.hypot(forks[:, 0], forks[:, 1]).max() < 0.3  # the stem leans a little


def test_the_more_directly_the_more_wood() -> None:
    def length(directness: float) -> float:
        skeleton = grown(replace(SHRUB, directness=directness))
        rooted = skeleton.parents >= 0
        starts = skeleton.points[skeleton.parents[rooted]]
        return float(np.linalg.norm(skeleton.points[rooted] - starts, axis=1).sum())

    assert length(0.0) < length(1.0)


def test_of_one_seed_there_is_one_plant() -> None:
    one, same, other = grown(TREE), grown(TREE), grown(TREE, 1)
    assert one.points.tolist() == same.points.tolist()
    assert one.points.tolist() != other.points.tolist()


@pytest.mark.parametrize("form", FORMS)
def test_bark_is_closed_tubes_wound_outward(form: PlantParameters) -> None:
    skeleton = grown(form)
    vertices, faces = bark(skeleton)
    assert is_closed(faces)
    assert volumes(vertices, faces).min() > 0
    ends = set(range(len(skeleton.points))) - set(skeleton.parents.tolist())
    assert label_components(faces).max() + 1 == len(ends)


@pytest.mark.parametrize("way", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, -2, 3)])
def test_a_tube_has_the_volume_of_its_frustum_and_its_tip(
    way: tuple[float, float, float],
) -> None:
    along = np.array(way) / np.linalg.norm(way)
    middle = np.outer([0.0, 2.0, 3.0], along)
    vertices, faces = tube(middle, np.array([0.2, 0.1, 0.0]), 256)
    frustum = np.pi * 2.0 * (0.2**2 + 0.2 * 0.1 + 0.1**2) / 3
    tip = np.pi * 1.0 * 0.1**2 / 3
    assert volumes(vertices, faces) == pytest.approx([frustum + tip], rel=1e-3)


def test_a_ball_lies_on_its_sphere_and_fills_most_of_it() -> None:
    centre = np.array([1.0, 2.0, 3.0])
    vertices, faces = ball(centre, 0.25)
    assert np.linalg.norm(vertices - centre, axis=1) == pytest.approx(0.25)
    assert is_closed(faces)
    sphere = 4 / 3 * np.pi * 0.25**3
    assert 0.75 * sphere < volumes(vertices, faces)[0] < sphere


def test_joined_meshes_keep_their_own_vertices() -> None:
    one = ball(np.zeros(3), 1.0)
    vertices, faces = join([one, one])
    assert len(vertices) == 2 * len(one[0])
    assert label_components(faces).max() == 1
