"""Plants: their wood and its surface, their leaves, and the shipped mesh files."""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[1] / "examples" / "thesis"))

import plants
from plants import LEAVES, SHRUB, WOOD, ball

from radarsim import shipped_maps
from radarsim.geometry import Floats
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import Tracer
from radarsim.rng import generator_for
from radarsim.scene.material import Material
from radarsim.scene.meshes import read_surfaces
from radarsim.scene.scene import Part
from radarsim.scene.shapes import Faces, Surface
from radarsim.scene.topology import connect_faces, is_closed

FORMS = pytest.mark.parametrize(
    "species",
    [SHRUB, plants.TREE, plants.YOUNG_TREE],
    ids=["shrub", "tree", "young tree"],
)
LOSS = 0.25
LEAF = Material("leaf", density=0.0, sheet_loss=LOSS)
SHIPPED = shipped_maps()["forest_edge"].parent / "meshes"


def volumes(vertices: Floats, faces: Faces) -> Floats:
    """Return the signed volume of each connected component, m³."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    sixths = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    return np.bincount(connect_faces(faces).labels, weights=sixths).astype(np.float64)


def relative(points: Floats, species: plants.Species) -> Floats:
    """Return how far points are from the middle of a crown; 1 is its surface."""
    places = (points - species.centre) / species.half_axes
    return np.asarray(np.linalg.norm(places, axis=1))


@FORMS
def test_wood_grows_from_the_ground_to_twigs_that_end_in_the_crown(
    species: plants.Species,
) -> None:
    skeleton = plants.Skeleton(species, generator_for(0, "test"))
    points, parents = np.array(skeleton.points), np.array(skeleton.parents)
    radii, rooted = skeleton.radii, np.flatnonzero(parents >= 0)
    assert len(skeleton.tips) == species.twigs
    assert relative(skeleton.tips, species).max() < 1
    assert points[parents < 0, 2].tolist() == [0.0] * species.stems
    assert (parents[rooted] < rooted).all()
    assert (radii[rooted] <= radii[parents[rooted]]).all()
    assert radii.max() == pytest.approx(species.stem_radius)
    assert radii.min() == pytest.approx(species.tip_radius)
    forks = np.flatnonzero(np.bincount(parents[rooted]) > 1)
    assert len(forks) > species.twigs / 4
    assert points[forks, 2].min() >= species.clear_height
    vertices, faces = skeleton.bark()
    assert is_closed(faces)
    assert volumes(vertices, faces).min() > 0
    ends = set(range(len(points))) - set(parents.tolist())
    assert connect_faces(faces).components == len(ends)


@pytest.mark.parametrize("direction", [(1, 0, 0), (0, 0, 1), (1, -2, 3)])
def test_tube_has_the_volume_of_its_frustum_and_its_tip(
    direction: tuple[float, float, float],
) -> None:
    along = np.array(direction) / np.linalg.norm(direction)
    middle = np.outer([0.0, 2.0, 3.0], along)
    vertices, faces = plants.tube(middle, np.array([0.2, 0.1, 0.0]), 256)
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


def leaves_at(middles: Floats, seed: int = 0) -> Part:
    rng = generator_for(seed, "leaves")
    mesh = plants.rhombi(SHRUB, middles, rng.standard_normal(middles.shape), rng)
    return Part("leaves", LEAF, *mesh)


def power_behind(part: Part, through: Floats, directions: Floats) -> list[float]:
    """Return what rays of power 1 have left 1 m behind some points."""
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    rays = Rays.uniform(through - directions, directions, max_range=2.0, power=1.0)
    return [float(power) for power in Tracer([part]).trace(rays).power]


@given(st.integers(0, 2**32))
def test_ray_through_the_midrib_loses_one_sheet_loss(seed: int) -> None:
    rng = generator_for(seed, "rays")
    part = leaves_at(rng.uniform(-5, 5, (1, 3)), seed)
    base, _, tip, _ = part.vertices
    through = base + rng.uniform(0.01, 0.99, (50, 1)) * (tip - base)
    found = power_behind(part, through, rng.standard_normal((50, 3)))
    assert found == [1 - LOSS] * 50


def upright_leaf() -> Part:
    """Return a leaf across the x axis whose midrib is its diagonal y = z."""
    corners = np.array([[0, 0, 0], [0, 1, 0], [0, 1, 1], [0, 0, 1.0]])
    return Part("leaf", LEAF, corners, np.array([[0, 1, 2], [0, 2, 3]]))


@pytest.mark.parametrize(
    "direction", [(1, 0, 0), (-1, 0, 0), (1, 0.5, 0.25), (1, 1, 1)]
)
def test_ray_exactly_through_the_midrib_loses_one_sheet_loss(
    direction: tuple[float, float, float],
) -> None:
    through = np.array([[0.0, share, share] for share in (0.125, 0.25, 0.5, 0.75)])
    directions = np.tile(np.array(direction), (4, 1))
    assert power_behind(upright_leaf(), through, directions) == [1 - LOSS] * 4


def test_ray_along_a_leaf_loses_at_most_one_sheet_loss() -> None:
    along = np.array([[0.0, 1.0, 1.0]])
    (power,) = power_behind(upright_leaf(), along / 2, along)
    assert power in (1.0, 1 - LOSS)


@FORMS
def test_all_leaves_are_in_the_crown(species: plants.Species) -> None:
    vertices, faces = plants.make_plant(species, 3, "test")[LEAVES]
    assert relative(vertices, species).max() <= 1
    assert len(faces) == 2 * species.leaves


def test_leaves_have_their_size_and_face_all_directions_equally() -> None:
    part = leaves_at(np.zeros((4000, 3)))
    a, b, c = (part.vertices[part.faces[:, i]] for i in range(3))
    crosses = np.cross(b - a, c - a)
    areas = np.linalg.norm(crosses, axis=1) / 2
    assert areas == pytest.approx(SHRUB.leaf_length * SHRUB.leaf_width / 4)
    normals = crosses / (2 * areas[:, None])
    assert (normals**2).mean(axis=0) == pytest.approx(1 / 3, abs=0.02)


def test_shapes_of_a_shrub_have_the_same_wood_and_fill_its_crown() -> None:
    shrubs = plants.make_shrubs(3)
    assert tuple(shrubs) == plants.SHAPES
    for shrub in shrubs.values():
        for index in range(2):
            assert np.array_equal(shrub[WOOD][index], shrubs["ball"][WOOD][index])
        vertices, _ = shrub[LEAVES]
        assert relative(vertices, SHRUB).max() <= 1 + 1e-12
        directions = np.vstack([np.eye(3), -np.eye(3)])
        extents = ((vertices - SHRUB.centre) @ directions.T).max(axis=0)
        assert extents.min() > 0.9 * SHRUB.crown_radius
    _, faces = shrubs["cloud"][LEAVES]
    assert is_closed(faces)
    assert is_closed(shrubs["ball"][LEAVES][1])
    assert connect_faces(faces).components == SHRUB.twigs
    assert len(faces) == SHRUB.twigs * len(ball(np.zeros(3), plants.TUFT_RADIUS)[1])


def test_other_name_gives_another_plant() -> None:
    one, same, other = (
        plants.make_plant(SHRUB, 1, name)[LEAVES][0] for name in ("a", "a", "b")
    )
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def surfaces(folder: Path, name: str) -> dict[str | None, Surface]:
    found = read_surfaces(folder / f"{name}.glb", folder)
    return {surface.material: surface for surface in found}


def test_shipped_meshes_are_those_that_the_script_writes(tmp_path: Path) -> None:
    files, folder = plants.plant_files(plants.SEED), tmp_path.resolve()
    assert sorted(path.name for path in SHIPPED.iterdir()) == sorted(files)
    for name, data in files.items():
        (folder / name).write_bytes(data)
        shipped, new = (surfaces(each, name[:-4]) for each in (SHIPPED, folder))
        assert set(shipped) == set(new) == {WOOD, LEAVES}
        for material, surface in shipped.items():
            assert np.array_equal(surface.faces, new[material].faces)
            # another machine may round differently, which moves a vertex by one step
            away = np.abs(surface.vertices - new[material].vertices)
            assert away.max() < 1.5 * plants.GRID


def test_mesh_survives_the_file_with_y_up(tmp_path: Path) -> None:
    plant, folder = plants.make_shrubs(1)["cloud"], tmp_path.resolve()
    (folder / "shrub.glb").write_bytes(plants.encode_glb(plant))
    for name, surface in surfaces(folder, "shrub").items():
        vertices, faces = plant[name or ""]
        x, y, z = surface.vertices.T
        back = np.column_stack([x, -z, y])
        assert np.abs(back - vertices).max() < 0.6 * plants.GRID
        assert np.array_equal(surface.faces, faces)
