from collections.abc import Callable
from typing import Any

import pytest

from radarsim.cli.fields import read_item_setting
from radarsim.cli.serve import DEFAULT_MAX_CLIENTS
from radarsim.cli.server_options import ServerOptions, announce
from radarsim.server.tcp_server import MAX_CLIENTS

Command = Callable[..., Any]


@pytest.mark.parametrize("text", ["max_range=20", ".max_range=20", "lms200.=2", "a.b"])
def test_setting_without_item_key_or_value_is_a_usage_error(
    radarsim: Command, text: str
) -> None:
    run = radarsim("serve", "empty_room", "--set", text)
    assert run.code == 2
    assert run.err == f"radarsim: --set: {text!r}, expected ITEM.KEY=VALUE\n"


@pytest.mark.parametrize(
    "text", ["a.b=20", "a.b=1,2,1", "a.b=inf", "a.b=first", 'a.b="7"', "a.b=true"]
)
def test_page_reads_the_settings_that_the_server_has(text: str) -> None:
    options = ServerOptions(settings=(read_item_setting(text),))
    assert options.words()[:3] == ["--dialect", "compat", "--set"]
    assert read_item_setting(options.words()[3]) == options.settings[0]


@pytest.mark.parametrize(
    ("options", "text"),
    [
        pytest.param(["--set", "lms300.max_range=2"], "'lms300'", id="item"),
        pytest.param(["--set", "lms200.max_rnge=2"], "max_rnge", id="setting"),
        pytest.param(["--set", "InsTest.sigma=-1"], "sigma", id="value"),
        pytest.param(["--set", "Odometer.sigma=1"], "Odometer", id="no settings"),
        pytest.param(["--speed", "0"], "expected more than 0", id="speed zero"),
        pytest.param(["--speed", "inf"], "finite", id="speed infinite"),
        pytest.param(["--port", "70000"], "--port", id="port"),
        pytest.param(["--image-port", "-1"], "--image-port", id="image port"),
        pytest.param(
            ["--port", "5003", "--image-port", "5003"], "--image-port", id="same port"
        ),
        pytest.param(["--navtech", "x"], "'x', expected a port", id="radar port"),
        pytest.param(["--navtech", "0:"], "'0:', expected the name", id="no robot"),
        pytest.param(["--seed", "-1"], "--seed", id="seed"),
        pytest.param(["--max-clients", "0"], "--max-clients", id="no clients"),
        pytest.param(["--dialect", "klingon"], "klingon", id="dialect"),
    ],
)
def test_wrong_option_is_a_usage_error(
    radarsim: Command, options: list[str], text: str
) -> None:
    run = radarsim("serve", "empty_room", "--port", "0", *options)
    assert run.code == 2
    assert text in run.err


def test_foreign_address_is_an_error_in_one_line(radarsim: Command) -> None:
    run = radarsim("serve", "empty_room", "--host", "192.0.2.1", "--port", "0")
    assert run.code == 1
    assert run.err.startswith("radarsim: cannot listen on 192.0.2.1:0: ")
    assert run.err.count("\n") == 1


@pytest.mark.parametrize(
    ("address", "command"),
    [
        (("127.0.0.1", 3000), "radarsim drive;"),
        (("127.0.0.1", 4000), "radarsim drive --connect 127.0.0.1:4000;"),
        (("192.0.2.1", 3000), "radarsim drive --connect 192.0.2.1:3000;"),
    ],
)
def test_next_step_is_told_to_a_person_on_stderr(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    address: tuple[str, int],
    command: str,
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    announce(address)
    out, err = capsys.readouterr()
    assert out == f"radarsim: listening on {address[0]}:{address[1]}\n"
    assert command in err


def test_programs_get_the_address_alone(capsys: pytest.CaptureFixture[str]) -> None:
    announce(("127.0.0.1", 3000))
    assert capsys.readouterr() == ("radarsim: listening on 127.0.0.1:3000\n", "")


def test_each_port_is_announced_at_each_address(
    radarsim: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def announce_alone(*arguments: Any) -> int:
        *_, announce_all, companions = arguments
        for port, each in enumerate(companions, 3001):
            each.address = ("::1", port)
        announce_all(("::1", 3000))
        return 0

    monkeypatch.setattr("radarsim.server.tcp_server.serve", announce_alone)
    hosts = ["--host", "::1", "--host", "127.0.0.1"]
    run = radarsim("serve", "empty_room", *hosts, "--port", "0", "--truth-port", "0")
    assert run.text.splitlines()[:4] == [
        "radarsim: listening on [::1]:3000",
        "radarsim: listening on 127.0.0.1:3000",
        "radarsim: truth on [::1]:3001",
        "radarsim: truth on 127.0.0.1:3001",
    ]


def test_command_and_server_take_as_many_clients_by_default() -> None:
    assert DEFAULT_MAX_CLIENTS == MAX_CLIENTS == 1024


def test_fewer_clients_are_taken_where_the_system_permits_fewer_files(
    radarsim: Command,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.setattr("radarsim.listening.raise_file_limit", lambda _: 200)
    options = ["--host", "192.0.2.1", "--port", "0", "--max-clients", "100"]
    radarsim("serve", "empty_room", *options)
    assert "at most 72 clients: the system permits 200 open files" in caplog.text
    assert "expected 228 for --max-clients 100" in caplog.text
    monkeypatch.setattr("radarsim.listening.raise_file_limit", lambda _: 64)
    radarsim("serve", "empty_room", *options)
    assert "at most 32 clients: the system permits 64 open files" in caplog.text
