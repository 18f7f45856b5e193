import ctypes.util
import importlib.metadata
import math
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.first_hits import FirstHits
from radarsim.errors import EngineError
from radarsim.geometry import Floats
from radarsim.raycast import embree
from radarsim.raycast.embree import (
    EmbreeScene,
    Mesh,
    expect_version,
    load_library,
    open_library,
)
from radarsim.raycast.rays import Rays
from radarsim.raycast.tracer import Tracer
from radarsim.scene import shapes
from radarsim.scene.material import Material
from radarsim.scene.scene import Part

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
            TRIANGLE, FACE * 1.0, "faces of float64, expected integers", id="real faces"
        ),
        pytest.param(
            np.vstack([TRIANGLE, [[0, math.nan, 0]]]),
            FACE,
            "vertex 3 is [0.0, nan, 0.0], expected finite numbers",
            id="nan",
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
    ],
)
def test_invalid_meshes_are_rejected(vertices: Any, faces: Any, text: str) -> None:
    with pytest.raises(EngineError) as caught:
        EmbreeScene([Mesh(TRIANGLE, FACE), Mesh(vertices, faces)])
    assert str(caught.value) == f"{text}, in mesh 1"


def test_error_of_embree_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    class Failing:
        rtcGetDeviceError = staticmethod(lambda _device: 4)  # noqa: N815 - Embree's name

        def __getattr__(self, name: str) -> Any:
            return getattr(open_library(), name)

    monkeypatch.setattr(embree, "open_library", Failing)
    with pytest.raises(EngineError) as caught:
        EmbreeScene([Mesh(TRIANGLE, FACE)])
    assert str(caught.value) == "Embree error 4 over 1 triangles"


def test_meshes_are_copied() -> None:
    vertices = TRIANGLE.copy()
    scene = EmbreeScene([Mesh(vertices, FACE)])
    vertices += 50
    assert scene.triangles.tolist() == [TRIANGLE.ravel().tolist()]


def test_first_hits_match_those_of_embreex() -> None:
    rng = np.random.Generator(np.random.PCG64(2))
    solids = [shapes.sphere(0.7), shapes.box(1, 2, 0.5), shapes.cylinder(0.4, 2.0)] * 8
    solids = [(vertices + rng.uniform(-3, 3, 3), faces) for vertices, faces in solids]
    meshes, wall = [Mesh(*each) for each in solids], Material("wall")
    parts = [Part(str(i), wall, *each) for i, each in enumerate(solids)]
    origins = rng.uniform(-8, 8, (3000, 3))
    ray_directions: Floats = rng.uniform(-6, 6, (3000, 3)) - origins
    ray_directions /= np.linalg.norm(ray_directions, axis=1, keepdims=True)
    other = FirstHits(meshes, (origins, ray_directions)).everything()
    found = Tracer(parts).trace(Rays.uniform(origins, ray_directions, max_range=1e3))
    hit = found.parts >= 0
    assert hit.sum() > 500
    assert found.parts.tolist() == other["geomID"].tolist()
    np.testing.assert_allclose(found.ranges[hit], other["tfar"][hit], atol=2e-5)


@pytest.mark.parametrize("names", [[], ["libembree4.so.4", "libembree4.so.5"]])
def test_exactly_one_library_is_expected(names: list[str]) -> None:
    with pytest.raises(EngineError) as caught:
        load_library([Path("/lib", name) for name in names])
    text = f"{names!r} in embreex, expected one library of Embree 4"
    assert str(caught.value) == text


def test_missing_embreex_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> list[Any]:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "files", absent)
    with pytest.raises(EngineError, match=r"^\[\] in embreex, expected one library"):
        open_library.__wrapped__()


def test_file_that_is_no_library_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "libembree4.so.4"
    path.write_text("not a library")
    with pytest.raises(EngineError) as caught:
        load_library([path])
    assert str(caught.value) == f"cannot use {path}: {path}: file too short"


def test_library_without_embrees_functions_is_rejected() -> None:
    name = ctypes.util.find_library("m")
    assert name is not None
    with pytest.raises(EngineError) as caught:
        load_library([Path(name)])
    assert str(caught.value).startswith(f"cannot use {name}: ")
    assert str(caught.value).endswith("undefined symbol: rtcNewDevice")


def library(device: int, version: int, boxes: int) -> Any:
    """Answer as an Embree of this version would."""
    answers = {0: version, 100: boxes}
    return SimpleNamespace(
        rtcNewDevice=lambda _: device,
        rtcGetDeviceProperty=lambda _, name: answers[name],
        rtcReleaseDevice=lambda _: None,
    )


@pytest.mark.parametrize(
    ("answers", "text"),
    [
        pytest.param(
            (0, 40400, 1),
            "Embree made no device, expected one with its defaults",
            id="none",
        ),
        pytest.param(
            (1, 30904, 1),
            "Embree 30904, user geometries True, expected 4xxxx and True",
            id="version 3",
        ),
        pytest.param(
            (1, 40400, 0),
            "Embree 40400, user geometries False, expected 4xxxx and True",
            id="no user geometries",
        ),
    ],
)
def test_unusable_builds_of_embree_are_rejected(
    answers: tuple[int, int, int], text: str
) -> None:
    with pytest.raises(EngineError) as caught:
        expect_version(library(*answers))
    assert str(caught.value) == text


SCAN_WHILE_PYTHON_ENDS = """
import threading, time
import radarsim

scene = radarsim.load_map("foliage_room")
radar = radarsim.load_sensor("radar", return_mode="all")
scanned = threading.Event()

def scan_forever():
    rng = radarsim.generator_for(0, "test")
    while True:
        radar.scan(scene, (-8, 0, 0), rng)
        scanned.set()

for _ in range(4):
    threading.Thread(target=scan_forever, daemon=True).start()
scanned.wait(60)
"""


def test_python_can_end_while_threads_trace_rays() -> None:
    for _ in range(2):  # some runs ended well by chance
        subprocess.run([sys.executable, "-c", SCAN_WHILE_PYTHON_ENDS], check=True)
