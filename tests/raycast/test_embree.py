import ctypes.util
import importlib.metadata
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from radarsim.errors import EngineError
from radarsim.raycast import embree
from radarsim.raycast.embree import EmbreeScene

TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
FACE = np.array([[0, 1, 2]])


def test_error_of_embree_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    library = embree.open_library()

    class Failing:
        rtcGetDeviceError = staticmethod(lambda _device: 4)  # noqa: N815 - Embree's name

        def __getattr__(self, name: str) -> Any:
            return getattr(library, name)

    monkeypatch.setattr(embree, "open_library", Failing)
    with pytest.raises(EngineError) as caught:
        EmbreeScene([(TRIANGLE, FACE)])
    assert str(caught.value) == "Embree error 4 building 1 triangles"


def test_meshes_are_copied() -> None:
    vertices = TRIANGLE.copy()
    scene = EmbreeScene([(vertices, FACE)])
    vertices += 50
    assert scene.triangles.tolist() == [TRIANGLE.ravel().tolist()]


@pytest.mark.parametrize("use", ["file too short", "undefined symbol: rtcNewDevice"])
def test_file_that_is_no_library_of_embree_is_rejected(
    use: str, tmp_path: Path
) -> None:
    path = tmp_path / "libembree4.so.4"
    path.write_text("not a library")
    if "symbol" in use:
        path = Path(ctypes.util.find_library("m") or "")
    with pytest.raises(EngineError) as caught:
        embree.load_library([path])
    assert str(caught.value).startswith(f"cannot use {path}: ")
    assert str(caught.value).endswith(use)


@pytest.mark.parametrize("names", [[], ["libembree4.so.4", "libembree4.so.5"]])
def test_exactly_one_library_is_expected(names: list[str]) -> None:
    with pytest.raises(EngineError) as caught:
        embree.load_library([Path("/lib", name) for name in names])
    text = f"embreex has {names!r}, expected one file of Embree 4"
    assert str(caught.value) == text


def test_missing_embreex_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> list[Any]:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "files", absent)
    with pytest.raises(EngineError, match=r"^embreex has \[\], expected one file"):
        embree.open_library.__wrapped__()


NEEDED = ", expected 4xxxx and True"


@pytest.mark.parametrize(
    ("answers", "text"),
    [
        ((0, 40400, 1), "Embree could not create a device"),
        ((1, 30904, 1), f"Embree 30904, user geometries True{NEEDED}"),
        ((1, 40400, 0), f"Embree 40400, user geometries False{NEEDED}"),
    ],
    ids=["none", "version 3", "no user geometries"],
)
def test_unusable_builds_of_embree_are_rejected(
    answers: tuple[int, int, int], text: str
) -> None:
    device, version, boxes = answers
    build: Any = SimpleNamespace(
        rtcNewDevice=lambda _: device,
        rtcGetDeviceProperty=lambda _, name: {0: version, 100: boxes}[name],
        rtcReleaseDevice=lambda _: None,
    )
    with pytest.raises(EngineError) as caught:
        embree.expect_version(build)
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
