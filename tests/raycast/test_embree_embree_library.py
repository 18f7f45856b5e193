import ctypes.util
import importlib.metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from radarsim.errors import EngineError
from radarsim.raycast.embree import expect_version, load_library, open_library


def test_the_wheel_brings_embree_4() -> None:
    assert open_library() is open_library()


@pytest.mark.parametrize("names", [[], ["libembree4.so.4", "libembree4.so.5"]])
def test_one_library_is_expected(names: list[str]) -> None:
    with pytest.raises(EngineError) as caught:
        load_library([Path("/lib", name) for name in names])
    text = f"{names!r} in embreex, expected one library of Embree 4"
    assert str(caught.value) == text


def test_without_embreex_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    def absent(name: str) -> list[Any]:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "files", absent)
    with pytest.raises(EngineError, match=r"^\[\] in embreex, expected one library"):
        open_library.__wrapped__()


def test_a_library_that_is_none_cannot_be_used(tmp_path: Path) -> None:
    path = tmp_path / "libembree4.so.4"
    path.write_text("not a library")
    with pytest.raises(EngineError) as caught:
        load_library([path])
    assert str(caught.value) == f"cannot use {path}: {path}: file too short"


def test_another_library_cannot_be_used() -> None:
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
def test_another_embree_is_refused(answers: tuple[int, int, int], text: str) -> None:
    with pytest.raises(EngineError) as caught:
        expect_version(library(*answers))
    assert str(caught.value) == text
