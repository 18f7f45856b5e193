from typing import Any

import numpy as np
import pytest

from radarsim.geometry import Pose3
from radarsim.scene.material import Material
from radarsim.scene.scene import Part, Scene, StartPose
from radarsim.scene.shapes import box

WOOD = Material("wood")


def crate(x: float = 0.0) -> Part:
    vertices, faces = box(1, 1, 1)
    return Part("crate", WOOD, vertices + np.array([x, 0, 0]), faces)


def starts(*places: tuple[float, float, float]) -> Scene:
    poses = (
        StartPose(f"RobotStart{i}", Pose3(*place)) for i, place in enumerate(places)
    )
    return Scene("room", "DM-Room", starts=tuple(poses))


def test_part_has_its_own_read_only_arrays() -> None:
    vertices, faces = box(1, 1, 1)
    part = Part("crate", WOOD, vertices.astype(np.float32), faces.astype(np.int64))
    assert [part.vertices.dtype.name, part.faces.dtype.name] == ["float64", "int32"]
    with pytest.raises(ValueError, match="read-only"):
        part.vertices[0, 0] = 7
    with pytest.raises(ValueError, match="read-only"):
        part.faces[0, 0] = 7
    vertices[0, 0] = 7
    assert part.vertices[0, 0] == -0.5


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        pytest.param(np.zeros((3, 2)), [[0, 1, 2]], r"vertices of shape \(3, 2\)"),
        pytest.param(np.zeros((3, 3)), [0, 1, 2], r"faces of shape \(3,\)"),
        pytest.param(np.full((3, 3), np.nan), [[0, 1, 2]], "expected finite numbers"),
        pytest.param(
            np.zeros((3, 3)), [[0, 1, 3]], "vertex numbers from 0 to 3, expected 0 to 2"
        ),
        pytest.param(np.zeros((3, 3)), [[-1, 1, 2]], "numbers from -1 to 2"),
    ],
)
def test_part_refuses_malformed_arrays(vertices: Any, faces: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Part("crate", WOOD, vertices, np.array(faces))


def test_part_knows_whether_it_is_closed() -> None:
    assert crate().closed
    vertices, faces = box(1, 1, 1)
    assert not Part("crate", WOOD, vertices, faces[1:]).closed


def test_bounds_enclose_all_faces_but_not_unused_vertices() -> None:
    vertices, faces = box(1, 1, 1)
    loose = Part("crate", WOOD, np.vstack([vertices, [[99, 99, 99]]]), faces)
    empty = Part("nothing", WOOD, np.zeros((0, 3)), np.zeros((0, 3), np.int32))
    scene = Scene("room", "DM-Room", (loose, crate(4), empty))
    assert scene.bounds.tolist() == [[-0.5, -0.5, -0.5], [4.5, 0.5, 0.5]]
    assert scene.triangles == 24


def test_empty_scene_has_no_extent() -> None:
    assert Scene("room", "DM-Room").bounds.tolist() == [[0, 0, 0], [0, 0, 0]]


def test_floor_height_is_that_of_the_nearest_start() -> None:
    scene = starts((0, 0, 0.5), (10, 0, 1.5))
    assert scene.floor_at(4, 3) == 0.5
    assert scene.floor_at(6, 3) == 1.5
    assert starts().floor_at(4, 3) == 0.0


def test_start_names_are_case_insensitive() -> None:
    scene = starts((0, 0, 0), (1, 0, 0))
    assert scene.start("robotSTART1") is scene.starts[1]
    assert scene.start("RobotStart7") is None
