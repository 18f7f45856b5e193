"""Whole programs that cannot write their map, or are killed while they do."""

import os
import re
import resource
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from processes import start_radarsim

pytestmark = pytest.mark.slow

NAMES = ("map.pgm", "map.png", "map.tum", "map.yaml", "map_view.png")
HERE = ("empty_room", "--way=-7,0", "--time-limit", "1")
THERE = (*HERE, "--pose=5,1,40", "--seed", "1")
PATIENCE = 60.0  # s


@contextmanager
def mapping(folder: Path, *options: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run the program in a process of its own, which is not there afterwards."""
    with start_radarsim("map", "-o", str(folder), *options) as process:
        try:
            yield process
        finally:
            process.kill()


def contents(folder: Path) -> dict[str, bytes]:
    paths = [folder / name for name in NAMES]
    return {path.name: path.read_bytes() for path in paths}


def parts(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.suffix == ".part"]


def wait_for_parts(
    count: int, folder: Path, process: subprocess.Popen[bytes]
) -> list[Path]:
    """Wait for files that are being written; gives those that are there then."""
    until = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < until:
        if len(found := parts(folder)) >= count:
            return found
        time.sleep(0.0001)
    return []


@pytest.fixture(scope="module")
def old_map(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """Make a map that is not the one that is made in its place."""
    folder = tmp_path_factory.mktemp("old")
    with mapping(folder, *THERE) as process:
        process.communicate(timeout=PATIENCE)
    assert process.returncode == 0
    return contents(folder)


@pytest.fixture
def folder(tmp_path: Path, old_map: dict[str, bytes]) -> Path:
    for name, data in old_map.items():
        (tmp_path / name).write_bytes(data)
    return tmp_path


@pytest.mark.parametrize("room", [0, 100_000])
def test_full_disk_leaves_the_old_map_complete(
    folder: Path, old_map: dict[str, bytes], room: int
) -> None:
    assert max(map(len, old_map.values())) > room
    with mapping(folder, *HERE) as process:
        resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (room, room))
        out, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1
    assert out.startswith(
        b"time is up, exploring by way: "
    )  # what is known is told all the same
    assert b"files " not in out
    assert re.search(rb"radarsim: cannot write \S+: the file would be", errors)
    assert b"Traceback" not in errors
    assert contents(folder) == old_map
    assert len([*folder.iterdir()]) == len(NAMES)


def test_kill_before_the_last_file_leaves_the_old_map_complete(
    folder: Path, old_map: dict[str, bytes]
) -> None:
    pipe = folder / "map.png"
    pipe.unlink()
    os.mkfifo(pipe)  # whoever writes to it waits for a reader
    with mapping(folder, *HERE) as process:
        assert wait_for_parts(4, folder, process)
        time.sleep(0.1)
        process.kill()
    assert process.returncode == -9
    pipe.unlink()
    pipe.write_bytes(old_map["map.png"])
    assert contents(folder) == old_map
    assert len(parts(folder)) == 4


def test_kill_at_any_time_leaves_complete_files(
    folder: Path, old_map: dict[str, bytes]
) -> None:
    with mapping(folder, *HERE) as process:
        process.communicate(timeout=PATIENCE)
    new_map = contents(folder)
    assert all(new_map[name] != old for name, old in old_map.items())
    for delay in (0.0, 0.0004):
        for name, data in old_map.items():
            (folder / name).write_bytes(data)
        with mapping(folder, *HERE) as process:
            wait_for_parts(1, folder, process)
            time.sleep(delay)
            process.kill()
        for name, data in contents(folder).items():
            assert data in (old_map[name], new_map[name]), name
        for part in parts(folder):
            part.unlink()
