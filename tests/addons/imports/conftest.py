"""Imports run as a user runs them."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from commands import Run, run_in_process

Import = Callable[..., Run]
WORLD = '<?xml version="1.0"?>\n<sdf version="1.9"><world name="w">{}</world></sdf>\n'


@pytest.fixture
def import_file(tmp_path: Path) -> Import:
    """A function that imports a file, and checks that ``check`` takes the map."""

    def run(path: Path, *options: str) -> Run:
        out = tmp_path / "map.yaml"
        out.unlink(missing_ok=True)
        shutil.rmtree(tmp_path / "map_meshes", ignore_errors=True)
        done = run_in_process("import", str(path), "-o", str(out), *options)
        assert out.exists() or done.code
        if out.exists():
            assert run_in_process("check", str(out)).code == 0
        else:
            assert not (tmp_path / "map_meshes").exists()
        assert "Traceback" not in done.err
        return done

    return run


@pytest.fixture
def import_world(import_file: Import, tmp_path: Path) -> Import:
    """A function that imports a world of Gazebo with such elements."""

    def run(content: str, *options: str) -> Run:
        path = tmp_path / "w.sdf"
        path.write_text(WORLD.format(content))
        return import_file(path, *options)

    return run
