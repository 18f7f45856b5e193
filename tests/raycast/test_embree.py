import gc
import math
from typing import Any

import numpy as np
import pytest

from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.raycast import embree
from radarsim.raycast.crossings import CROSSING
from radarsim.raycast.embree import EmbreeScene, FirstHits, Mesh, open_library
from radarsim.raycast.intersect import (
    BEHIND,
    COLLECT,
    IGNORE,
    OPAQUE,
    Interval,
    intersect_backward,
    intersect_forward,
    new_ray_buffer,
)
from radarsim.scene import shapes

TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
FACE = np.array([[0, 1, 2]])


@pytest.mark.parametrize(
    ("vertices", "faces", "text"),
    [
        pytest.param(
            TRIANGLE[:, :2],
            FACE,
            "vertices of shape (3, 2), expected (n, 3)",
            id="flat",
        ),
        pytest.param(
            TRIANGLE.ravel(),
            FACE,
            "vertices of shape (9,), expected (n, 3)",
            id="a row",
        ),
        pytest.param(
            TRIANGLE,
            [[0, 1, 2, 0]],
            "faces of shape (1, 4), expected (n, 3)",
            id="quads",
        ),
        pytest.param(
            TRIANGLE, FACE * 1.0, "faces of float64, expected integers", id="real faces"
        ),
        pytest.param(
            np.vstack([TRIANGLE, [[0, math.nan, 0]]]),
            FACE,
            "vertex 3 is [0.0, nan, 0.0], expected finite numbers",
            id="nan",
        ),
        pytest.param(
            TRIANGLE + math.inf,
            FACE,
            "vertex 0 is [inf, inf, inf], expected finite numbers",
            id="infinite",
        ),
        pytest.param(
            TRIANGLE, [[0, 1, 3]], "face indices 0 to 3, expected 0 to 2", id="too high"
        ),
        pytest.param(
            TRIANGLE,
            [[-1, 1, 2]],
            "face indices -1 to 2, expected 0 to 2",
            id="negative",
        ),
        pytest.param(
            np.zeros((0, 3)),
            FACE,
            "face indices 0 to 2, expected 0 to -1",
            id="no vertex",
        ),
    ],
)
def test_wrong_meshes_are_refused(vertices: Any, faces: Any, text: str) -> None:
    with pytest.raises(EngineError) as caught:
        EmbreeScene([Mesh(TRIANGLE, FACE), Mesh(vertices, faces)])
    assert str(caught.value) == f"{text}, in mesh 1"


def test_an_error_of_embree_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    class Failing:
        rtcGetDeviceError = staticmethod(lambda _device: 4)  # noqa: N815 - Embree's name

        def __getattr__(self, name: str) -> Any:
            return getattr(open_library(), name)

    monkeypatch.setattr(embree, "open_library", Failing)
    with pytest.raises(EngineError) as caught:
        EmbreeScene([Mesh(TRIANGLE, FACE)])
    assert str(caught.value) == "Embree error 4 over 1 triangles"


def test_what_is_handed_over_may_change_afterwards() -> None:
    vertices = TRIANGLE.copy()
    scene = EmbreeScene([Mesh(vertices, FACE)])
    vertices += 50
    del vertices
    gc.collect()
    assert ahead(scene, [OPAQUE], (0.2, 0.2, 1), (0, 0, -1)) == ([], 1.0, 0)


def ahead(
    scene: EmbreeScene,
    roles: list[int],
    origin: tuple[float, float, float],
    way: tuple[float, float, float],
    max_range: float = 100.0,
) -> tuple[list[tuple[float, int, int]], float, int]:
    """Give the list that is ahead, in order, and what stops the ray."""
    crossings, takes = np.zeros(32, CROSSING), np.array(roles, np.uint8)
    block = new_ray_buffer(scene.handle, crossings)
    start, direction = np.array(origin, float), np.array(way, float)
    span = Interval(0.0, max_range, math.inf)
    count, t, part = intersect_forward(
        scene.handle, block, takes, start, direction, span
    )
    return sorted(crossings[:count].tolist()), t, part


SLAB = [(1.0, 0, 1), (2.0, 0, -1)]


def slabs() -> EmbreeScene:
    """Make three slabs from 1 to 2, 3 to 4, 5 to 6 m ahead."""
    vertices, faces = shapes.box(1, 4, 4)
    return EmbreeScene(
        [Mesh(vertices + np.array([x, 0.1, 0.2]), faces) for x in (1.5, 3.5, 5.5)]
    )


def test_what_is_listed_is_on_the_list_up_to_what_is_opaque() -> None:
    listed, t, part = ahead(slabs(), [COLLECT, OPAQUE, COLLECT], (0, 0, 0), (1, 0, 0))
    assert (t, part) == pytest.approx((3.0, 1))
    assert [(round(t, 9), *names) for t, *names in listed[:2]] == SLAB


def test_what_is_passed_by_is_not_there() -> None:
    roles = [COLLECT, IGNORE, IGNORE]
    listed, t, part = ahead(slabs(), roles, (0, 0, 0), (1, 0, 0))
    assert (t, part) == (100.0, -1)
    assert [(round(t, 9), *names) for t, *names in listed] == SLAB


@pytest.mark.parametrize(("max_range", "part"), [(3.01, 1), (2.99, -1)])
def test_beyond_its_reach_a_ray_meets_nothing(max_range: float, part: int) -> None:
    roles = [IGNORE, OPAQUE, OPAQUE]
    listed, t, stop = ahead(slabs(), roles, (0, 0, 0), (1, 0, 0), max_range)
    assert (listed, stop) == ([], part)
    assert t == pytest.approx(min(max_range, 3.0))


def test_a_list_without_room_counts_what_it_drops() -> None:
    scene, crossings = slabs(), np.zeros(2, CROSSING)
    takes = np.full(3, COLLECT, np.uint8)
    block = new_ray_buffer(scene.handle, crossings)
    way = np.array([1.0, 0, 0])
    span = Interval(0.0, 100.0, math.inf)
    count, _, _ = intersect_forward(scene.handle, block, takes, np.zeros(3), way, span)
    assert count == 6


@pytest.mark.parametrize("x", [0.5, 1.0, 1.5, 3.5, 4.0, 9.0, np.nextafter(2, 1)])
def test_no_surface_is_both_ahead_and_behind(x: float) -> None:
    scene, crossings = slabs(), np.zeros(32, CROSSING)
    takes = np.full(3, COLLECT, np.uint8)
    block = new_ray_buffer(scene.handle, crossings)
    origin, way = np.array([x, 0, 0]), np.array([1.0, 0, 0])
    count = intersect_backward(scene.handle, block, takes, origin, way)
    behind = crossings[:count].tolist()
    assert all(t <= BEHIND for t, _, _ in behind)
    listed, _, _ = ahead(scene, [COLLECT] * 3, (x, 0, 0), (1, 0, 0))
    assert len(behind) + len(listed) == 6
    assert sum(turn for _, _, turn in behind + listed) == 0


def test_the_first_hits_are_those_that_embreex_finds() -> None:
    rng = np.random.Generator(np.random.PCG64(2))
    solids = [shapes.sphere(0.7), shapes.box(1, 2, 0.5), shapes.cylinder(0.4, 2.0)] * 8
    meshes = [
        Mesh(vertices + rng.uniform(-3, 3, 3), faces) for vertices, faces in solids
    ]
    scene = EmbreeScene(meshes)
    origins = rng.uniform(-8, 8, (3000, 3))
    ways: Floats = rng.uniform(-6, 6, (3000, 3)) - origins
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    other = FirstHits(meshes, origins, ways).everything()
    roles = [OPAQUE] * len(meshes)
    found = [
        ahead(scene, roles, tuple(origin), tuple(way), 1e3)
        for origin, way in zip(origins, ways, strict=True)
    ]
    parts = np.array([part for _, _, part in found])
    assert (parts >= 0).sum() > 500
    assert parts.tolist() == other["geomID"].tolist()
    hit = parts >= 0
    distances = np.array([t for _, t, _ in found])
    np.testing.assert_allclose(distances[hit], other["tfar"][hit], atol=2e-5)
