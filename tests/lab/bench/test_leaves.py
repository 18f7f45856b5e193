import pytest

from radarsim.generators.plants.plant import make_shrubs
from radarsim.lab.bench.engine import LEAF_SPACING, leaf_scene


@pytest.mark.parametrize("triangles", [1, 60_000, 200_000])
def test_number_of_triangles_is_right_to_half_a_shrub(
    triangles: int,
) -> None:
    one = make_shrubs(0)["leaves"].triangles
    scene = leaf_scene(triangles)
    assert abs(scene.triangles - max(triangles, one)) <= one / 2 + 12


def test_shrubs_in_the_room_touch_neither_each_other_nor_the_sensor() -> None:
    room, *parts = leaf_scene(80_000).parts
    low, high = room.vertices.min(axis=0), room.vertices.max(axis=0)
    names = {part.object_name for part in parts}
    assert len(names) == len(parts) / 2 == 5
    assert LEAF_SPACING > 2
    for part in parts:
        assert (part.vertices[:, :2] > low[:2]).all()
        assert (part.vertices < high).all()
        assert part.vertices[:, 0].min() > -5.1  # the sensor is at x = -6


def test_scene_is_reproducible() -> None:
    one, same = leaf_scene(30_000), leaf_scene(30_000)
    for part, twin in zip(one.parts, same.parts, strict=True):
        assert part.vertices.tolist() == twin.vertices.tolist()
