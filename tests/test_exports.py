import importlib
import subprocess
import sys

import pytest

import radarsim
from radarsim.host import Host
from radarsim.scene.scene import Scene


def test_every_public_name_can_be_imported() -> None:
    for name in radarsim.__all__:
        assert getattr(radarsim, name) is not None
    assert sorted(radarsim.__all__) == dir(radarsim)


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'load_maps'"):
        radarsim.load_maps  # noqa: B018 - the access is the test


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("radarsim.Conditions", "radarsim.simulation.config.SimulationConfig"),
        (
            "radarsim.mapping.survey.Survey",
            "radarsim.exploration.exploration.Exploration",
        ),
        (
            "radarsim.mapping.survey.SurveyPlan",
            "radarsim.exploration.exploration.ExplorationPlan",
        ),
    ],
)
def test_old_name_works_and_warns_with_the_new_one(old: str, new: str) -> None:
    with pytest.warns(DeprecationWarning, match=new):
        found = _attribute(old)
    assert found is _attribute(new)


def test_old_keyword_of_host_works_and_warns(empty_room: Scene) -> None:
    config = radarsim.SimulationConfig(drive_unit="rev_per_s")
    with pytest.warns(DeprecationWarning, match="config"):
        host = Host(empty_room, conditions=config)
    assert host.simulation.config is config


@pytest.mark.parametrize("imported", ["radarsim", "radarsim.cli.app"])
def test_package_and_help_import_nothing_heavy(imported: str) -> None:
    heavy = {"numpy", "numba", "scipy", "shapely", "trimesh", "matplotlib", "pydantic"}
    code = f"import sys, {imported}; print(*{heavy} & set(sys.modules))"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "\n"


def _attribute(path: str) -> object:
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name)
