"""Files are written completely or not at all."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from processes import largest_file

from radarsim.files import write_atomically, written_atomically


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_written_files_are_the_only_ones(tmp_path: Path) -> None:
    files = {tmp_path / "yard.pgm": b"P5", tmp_path / "yard.yaml": b"image: yard.pgm"}
    write_atomically(files)
    assert {path: path.read_bytes() for path in files} == files
    assert names(tmp_path) == ["yard.pgm", "yard.yaml"]


def test_files_have_default_permissions(tmp_path: Path) -> None:
    plain, atomic = tmp_path / "plain", tmp_path / "atomic"
    plain.write_bytes(b"")
    write_atomically({atomic: b""})
    assert atomic.stat().st_mode == plain.stat().st_mode


@pytest.mark.parametrize("bad", ["no/such/folder", "folder", "n" * 300])
@pytest.mark.parametrize("last", [True, False])
def test_failure_to_write_one_file_leaves_all_unchanged(
    tmp_path: Path, bad: str, *, last: bool
) -> None:
    (tmp_path / "folder").mkdir()
    old = tmp_path / "yard.pgm"
    old.write_bytes(b"old")
    paths = [old, tmp_path / bad] if last else [tmp_path / bad, old]
    with pytest.raises(OSError, match=r".+"):
        write_atomically(dict.fromkeys(paths, b"new"))
    assert old.read_bytes() == b"old"
    assert names(tmp_path) == ["folder", "yard.pgm"]


def test_link_stays_and_its_target_is_replaced(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    link, file = tmp_path / "link", folder / "file"
    link.symlink_to(file)
    for data in (b"new", b"newer"):
        write_atomically({link: data})
        assert link.is_symlink()
        assert file.read_bytes() == data
        assert list(folder.iterdir()) == [file]


def test_device_is_written_to_and_stays(tmp_path: Path) -> None:
    ours, terminal = os.openpty()  # no file can replace this device
    device = Path(os.ttyname(terminal))
    link, file = tmp_path / "terminal", tmp_path / "file"
    link.symlink_to(device)
    write_atomically({link: b"text", file: b"kept"})
    assert os.read(ours, 4) == b"text"
    assert link.is_symlink()
    assert device.is_char_device()
    assert file.read_bytes() == b"kept"
    os.close(terminal)
    os.close(ours)


def test_pipe_is_written_to_and_stays(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=write_atomically, args=({pipe: b"through"},))
    writer.start()
    assert pipe.read_bytes() == b"through"
    writer.join()
    assert pipe.is_fifo()


def test_full_disk_leaves_the_old_files(tmp_path: Path) -> None:
    old = tmp_path / "yard.pgm"
    old.write_bytes(b"old")
    with largest_file(100_000), pytest.raises(OSError, match="too large"):
        write_atomically({tmp_path / "small": b"new", old: bytes(1_000_000)})
    assert old.read_bytes() == b"old"
    assert names(tmp_path) == ["yard.pgm"]


WRITER = """
import sys
from pathlib import Path
from radarsim.files import write_atomically
path, number = Path(sys.argv[1]), 0
while True:
    number += 1
    write_atomically({path: bytes([number % 251]) * 3_000_000})
    print(number, flush=True)
"""


def test_killed_process_leaves_no_partial_file(tmp_path: Path) -> None:
    path = tmp_path / "yard.pgm"
    for delay in (0.0, 0.003, 0.011):
        command = [sys.executable, "-c", WRITER, str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as writer:
            assert writer.stdout is not None
            writer.stdout.readline()
            time.sleep(delay)
            writer.kill()
        data = path.read_bytes()
        assert len(data) == 3_000_000
        assert len(set(data)) == 1


INTERRUPTED = """
import os, sys
from pathlib import Path
from radarsim import files
from radarsim.processes import exit_immediately_on_signals
path, number = Path(sys.argv[1]), int(sys.argv[2])
path.write_bytes(b"old")
def end(*_):
    os.kill(os.getpid(), number)
Path.replace = end  # when the new files are complete
with exit_immediately_on_signals():
    {}
"""


@pytest.mark.parametrize(
    "write",
    [
        "files.write_atomically({path: b'new', path.with_suffix('.b'): b'new'})",
        "with files.written_atomically(path) as part: part.write_bytes(b'half'), end()",
    ],
)
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_process_that_is_asked_to_end_leaves_no_temporary_file(
    tmp_path: Path, write: str, number: int
) -> None:
    path = tmp_path / "yard.pgm"
    script = INTERRUPTED.format(write)
    command = (sys.executable, "-c", script, str(path), str(int(number)))
    assert subprocess.run(command, check=False).returncode == 128 + number
    assert names(tmp_path) == ["yard.pgm"]
    assert path.read_bytes() == b"old"


def test_file_written_bit_by_bit_appears_when_it_is_complete(tmp_path: Path) -> None:
    path = tmp_path / "film.gif"
    path.write_bytes(b"old")
    with written_atomically(path) as part:
        part.write_bytes(b"new")
        assert path.read_bytes() == b"old"
    assert path.read_bytes() == b"new"
    with contextlib.suppress(KeyboardInterrupt), written_atomically(path) as part:
        part.write_bytes(b"half")
        raise KeyboardInterrupt
    assert path.read_bytes() == b"new"
    assert names(tmp_path) == ["film.gif"]
    with (
        pytest.raises(OSError, match="not a regular file"),
        written_atomically(Path("/dev/null")),
    ):
        pass
