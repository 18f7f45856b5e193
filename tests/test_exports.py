import subprocess
import sys

import pytest

import radarsim


def test_everything_that_is_promised_can_be_imported() -> None:
    for name in radarsim.__all__:
        assert getattr(radarsim, name) is not None
    assert sorted(radarsim.__all__) == dir(radarsim)


def test_nothing_else_is_there() -> None:
    with pytest.raises(AttributeError, match="no attribute 'load_maps'"):
        radarsim.load_maps  # noqa: B018 - looking is the test


@pytest.mark.parametrize("module", ["numba", "trimesh", "matplotlib", "pydantic"])
def test_asking_for_help_imports_nothing_heavy(module: str) -> None:
    code = f"import sys, radarsim.cli; sys.exit({module!r} in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
