import os
import subprocess
import sys
from pathlib import Path

import pytest

from radarsim import kernel_cache
from radarsim.errors import RadarsimError
from radarsim.kernel_cache import SUFFIX

# Fails if a kernel needs numba's formatting of text, see ``njit_cached``.
COMPILE = """
from numba.core import event
class Listener(event.Listener):
    def on_start(self, event):
        name = event.data["dispatcher"].py_func.__qualname__
        assert not name.startswith("ol_raise_with_shape"), name
    def on_end(self, event):
        pass
event.register("numba:compile", Listener())
from radarsim.cli import main
import sys
sys.argv = ["radarsim", "compile"]
main()
"""


def run(folder: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    environment = dict(os.environ) | {"NUMBA_CACHE_DIR": str(folder / "cache")}
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_tells_where_the_code_is(capfd: pytest.CaptureFixture[str]) -> None:
    from radarsim.cli.compile import compile_kernels

    compile_kernels()
    folder = kernel_cache.cache_folder()
    assert folder is not None
    count = len([*folder.rglob(f"*{SUFFIX}")])
    assert capfd.readouterr().out.startswith(f"{folder}: {count} functions, ")
    assert kernel_cache.is_complete()


def test_without_a_folder_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    from radarsim.cli import compile

    monkeypatch.setattr(compile, "cache_folder", lambda: None)
    with pytest.raises(RadarsimError, match="NUMBA_CACHE_DIR"):
        compile.compile_kernels()


def test_code_that_cannot_be_kept_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    from radarsim.cli import compile

    full = OSError(28, "No space left on device")
    monkeypatch.setattr(kernel_cache.compilation, "unsaved", full)
    with pytest.raises(RadarsimError, match="cannot be kept"):
        compile.compile_kernels()


@pytest.mark.slow
def test_afterwards_nothing_is_compiled(tmp_path: Path) -> None:
    done = run(tmp_path, "-c", COMPILE)
    assert done.returncode == 0, done.stderr
    assert "compiling the ray engine" in done.stderr
    known = {path.name for path in tmp_path.rglob(f"*{SUFFIX}")}
    assert f": {len(known)} functions, " in done.stdout
    for command in (
        "demo a.png",
        "scan foliage_room --sensor hokuyo --start RobotStart1 -o a.csv",
        "explain foliage_room --sensor radar --start RobotStart1 --beam 3",
        "check marulan_trial --plot b.png",
        "spectrum foliage_room --sensor navtech_cts350x --start RobotStart1 -o c.png",
        "navigate bug_u_trap --algorithm planned",
        "navigate bug_u_trap --algorithm bug2 --robot P3AT_Navtech",
        "map foliage_room -o map --time-limit 60",
    ):
        again = run(tmp_path, "-m", "radarsim", *command.split())
        assert "compiling" not in again.stderr, (command, again.stderr)
        assert again.returncode == 0, (command, again.stderr)
        new = {path.name for path in tmp_path.rglob(f"*{SUFFIX}")} - known
        assert not new, command
