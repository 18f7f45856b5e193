import os
import subprocess
import sys
from pathlib import Path

import pytest
from commands import run_in_process as radarsim
from matplotlib.figure import Figure
from PIL import Image


def test_demo_needs_no_options_and_says_where_its_picture_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    run = radarsim("demo")
    assert run.code == 0
    assert run.text == "radarsim_demo.png\n"
    assert run.err.count("  radarsim ") == 3  # commands to try next
    with Image.open(tmp_path / "radarsim_demo.png") as picture:
        assert picture.width > 1.5 * picture.height


def test_pictures_need_no_backend(tmp_path: Path) -> None:
    path = tmp_path / "plan.png"
    done = subprocess.run(
        [sys.executable, "-m", "radarsim", "check", "empty_room", "--plot", str(path)],
        check=False,
        env={**os.environ, "MPLBACKEND": "module://no.such_module"},
        capture_output=True,
    )
    assert (done.returncode, path.exists()) == (0, True)


def test_demo_does_not_overwrite_files_of_others(tmp_path: Path) -> None:
    path = tmp_path / "photo.png"
    path.write_bytes(b"\x89PNG, a photo")
    run = radarsim("demo", path)
    assert run.code == 2
    assert "not by radarsim" in run.err
    assert path.read_bytes() == b"\x89PNG, a photo"


def test_demo_draws_into_a_file_as_other_commands_and_may_replace_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("radarsim.plotting.scans.compare", lambda *_, **__: Figure())
    path = tmp_path / "demo.svg"
    for _ in range(2):
        run = radarsim("demo", "-o", path)
        assert (run.code, run.text) == (0, f"{path}\n")
        assert path.read_bytes().startswith(b"<?xml")
