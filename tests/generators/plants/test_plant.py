"""One shrub in three shapes."""

import numpy as np
import pytest

from radarsim.generators.plants.growth import LEAVES, WOOD
from radarsim.generators.plants.plant import (
    SHAPES,
    TUFT_RADIUS,
    ball,
    make_plant,
    make_shrubs,
)
from radarsim.generators.plants.species import SHRUB
from radarsim.scene.material import Material
from radarsim.scene.topology import connect_faces, is_closed


def test_wood_of_all_shapes_is_the_same() -> None:
    shrubs = make_shrubs(3)
    assert tuple(shrubs) == SHAPES
    first, *others = (plant.pieces[WOOD] for plant in shrubs.values())
    for vertices, faces in others:
        assert np.array_equal(vertices, first[0])
        assert np.array_equal(faces, first[1])


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_fills_the_crown_exactly(shape: str) -> None:
    vertices, _ = make_shrubs(3)[shape].pieces[LEAVES]
    radius = np.linalg.norm(vertices - SHRUB.centre, axis=1)
    assert radius.max() <= SHRUB.crown_radius * (1 + 1e-12)
    directions = np.vstack([np.eye(3), -np.eye(3)])
    extents = ((vertices - SHRUB.centre) @ directions.T).max(axis=0)
    assert extents.min() > 0.9 * SHRUB.crown_radius


def test_volumes_are_closed_and_a_cloud_has_a_ball_for_each_twig() -> None:
    shrubs = make_shrubs(3)
    for shape in ("ball", "cloud"):
        assert is_closed(shrubs[shape].pieces[LEAVES][1])
    _, faces = shrubs["cloud"].pieces[LEAVES]
    assert connect_faces(faces).components == SHRUB.twigs
    assert len(faces) == SHRUB.twigs * len(ball(np.zeros(3), TUFT_RADIUS)[1])


def test_parts_are_at_the_given_position() -> None:
    plant = make_shrubs(3)["leaves"]
    place = np.array([5.0, -2.0, 0.5])
    bark, leaf = Material("wood"), Material("leaves", density=0.0, sheet_loss=0.3)
    wood, leaves = plant.parts("shrub", bark, leaf, place)
    assert (wood.object_name, wood.material) == ("shrub", bark)
    assert (leaves.object_name, leaves.material) == ("shrub", leaf)
    assert np.array_equal(wood.vertices, plant.wood[0] + place)
    assert np.array_equal(leaves.vertices, plant.foliage[0] + place)
    assert plant.triangles == len(wood.faces) + len(leaves.faces)


def test_other_name_gives_another_plant() -> None:
    one, same, other = (make_plant(SHRUB, 1, name) for name in ("a", "a", "b"))
    assert np.array_equal(one.foliage[0], same.foliage[0])
    assert not np.array_equal(one.foliage[0], other.foliage[0])
