"""The doors of the core: entries of its own, of other packages, and missing ones."""

import os
import shutil
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
WITHOUT_ADDONS = """
import radarsim
from radarsim import plugins
from radarsim.presets.robots import load_robot
from radarsim.simulation.config import SimulationConfig

print(plugins.names("radarsim.items"), radarsim.load_sensor("radar").name)
for wanted in (
    lambda: radarsim.load_sensor("navtech_cts350x", detector="ca"),
    lambda: SimulationConfig().check_scanners(load_robot("P3AT_Navtech")),
    lambda: radarsim.load_sensor("navtech_cts350x").fmcw,
):
    try:
        wanted()
    except radarsim.RadarsimError as error:
        print(error)
"""


@pytest.mark.parametrize(
    ("group", "name"),
    [(group, name) for group, own in plugins.OWN.items() for name in own],
)
def test_every_own_entry_can_be_loaded(group: str, name: str) -> None:
    assert name in plugins.names(group)
    assert plugins.load(group, name)


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


def test_core_without_addons_says_which_one_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = Path(radarsim.__file__).parent
    left_out = shutil.ignore_patterns("addons", "autonomy", "lab", "__pycache__")
    shutil.copytree(package, tmp_path / "radarsim", ignore=left_out)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    printed = subprocess.check_output(
        [sys.executable, "-c", WITHOUT_ADDONS], text=True, cwd=tmp_path
    )
    needs = "sensor navtech_cts350x: detector 'ca' needs radarsim.addons.fmcw, which is"
    assert printed.splitlines() == [
        "[] radar",
        f"{needs} not installed",
        f"{needs} not installed",
        "radarsim.addons.fmcw is not installed",
    ]
