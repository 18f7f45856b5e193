"""Errors of the machine: plain words, always the same ones, and what helps."""

import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from commands import run_in_process as radarsim

from radarsim import errors

SCAN = ("scan", "empty_room", "--sensor", "laser", "--start", "RobotStart1")

BUG = ("--algorithm", "bug1", "--goal", "1,1")


@pytest.fixture
def taken_port() -> Iterator[str]:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        yield str(listener.getsockname()[1])


@pytest.fixture
def free_port() -> str:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return str(listener.getsockname()[1])


@pytest.mark.parametrize(
    "command",
    [
        ("navigate", *BUG, "--connect", "127.0.0.1:{}"),
        ("map", "-o", "{}/m", "--connect", "127.0.0.1:{}"),
        ("map", "-o", "{}/m", "--connect", "localhost:{}"),
    ],
)
def test_without_a_server_an_error_names_the_command_that_starts_one(
    tmp_path: Path, free_port: str, command: tuple[str, ...]
) -> None:
    words = (each.format(tmp_path if "/" in each else free_port) for each in command)
    run = radarsim(*words)
    assert run.code == 1
    assert f"radarsim serve foliage_room --port {free_port}\n" in run.err
    assert "rrno" not in run.err


@pytest.mark.parametrize(
    ("robot", "code", "message"),
    [
        ("P3AT_Radar361", 2, "USARBot.P3AT_Radar361"),
        ("USARBot.P3AT_Radar361", 1, "no server"),
        ("Submarine", 1, "no server"),
    ],
)
def test_similar_class_of_another_server_is_named_with_its_package(
    free_port: str, robot: str, code: int, message: str
) -> None:
    run = radarsim(
        *("navigate", *BUG, "--connect", f"127.0.0.1:{free_port}"), *("--robot", robot)
    )
    assert run.code == code
    assert message in run.err
    assert ("did you mean 'P3AT_Radar360'" in run.err) == (code == 2)


def test_map_that_cannot_be_made_leaves_no_folder(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    for name in ("new", "there"):
        out = f"{tmp_path / name}/"
        run = radarsim("map", "empty_room", "--start", "Nowhere", "-o", out)
        assert run.code == 2
    assert [each.name for each in tmp_path.iterdir()] == ["there"]


def test_a_server_elsewhere_cannot_be_started_from_here() -> None:
    run = radarsim(*("navigate", *BUG, "--connect", "nowhere.invalid:3000"))
    assert run.code == 1
    assert "no server at nowhere.invalid:3000: " in run.err
    assert "radarsim serve" not in run.err
    assert "rrno" not in run.err


@pytest.mark.parametrize(
    ("command", "option"),
    [
        ("serve no_such_map --host 127.0.0.1", "--port"),
        ("serve no_such_map --host localhost --port 0", "--image-port"),
        ("serve no_such_map --port 0", "--web"),
        ("commander empty_room", "--web"),
        ("commander --connect 127.0.0.1:1", "--web"),
    ],
)
def test_port_in_use_is_reported_with_a_hint_before_the_map_is_read(
    taken_port: str, command: str, option: str
) -> None:
    run = radarsim(*command.split(), option, taken_port)
    assert (run.code, run.out) == (1, b"")
    assert "in use by another program" in run.err
    assert f"{option} 0 picks a free port" in run.err
    assert "no_such_map" not in run.err


def is_readable(path: Path) -> bool:
    try:
        path.open("rb").close()
    except PermissionError:
        return False
    return True


@contextmanager
def plain_user() -> Iterator[None]:
    """Run as a user who may not read and write everything."""
    if os.geteuid() != 0:
        yield
        return
    os.seteuid(65534)
    try:
        if not is_readable(Path(errors.__file__)):
            pytest.skip("the package is in a folder that only root can read")
        yield
    finally:
        os.seteuid(0)


@pytest.mark.parametrize(
    "command",
    [
        ("check", "{}/map.yaml"),
        (*SCAN, "-o", "{}/scan.json"),
        ("navigate", "bug_box", "--algorithm", "bug1", "--plot", "{}/a.png"),
        ("map", "-o", "{}/m", "empty_room"),
        ("map", "-o", "{}/m/", "empty_room"),
        ("serve", "empty_room", "--port", "0", "--record", "{}/bag"),
        ("sweep", "{}/sweep.yaml", "-o", "/dev/null/out"),
        ("replay", "{}/bag"),
    ],
)
@pytest.mark.usefixtures("empty_room")
def test_missing_permission_has_one_wording(
    tmp_path: Path, command: tuple[str, ...]
) -> None:
    folder = tmp_path / "closed"
    folder.mkdir()
    (folder / "map.yaml").write_text("version: 1\n")
    for parent in (tmp_path, *tmp_path.parents[:2]):  # another user has to get there
        parent.chmod(0o755)
    # Loads what the command needs: the interpreter may be where only root can read.
    radarsim(*(word.format("/dev/null/folder") for word in command))
    folder.chmod(0o000)
    with plain_user():
        run = radarsim(*(word.format(folder) for word in command))
    folder.chmod(0o755)
    assert run.code in (1, 2)
    assert "no permission" in run.text + run.err
    if command[0] in ("sweep", "replay"):  # which read it
        assert "cannot write" not in run.err
