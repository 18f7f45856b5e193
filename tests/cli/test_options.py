"""Files that cannot be written are wrong options."""

import os
from pathlib import Path

import click
import pytest

from radarsim.cli.files import check_writable, write_file


def test_written_file_has_the_contents(tmp_path: Path) -> None:
    path = tmp_path / "run.csv"
    check_writable(path, "--trace")
    assert not path.exists()
    write_file(path, b"time\n", "--trace")
    check_writable(path, "--trace")
    assert path.read_bytes() == b"time\n"


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        pytest.param("no/run.csv", "no such folder", id="no folder"),
        pytest.param("folder", "a folder of that name", id="a folder in its place"),
    ],
)
def test_unwritable_file_is_refused_before_and_after(
    tmp_path: Path, name: str, reason: str
) -> None:
    (tmp_path / "folder").mkdir()
    with pytest.raises(click.BadParameter, match=f"{name}: {reason}") as caught:
        check_writable(tmp_path / name, "--trace")
    assert caught.value.param_hint == "--trace"
    with pytest.raises(click.BadParameter, match=f"cannot write .*{name}: ") as caught:
        write_file(tmp_path / name, b"", "--trace")
    assert caught.value.param_hint == "--trace"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_folder_without_write_permission_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    with pytest.raises(click.BadParameter, match="no permission"):
        check_writable(tmp_path / "run.csv", "--trace")
    tmp_path.chmod(0o700)
