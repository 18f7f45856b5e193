from pathlib import Path

import pytest

from radarsim.jit import KernelCache

KEYS = [(("float64",), "x86", 1), (("int64",), "x86", 1), (("int64",), "arm", 1)]


@pytest.fixture
def files(tmp_path: Path) -> KernelCache:
    return KernelCache(tmp_path, "kernel")


def test_what_was_saved_under_a_key_is_loaded(files: KernelCache) -> None:
    for key in KEYS:
        files.save(key, ("code for", key))
    assert [files.load(key) for key in KEYS] == [("code for", key) for key in KEYS]


def test_nothing_is_loaded_for_another_key(files: KernelCache) -> None:
    files.save(KEYS[0], ("code",))
    assert files.load(KEYS[1]) is None


def test_code_for_types_of_the_same_name_is_not_taken_for_each_other(
    files: KernelCache,
) -> None:
    class Unequal:
        def __repr__(self) -> str:
            return "key"

    files.save("key", ("code",))
    files.save(Unequal(), ("code",))
    assert files.load(Unequal()) is None


def test_two_processes_that_save_other_types_at_once_lose_nothing(
    files: KernelCache, tmp_path: Path
) -> None:
    other = KernelCache(tmp_path, "kernel")
    assert (files.load(KEYS[0]), other.load(KEYS[1])) == (None, None)
    files.save(KEYS[0], ("code",))
    other.save(KEYS[1], ("other code",))
    for each in (files, other):
        assert [each.load(key) for key in KEYS] == [("code",), ("other code",), None]


def test_unfinished_file_is_not_loaded(files: KernelCache, tmp_path: Path) -> None:
    files.save(KEYS[0], ("code",) * 100)
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    for size in range(0, len(whole), 7):
        path.write_bytes(whole[:size])
        assert files.load(KEYS[0]) is None


def test_flushed_function_has_no_files(files: KernelCache, tmp_path: Path) -> None:
    KernelCache(tmp_path, "other").save(KEYS[0], ("code",))
    for key in KEYS:
        files.save(key, ("code",))
    files.flush()
    assert len([*tmp_path.iterdir()]) == 1
