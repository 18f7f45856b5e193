"""Imports run as a user runs them."""

from collections.abc import Callable
from pathlib import Path

import pytest
from commands import Run, run_in_process

Import = Callable[..., Run]


@pytest.fixture
def import_file(tmp_path: Path) -> Import:
    """A function that imports a file, and checks that ``check`` takes the map."""

    def run(path: Path, *options: str) -> Run:
        out = tmp_path / "map.yaml"
        out.unlink(missing_ok=True)
        done = run_in_process("import", str(path), "-o", str(out), *options)
        assert out.exists() == (done.code == 0)
        if done.code == 0:
            assert run_in_process("check", str(out)).code == 0
        assert "Traceback" not in done.err
        return done

    return run
