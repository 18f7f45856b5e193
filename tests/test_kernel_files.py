"""The files of compiled code: what was written is read, and nothing else is run."""

import os
import pickle
from pathlib import Path

import pytest

from radarsim import kernel_cache
from radarsim.jit import KernelCache

KEYS = [(("float64",), "x86", 1), (("int64",), "x86", 1), (("int64",), "arm", 1)]
OTHER_USER = 4321
as_root = pytest.mark.skipif(
    os.geteuid() != 0 and os.environ.get("CI") != "true",
    reason="only root can give files to others",
)


@pytest.fixture
def files(tmp_path: Path) -> KernelCache:
    return KernelCache(tmp_path, "kernel")


@pytest.fixture
def file(files: KernelCache) -> Path:
    """The file of the first key."""
    files.save(KEYS[0], ("code",))
    (path,) = Path(files.cache_path).iterdir()
    return path


def test_what_was_saved_under_a_key_is_loaded(files: KernelCache) -> None:
    for key in KEYS:
        files.save(key, ("code for", key))
    assert [files.load(key) for key in KEYS] == [("code for", key) for key in KEYS]


def test_nothing_is_loaded_for_another_key(files: KernelCache) -> None:
    files.save(KEYS[0], ("code",))
    assert files.load(KEYS[1]) is None


def test_code_of_another_function_is_not_loaded(files: KernelCache, file: Path) -> None:
    other = KernelCache(Path(files.cache_path), "other")
    file.rename(file.with_name(file.name.replace("kernel", "other")))
    assert other.load(KEYS[0]) is None


def test_planted_pickle_is_not_read(files: KernelCache, file: Path) -> None:
    file.write_bytes(b"I1\n.")
    assert files.load(KEYS[0]) is None
    file.write_bytes(pickle.dumps((KEYS[0], ("code",))))
    assert files.load(KEYS[0]) is None


def test_each_flipped_bit_is_noticed(files: KernelCache, file: Path) -> None:
    data = file.read_bytes()
    for bit in range(8 * len(data)):
        damaged = bytearray(data)
        damaged[bit // 8] ^= 1 << bit % 8
        file.write_bytes(damaged)
        assert files.load(KEYS[0]) is None
    file.write_bytes(data)
    assert files.load(KEYS[0]) == ("code",)


@pytest.mark.parametrize("mode", [0o664, 0o646, 0o666])
def test_file_that_others_can_write_is_not_read(
    files: KernelCache, file: Path, mode: int
) -> None:
    file.chmod(mode)
    assert files.load(KEYS[0]) is None


def test_files_are_private_whatever_the_umask(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        files = KernelCache(tmp_path / "a" / "b", "kernel")
        files.save(KEYS[0], ("code",))
    finally:
        os.umask(before)
    assert files.load(KEYS[0]) == ("code",)


def test_symbolic_link_is_not_followed(files: KernelCache, file: Path) -> None:
    elsewhere = file.rename(file.with_name("elsewhere"))
    file.symlink_to(elsewhere)
    assert files.load(KEYS[0]) is None


@as_root
def test_file_of_another_user_is_not_read(files: KernelCache, file: Path) -> None:
    os.chown(file, OTHER_USER, -1)
    assert files.load(KEYS[0]) is None


@pytest.mark.parametrize("mode", [0o775, 0o757, 0o1777])
def test_folder_that_others_can_write_is_not_read(tmp_path: Path, mode: int) -> None:
    files = KernelCache(tmp_path / "cache", "kernel")
    files.save(KEYS[0], ("code",))
    (tmp_path / "cache").chmod(mode)
    assert files.load(KEYS[0]) is None


@pytest.mark.parametrize("mode", [0o775, 0o757, 0o777])
def test_folder_below_one_that_others_can_write_is_not_used(
    tmp_path: Path,
    mode: int,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(mode)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "open/cache"))
    assert fresh_cache_folder() is None
    assert (
        f"{tmp_path / 'open'} can be written by others (mode {mode:o})" in caplog.text
    )
    # In a sticky folder nobody can rename what belongs to others.
    (tmp_path / "open").chmod(mode | 0o1000)
    assert fresh_cache_folder() is not None


@as_root
def test_folder_of_another_user_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    os.chown(tmp_path, OTHER_USER, -1)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    assert fresh_cache_folder() is None
    assert f"{tmp_path} belongs to another user ({OTHER_USER})" in caplog.text


@as_root
def test_folder_of_root_is_read_by_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for each in (tmp_path, *tmp_path.parents[:-2]):
        each.chmod(0o755)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    folder = fresh_cache_folder()
    assert folder is not None
    files = KernelCache(folder, "kernel")
    files.save(KEYS[0], ("code",))
    os.seteuid(OTHER_USER)
    try:
        assert fresh_cache_folder() == folder
        assert files.load(KEYS[0]) == ("code",)
        with pytest.raises(PermissionError):
            files.save(KEYS[1], ("code",))
    finally:
        os.seteuid(0)


def fresh_cache_folder() -> Path | None:
    kernel_cache.cache_folder.cache_clear()
    try:
        return kernel_cache.cache_folder()
    finally:
        kernel_cache.cache_folder.cache_clear()
