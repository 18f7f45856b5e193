"""The notebook of the manual is the tutorial, and shows what its cells show now."""

import base64
import importlib
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from documents import MANUAL, ROOT
from matplotlib.colors import to_rgb
from numpy.typing import NDArray
from PIL import Image

from radarsim.plotting.palette import FAMILY_COLOURS, LASER, RADAR, Family

NOTEBOOK = MANUAL / "tutorial.ipynb"
TUTORIAL = MANUAL / "tutorial.md"
MAKE_IT_AGAIN = "run .readme/make_notebook.py, which makes the notebook again"


@pytest.fixture
def maker(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The program that makes the notebook."""
    monkeypatch.syspath_prepend(ROOT / ".readme")
    # Commands that ran in this process have set it, and the kernel would inherit it.
    monkeypatch.delenv("MPLBACKEND", raising=False)
    return importlib.import_module("make_notebook")


def stored() -> list[dict[str, Any]]:
    cells: list[dict[str, Any]] = json.loads(NOTEBOOK.read_text("utf-8"))["cells"]
    return cells


def texts(cell: Any) -> str:
    """Return what a cell prints."""
    outputs = cell.get("outputs", [])
    return "".join("".join(each.get("text", "")) for each in outputs)


def pictures(cell: Any) -> list[NDArray[np.uint8]]:
    """Return the pictures that a cell shows, (height, width, 3) each."""
    data = [each.get("data", {}) for each in cell.get("outputs", [])]
    encoded = [each["image/png"] for each in data if "image/png" in each]
    files = [io.BytesIO(base64.b64decode("".join(each))) for each in encoded]
    return [np.asarray(Image.open(file).convert("RGB")) for file in files]


def test_its_cells_are_those_of_the_tutorial(maker: Any) -> None:
    expected = maker.make_cells(TUTORIAL.read_text(encoding="utf-8"))
    cells = [(cell["cell_type"], "".join(cell["source"])) for cell in stored()]
    assert cells == expected, MAKE_IT_AGAIN


def test_it_begins_with_a_picture_in_the_colours_of_the_program() -> None:
    first, second = stored()[:2]
    assert len(first["source"]) < 12, "more than one sees before the picture"
    (picture,) = pictures(second)
    pixels = picture.reshape(-1, 3).astype(int)
    for colour in (RADAR, LASER, FAMILY_COLOURS[Family.FOLIAGE]):
        wanted = np.array(to_rgb(colour)) * 255
        near = abs(pixels - wanted).max(axis=1) < 12
        assert near.sum() > 50, (colour, MAKE_IT_AGAIN)


@pytest.mark.slow("sampled")
@pytest.mark.timeout(1200)  # a busy machine takes minutes
def test_it_runs_in_a_fresh_kernel_and_shows_what_is_stored(
    maker: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path))
    notebook = maker.make_notebook(TUTORIAL.read_text(encoding="utf-8"))
    maker.run(notebook)
    shown = 0
    for new, old in zip(notebook.cells, stored(), strict=True):
        assert texts(new) == texts(old), MAKE_IT_AGAIN
        for one, other in zip(pictures(new), pictures(old), strict=True):
            # Fonts and versions of matplotlib may differ by some pixels.
            assert abs(thumbnail(one) - thumbnail(other)).mean() < 4, MAKE_IT_AGAIN
            shown += 1
    assert shown == 7


def thumbnail(picture: NDArray[np.uint8]) -> NDArray[np.float64]:
    small = Image.fromarray(picture).resize((96, 64), Image.Resampling.BOX)
    return np.asarray(small, np.float64)
