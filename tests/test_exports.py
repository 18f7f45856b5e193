import subprocess
import sys

import pytest

import radarsim


def test_every_public_name_can_be_imported() -> None:
    for name in radarsim.__all__:
        assert getattr(radarsim, name) is not None
    assert sorted(radarsim.__all__) == dir(radarsim)


def test_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'load_maps'"):
        radarsim.load_maps  # noqa: B018 - the access is the test


def test_package_imports_nothing_heavy() -> None:
    heavy = {"numpy", "scipy", "shapely", "trimesh", "matplotlib", "pydantic"}
    code = f"import sys, radarsim; print(*{heavy} & set(sys.modules))"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "\n"


def test_loading_a_map_imports_no_mesh_reader_and_no_pictures() -> None:
    code = (
        "import sys, radarsim; repr(radarsim.load_map('foliage_room'));"
        "print(*{'trimesh', 'matplotlib'} & set(sys.modules))"
    )
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "\n"
