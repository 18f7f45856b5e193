import os
import re
import signal
import subprocess
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import httpx
import pytest
from commands import run_in_process as radarsim
from processes import start_radarsim

from radarsim.addons.web.cli import announce_commander
from radarsim.cli.server_options import ServerOptions

TIMEOUT = 240.0  # s
NOBODY = ("--connect", "127.0.0.1:1")


def read_url(process: subprocess.Popen[bytes]) -> str:
    """Return the address of the page that a program announces."""
    assert process.stdout is not None
    for line in process.stdout:
        found = re.fullmatch(
            r"radarsim: commander on (http://127\.0\.0\.1:\d+/)#token=[\w-]{16,}\n",
            line.decode(),
        )
        if found:
            return found[1]
    assert process.stderr is not None
    raise AssertionError(process.stderr.read().decode())


def is_served(url: str) -> bool:
    try:
        return httpx.get(url, timeout=TIMEOUT).status_code == 200
    except httpx.TransportError:
        return False


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    "end",
    [
        pytest.param(signal.SIGTERM, marks=SLOW),
        pytest.param(signal.SIGINT, marks=SLOW),
        signal.SIGKILL,
    ],
)
def test_commander_ends_with_the_server_that_started_it(end: signal.Signals) -> None:
    """It ends first, so that it does not say that the server is gone."""
    server = start_radarsim("serve", "empty_room", "--port", "0", "--web", "0")
    with server:
        try:
            url = read_url(server)
            assert is_served(url)
        finally:
            server.send_signal(end)
        _, errors = server.communicate(timeout=TIMEOUT)
        while is_served(url):
            pass
    assert end is signal.SIGKILL or errors == b""


@SLOW
def test_server_reports_when_its_commander_has_ended_and_goes_on() -> None:
    server = start_radarsim("serve", "empty_room", "--port", "0", "--web", "0")
    with server:
        try:
            read_url(server)
            threads = Path(f"/proc/{server.pid}/task").glob("*/children")
            (child,) = {pid for each in threads for pid in each.read_text().split()}
            os.kill(int(child), signal.SIGKILL)
            assert server.stderr is not None
            line = next(line for line in server.stderr if b"commander" in line)
            assert b"signal 9" in line
            assert server.poll() is None
        finally:
            server.terminate()
        server.communicate(timeout=TIMEOUT)


def test_commander_of_a_map_serves_it() -> None:
    with start_radarsim("commander", "empty_room", "--web", "0") as program:
        try:
            assert program.stdout is not None
            printed = program.stdout.readline().decode()
            assert printed.startswith("radarsim: listening on 127.0.0.1:")
            assert is_served(read_url(program))
        finally:
            program.send_signal(signal.SIGINT)
        assert program.wait(TIMEOUT) == 130


@pytest.mark.parametrize("text", [None, "version: 1\nobjects: 3\n"])
def test_wrong_map_is_reported_before_an_address_is(
    tmp_path: Path, text: str | None
) -> None:
    file = tmp_path / "wrong.yaml"
    if text is not None:
        file.write_text(text)
    run = radarsim("commander", *NOBODY, "--web", "0", "--draw", file)
    assert (run.code, run.out) == (1, b"")
    assert "wrong.yaml" in run.err


@SLOW
def test_commander_of_a_server_that_cannot_start_ends_as_well() -> None:
    with start_radarsim("serve", "no_such_map", "--port", "0", "--web", "0") as run:
        out, err = run.communicate(timeout=TIMEOUT)
    assert run.returncode == 1
    assert out == b""
    assert err.decode().count("no_such_map") == 1


@SLOW
@pytest.mark.parametrize("end", [(signal.SIGTERM, 0), (signal.SIGINT, 130)])
def test_signal_ends_the_commander(end: tuple[signal.Signals, int]) -> None:
    number, code = end
    with start_radarsim("commander", *NOBODY, "--web", "0") as program:
        try:
            assert is_served(read_url(program))  # also without a server
        finally:
            program.send_signal(number)
        assert program.wait(TIMEOUT) == code


@pytest.mark.parametrize("token", ["x" * 200, "a+b/c=&d#e%20f 0123"])
def test_address_is_one_line_of_which_the_page_reads_any_token(
    capsys: pytest.CaptureFixture[str], token: str
) -> None:
    announce_commander(("::1", 8000), token)
    out, _ = capsys.readouterr()
    assert out.startswith("radarsim: commander on http://[::1]:8000/#token=")
    assert out.count("\n") == 1
    assert parse_qs(urlsplit(out.split()[-1]).fragment) == {"token": [token]}


def test_page_gets_the_classes_that_the_server_gets(tmp_path: Path) -> None:
    file = tmp_path / "tall.yaml"
    file.write_text("based_on: P3AT\nname: Tall\n")
    options = ServerOptions(dialect="udk", robots=(file,))
    words = options.words()
    assert words == ["--dialect", "udk", "--robots", str(file)]
    assert [each.name for each in options.config().robots] == ["Tall"]
    file.write_text("based_on: P3AT\nname: 7\n")
    run = radarsim("commander", *NOBODY, *words, "--web", "0")
    assert run.code == 1
    assert f"{file}:2" in run.err
