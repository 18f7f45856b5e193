"""The process that compiles, as the server sees it; nothing is compiled to the end."""

import threading
from pathlib import Path

import pytest

from radarsim.errors import ServerError
from radarsim.kernel_cache import cache_folder, compilation
from radarsim.server import engine_loader as compiler_process
from radarsim.server.engine_loader import CompilerProcess


@pytest.fixture
def cold(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache, but for this process."""
    cache_folder()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    return tmp_path


@pytest.mark.usefixtures("cold")
def test_process_can_be_stopped_while_it_compiles() -> None:
    compiler, begun, seen = CompilerProcess(), threading.Event(), []

    def observe(subject: str | None) -> None:
        seen.append(subject)
        begun.set()

    errors = []

    def run() -> None:
        try:
            compiler.run()
        except ServerError as error:
            errors.append(str(error))

    thread = threading.Thread(target=run)
    compilation.observers.append(observe)
    try:
        thread.start()
        assert begun.wait(240)
        compiler.stop()
        thread.join(60)
    finally:
        compilation.observers.remove(observe)
    assert not thread.is_alive()
    assert seen[0] == "the ray engine"
    assert seen[-1] is None
    assert len(errors) == 1


def test_process_that_is_stopped_before_its_start_is_not_started() -> None:
    compiler = CompilerProcess()
    compiler.stop()
    with pytest.raises(ServerError, match="stopped"):
        compiler.run()


def test_process_that_cannot_be_started_is_an_error(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("sys.executable", str(tmp_path / "python"))
    with pytest.raises(ServerError, match="cannot start"):
        CompilerProcess().run()


@pytest.mark.slow
def test_process_ends_with_a_reason_if_nothing_can_be_kept(cold: Path) -> None:
    folder = cache_folder()
    assert folder is not None
    other = cold / "radarsim" / folder.name
    other.mkdir(parents=True)
    (other / "raycast").write_text("")  # where a folder should be
    with pytest.raises(ServerError, match="a file of that name"):
        CompilerProcess().run()


@pytest.mark.parametrize(
    ("program", "reason"),
    [
        ("raise SystemExit(3)", "exit code 3"),
        ("import os; os.kill(os.getpid(), 9)", "ended by SIGKILL"),
        ("import os; os.kill(os.getpid(), 35)", "ended by signal 35"),
        ("print('failed no memory', flush=True); raise SystemExit(1)", "no memory"),
    ],
)
def test_reason_of_the_end_is_told(
    monkeypatch: pytest.MonkeyPatch, program: str, reason: str
) -> None:
    monkeypatch.setattr(compiler_process, "PROGRAM", program)
    with pytest.raises(ServerError, match=f"^{reason}$"):
        CompilerProcess().run()
