"""The doors of the core: entries of its own, of other packages, and missing ones."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import radarsim
from radarsim import plugins
from radarsim.errors import MissingPackage

ADDON = """[radarsim.sensors]
sonar = colorsys:rgb_to_hls
"""


@pytest.mark.parametrize(
    ("group", "name"),
    [(group, name) for group, own in plugins.OWN.items() for name in own],
)
def test_every_own_entry_can_be_loaded(group: str, name: str) -> None:
    assert name in plugins.names(group)
    loaded = plugins.load(group, name)
    assert callable(loaded) or all(each.load() for each in loaded)


def test_other_packages_can_add_entries(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "others-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Name: others\nVersion: 1.0\n")
    (folder / "entry_points.txt").write_text(ADDON)
    script = "from radarsim import plugins; print(plugins.names('radarsim.sensors'),"
    script += " plugins.load('radarsim.sensors', 'sonar').__name__)"
    path = os.pathsep.join([str(tmp_path), str(Path(radarsim.__file__).parents[1])])
    monkeypatch.setenv("PYTHONPATH", path)
    printed = subprocess.check_output([sys.executable, "-c", script], text=True)
    assert printed == "['fmcw', 'sonar'] rgb_to_hls\n"


def test_unknown_entry_is_named() -> None:
    with pytest.raises(MissingPackage, match=r"'lidar' of 'radarsim\.sensors'"):
        plugins.load("radarsim.sensors", "lidar")
