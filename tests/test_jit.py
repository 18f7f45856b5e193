import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from numba.core import event

from radarsim import jit, kernel_cache
from radarsim.jit import cache_of, njit_cached, njit_inline

PACKAGE = Path(jit.__file__).parent
DEPTH = len(PACKAGE.parents)
DECORATORS = {"njit_cached", "njit_inline", "c_callback", "c_predicate"}

KERNEL = """
from radarsim.jit import njit_cached
from radarsim.kernels.deep.inner import step

@njit_cached
def run(x):
    return step(x)
"""
INNER = """
from radarsim.jit import njit_inline

@njit_inline
def step(x):
    return x + {number}
"""


CALLBACK = """
from radarsim.jit import c_callback

@c_callback
def call(pointer):
    pass
"""

MODULES = ("jit", "kernel_cache", "files", "processes", "errors")


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A package of one kernel that inlines a function two folders deep."""
    package = tmp_path / "radarsim"
    deep = package / "kernels/deep"
    deep.mkdir(parents=True)
    for folder in (package, package / "kernels", deep):
        (folder / "__init__.py").write_text("")
    for name in MODULES:
        shutil.copy(PACKAGE / f"{name}.py", package)
    (package / "kernels/outer.py").write_text(KERNEL)
    (deep / "inner.py").write_text(INNER.format(number=1))
    return package


PROGRAM = (
    "from radarsim.kernels.outer import run\n"
    "print(run(1), sum(run.stats.cache_hits.values()))\n"
    "from radarsim import kernel_cache; print(kernel_cache.cache_folder())"
)


def start(
    package: Path, *programs: str, **changes: str | None
) -> "subprocess.Popen[str]":
    environment = {
        "NUMBA_CACHE_DIR": None,
        "PYTHONPATH": str(package.parent),
        "XDG_CACHE_HOME": str(package.parent / "cache"),
    } | changes
    return subprocess.Popen(
        [sys.executable, "-B", "-c", "\n".join([PROGRAM, *programs])],
        env={
            name: value
            for name, value in (dict(os.environ) | environment).items()
            if value is not None and not name.startswith("COVERAGE")
        },
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=package.parent,
    )


def finish(process: "subprocess.Popen[str]") -> tuple[int, bool, str]:
    """Wait; return the kernel's result, whether it was cached, and the folder."""
    output, _ = process.communicate()
    return results(output)


def results(output: str) -> tuple[int, bool, str]:
    numbers, folder = output.splitlines()
    result, hits = numbers.split()
    return int(result), hits == "1", folder


def run(package: Path, **changes: str | None) -> tuple[int, bool, str]:
    return finish(start(package, **changes))


@pytest.mark.parametrize("decorate", [njit_cached, njit_inline])
def test_function_without_a_file_is_compiled_without_a_cache(
    decorate: Callable[[Any], Any],
) -> None:
    namespace: dict[str, Any] = {}
    exec("def half(x):\n    return x / 2", namespace)
    assert decorate(namespace["half"])(3.0) == 1.5


def test_damage_and_edits_of_inlined_functions_are_noticed(package: Path) -> None:
    result, cached, folder = run(package)
    assert (result, cached) == (2, False)
    (path,) = Path(folder).rglob(f"*{kernel_cache.SUFFIX}")  # an inlined one has none
    path.write_bytes(path.read_bytes()[:100])
    assert run(package)[:2] == (2, False)
    assert run(package)[:2] == (2, True)
    (package / "kernels/deep/inner.py").write_text(INNER.format(number=5))
    result, cached, other = run(package)
    assert (result, cached) == (6, False)
    assert other != folder
    (package / "kernels/deep/inner.py").write_text(INNER.format(number=1))
    assert run(package)[:2] == (2, True)  # the folder of that code is still there


def test_kernels_of_one_name_in_different_folders_have_different_files(
    package: Path,
) -> None:
    """Kernels are cached under their whole relative path, at any depth."""
    for folder in ("kernels/deep", "kernels/deep/down"):
        (package / folder).mkdir(exist_ok=True)
        (package / folder / "__init__.py").write_text("")
        (package / folder / "outer.py").write_text(KERNEL)
    others = [
        f"from radarsim.kernels.{name}.outer import run; run(1)"
        for name in ("deep", "deep.down")
    ]
    cache = Path(finish(start(package, *others))[2])
    files = cache.rglob(f"outer.run*{kernel_cache.SUFFIX}")
    places = sorted(path.parent.relative_to(cache).as_posix() for path in files)
    assert places == ["kernels", "kernels/deep", "kernels/deep/down"]


def test_edit_of_a_kernel_two_folders_deep_leads_to_another_folder(
    tmp_path: Path,
) -> None:
    """The hash covers the kernels of the package itself at all depths."""
    copy = shutil.copytree(PACKAGE, tmp_path / "radarsim")
    before = kernel_cache.kernel_hash(copy)
    assert before == kernel_cache.kernel_hash(PACKAGE)
    deep = [path for path in kernel_modules() if len(path.parents) > DEPTH + 2]
    assert deep
    for path in deep:
        edited = copy / path.relative_to(PACKAGE)
        text = edited.read_text()
        edited.write_text(text + "\n")
        assert kernel_cache.kernel_hash(copy) != before
        edited.write_text(text)


@pytest.mark.slow
def test_edit_of_a_module_without_kernels_keeps_the_cache(package: Path) -> None:
    run(package)
    (package / "kernels/other.py").write_text("NUMBER = 1\n")
    assert run(package)[:2] == (2, True)


@pytest.mark.slow
def test_cache_is_in_the_folder_that_numba_is_told_to_use(
    package: Path, tmp_path: Path
) -> None:
    parent = tmp_path / "elsewhere"
    assert run(package, NUMBA_CACHE_DIR=str(parent))[1] is False
    result, cached, folder = run(package, NUMBA_CACHE_DIR=str(parent))
    assert (result, cached, Path(folder).parent) == (2, True, parent / "radarsim")
    assert not (package / "__pycache__").exists()


@pytest.mark.slow
def test_without_home_or_a_writable_folder_kernels_are_compiled_each_time(
    package: Path, tmp_path: Path
) -> None:
    # A file where a folder should be: root may write into any folder.
    (tmp_path / "file").write_text("")
    (package / "__pycache__").write_text("")
    changes = {"HOME": None, "XDG_CACHE_HOME": str(tmp_path / "file")}
    for _ in range(2):
        assert run(package, **changes) == (2, False, "None")


def test_user_without_a_home_folder_has_the_cache_in_the_package(
    package: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("HOME", "USERPROFILE", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    # As for a user of a container who is in no list of users.
    monkeypatch.setattr("os.path.expanduser", lambda path: path)
    monkeypatch.setattr(kernel_cache, "PACKAGE", package)
    kernel_cache.cache_folder.cache_clear()
    try:
        folder = kernel_cache.cache_folder()
    finally:
        kernel_cache.cache_folder.cache_clear()
    assert folder is not None
    assert folder.parent == package / "__pycache__/radarsim"


@pytest.mark.slow
def test_copies_in_different_places_share_the_cache(
    package: Path, tmp_path: Path
) -> None:
    cache = str(tmp_path / "cache")
    assert run(package, XDG_CACHE_HOME=cache)[:2] == (2, False)
    copy = shutil.copytree(package, tmp_path / "other environment" / package.name)
    for path in copy.rglob("*.py"):
        os.utime(path, (1e9, 1e9))
    assert run(copy, XDG_CACHE_HOME=cache)[:2] == (2, True)


COMPILED = (
    "from radarsim.kernel_cache import compilation\n"
    "seen = []; compilation.observers.append(seen.append)\n"
    "import logging; logging.basicConfig(level='INFO', format='%(name)s')\n"
    "import numba; own = numba.njit(lambda x: x); own(1); print(seen)\n"
    "import radarsim.kernels.callback; print(seen)\n"
    "from radarsim.kernels.outer import run; run(1); print(seen)\n"
)


@pytest.mark.slow
def test_compiling_is_told_to_observers_and_to_the_log(package: Path) -> None:
    (package / "kernels/callback.py").write_text(CALLBACK)
    began_and_ended = ["the ray engine", None]
    assert observed(package) == (
        [[], began_and_ended, [*began_and_ended, *began_and_ended]],
        ["radarsim.kernel_cache"],
    )
    assert observed(package) == ([[], [], []], [])  # all is read from the cache


def observed(package: Path) -> tuple[list[list[str | None]], list[str]]:
    """Return what observers were told after each step, and the lines of the log."""
    run = subprocess.run(
        (sys.executable, "-B", "-c", COMPILED),
        env={
            **{k: v for k, v in os.environ.items() if not k.startswith("COVERAGE")},
            "NUMBA_CACHE_DIR": str(package.parent / "cache"),
            "PYTHONPATH": str(package.parent),
        },
        capture_output=True,
        check=True,
        text=True,
        cwd=package.parent,
    )
    told = [ast.literal_eval(line) for line in run.stdout.splitlines()]
    return told, run.stderr.splitlines()


def test_only_functions_of_the_package_use_its_cache() -> None:
    assert cache_of(kernel_modules) is None
    assert cache_of(cache_of) is not None


def test_inlined_function_is_compiled_once_for_all_constants() -> None:
    compiled: list[str] = []

    class Listener(event.Listener):  # type: ignore[misc] # numba has no types
        def on_start(self, event: event.Event) -> None:
            compiled.append(event.data["dispatcher"].py_func.__name__)

        def on_end(self, event: event.Event) -> None:
            pass

    @njit_inline
    def scale(x: float, factor: int) -> float:
        return x * factor

    @njit_cached
    def add_up(x: float) -> float:
        return scale(x, 2) + scale(x, factor=3) + scale(x, 5)

    with event.install_listener("numba:compile", Listener()):
        assert add_up(1.5) == 15.0
    assert compiled == ["add_up", "scale"]
    assert scale(1.5, 4) == 6.0  # from Python as well


def test_code_that_cannot_be_kept_is_used_and_reported_once(package: Path) -> None:
    cache = package.parent / "cache"
    name = kernel_cache.PREFIX + kernel_cache.kernel_hash(package)
    folder = cache / "radarsim" / name
    folder.mkdir(parents=True)
    (folder / "kernels").write_text("")  # where a folder should be
    process = start(package, NUMBA_CACHE_DIR=str(cache))
    output, errors = process.communicate()
    assert results(output)[:2] == (2, False)
    (line,) = errors.splitlines()
    assert str(folder) in line


def test_damaged_files_are_compiled_again(package: Path) -> None:
    files = [*Path(run(package)[2]).rglob(f"*{kernel_cache.SUFFIX}")]
    assert len(files) == 1  # an inlined function has no code of its own
    for path in files:
        path.write_bytes(path.read_bytes()[:100])
    assert run(package)[:2] == (2, False)
    assert run(package)[:2] == (2, True)


@pytest.mark.slow
def test_two_processes_can_fill_the_cache_at_once(package: Path) -> None:
    both = [start(package) for _ in range(2)]
    assert [finish(process)[0] for process in both] == [2, 2]
    assert run(package)[:2] == (2, True)


def test_old_cache_folders_are_removed_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    parent = tmp_path / "radarsim"
    ours = [parent / f"radarsim-{age:016x}" for age in range(24)]
    others = [tmp_path / f"radarsim-{age:016x}" for age in range(24)]
    others += [parent / f"radarsim-thesis-{number}" for number in range(9)]
    for age, each in enumerate((*ours, *others)):
        each.mkdir(parents=True)
        (each / "data").write_text("")
        os.utime(each, (1e9 - age, 1e9 - age))
    kernel_cache.cache_folder.cache_clear()
    try:
        folder = kernel_cache.cache_folder()
    finally:
        kernel_cache.cache_folder.cache_clear()
    assert folder is not None
    assert folder.parent == parent
    assert all((other / "data").exists() for other in others)
    kept = kernel_cache.MAX_FOLDERS - 1
    assert [each.exists() for each in ours] == [True] * kept + [False] * (24 - kept)


def test_cache_is_complete_once_that_is_noted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kernel_cache, "cache_folder", lambda: tmp_path)
    assert not kernel_cache.is_complete()
    kernel_cache.mark_complete()
    assert kernel_cache.is_complete()


@pytest.mark.parametrize("folder", [None, Path("no") / "folder"])
def test_cache_that_is_not_there_is_never_complete(
    monkeypatch: pytest.MonkeyPatch, folder: Path | None
) -> None:
    monkeypatch.setattr(kernel_cache, "cache_folder", lambda: folder)
    kernel_cache.mark_complete()
    assert not kernel_cache.is_complete()


def kernel_modules() -> list[Path]:
    return [
        path
        for path in PACKAGE.rglob("*.py")
        if kernel_cache.is_compiled_into_kernels(path.read_bytes())
    ]


def dotted(path: Path) -> str:
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts)


def decorated(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    for node in tree.body:
        names = getattr(node, "decorator_list", [])
        if any(isinstance(name, ast.Name) and name.id in DECORATORS for name in names):
            assert isinstance(node, ast.FunctionDef)
            yield node


def names_in(node: ast.AST) -> set[str]:
    return {each.id for each in ast.walk(node) if isinstance(each, ast.Name)}


@pytest.mark.parametrize("path", kernel_modules(), ids=dotted)
def test_everything_compiled_into_kernels_is_part_of_the_hash(path: Path) -> None:
    """Names that kernels use come from kernel modules, or from outside the package."""
    tree = ast.parse(path.read_text())
    assigned: dict[str, set[str]] = {}
    origin: dict[str, str] = {}
    for node in tree.body:
        if isinstance(node, ast.ImportFrom) and node.module:
            origin |= {each.asname or each.name: node.module for each in node.names}
        elif isinstance(node, ast.Assign | ast.AnnAssign) and node.value:
            for name in names_in(node) - names_in(node.value):
                assigned[name] = names_in(node.value)
    used = set().union(
        *(
            names_in(statement)
            for function in decorated(tree)
            for statement in function.body
        ),
        set(),
    )
    while new := set().union(*(assigned.get(name, set()) for name in used)) - used:
        used |= new
    hashed = {dotted(each) for each in kernel_modules()}
    modules = {origin[name] for name in used if name in origin}
    ours = {module for module in modules if module.startswith("radarsim.")}
    assert ours - hashed <= {"radarsim.jit"}
