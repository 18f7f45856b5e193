import json
import logging
import signal
from pathlib import Path
from typing import Any

import pytest
from commands import run_in_process as radarsim
from processes import start_radarsim

from radarsim.cli.fields import read_item_setting
from radarsim.cli.serve import DEFAULT_MAX_CLIENTS, LogOptions
from radarsim.cli.server_options import ServerOptions, announce
from radarsim.client import Client
from radarsim.server.tcp_server import MAX_CLIENTS


def test_server_takes_its_options_from_a_file(tmp_path: Path) -> None:
    config = tmp_path / "server.yaml"
    config.write_text("map: empty_room\nport: 0\nlog_format: json\nverbose: true\n")
    with start_radarsim("serve", "--config", str(config)) as server:
        assert server.stdout is not None
        port = int(server.stdout.readline().strip().rpartition(b":")[2])
        with Client.connect("127.0.0.1", port) as client:
            assert client.greeting().level == "DM-EmptyRoom"
        server.send_signal(signal.SIGINT)
        _, errors = server.communicate(timeout=240)
    lines = [line for line in errors.decode().splitlines() if line.startswith("{")]
    records = [json.loads(line) for line in lines]
    assert {"time", "level", "logger", "message"} == records[0].keys()
    assert any("connected" in record["message"] for record in records)


def test_level_of_the_log_counts_before_verbose(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    root = logging.getLogger()
    monkeypatch.setattr(root, "handlers", [])
    level = root.level
    LogOptions(verbose=True, log_level="error").start()
    found = root.level
    root.setLevel(level)
    assert found == logging.ERROR


@pytest.mark.parametrize(
    "text", ["a.b=20", "a.b=1,2,1", "a.b=inf", "a.b=first", 'a.b="7"', "a.b=true"]
)
def test_page_reads_the_settings_that_the_server_has(text: str) -> None:
    options = ServerOptions(settings=(read_item_setting(text),))
    assert options.words()[:3] == ["--dialect", "compat", "--set"]
    assert read_item_setting(options.words()[3]) == options.settings[0]


def test_foreign_address_is_an_error_in_one_line() -> None:
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
def test_next_step_is_printed_for_a_person_on_stderr(
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
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def announce_alone(*arguments: Any) -> int:
        announce_all = arguments[-2]
        announce_all(("::1", 3000))
        return 0

    monkeypatch.setattr("radarsim.server.tcp_server.serve", announce_alone)
    at = property(lambda _: ["::1", "127.0.0.1"])
    monkeypatch.setattr("radarsim.server.peer_connections.PeerServer.addresses", at)
    hosts = ["--host", "::1", "--host", "127.0.0.1"]
    run = radarsim("serve", "empty_room", *hosts, "--port", "0", "--truth-port", "0")
    assert run.text.splitlines()[:4] == [
        "radarsim: listening on [::1]:3000",
        "radarsim: listening on 127.0.0.1:3000",
        "radarsim: truth on [::1]:0",
        "radarsim: truth on 127.0.0.1:0",
    ]


def test_command_and_server_take_as_many_clients_by_default() -> None:
    assert DEFAULT_MAX_CLIENTS == MAX_CLIENTS == 1024


def test_fewer_clients_are_taken_where_the_system_permits_fewer_files(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("radarsim.listening.raise_file_limit", lambda _: 200)
    options = ["--host", "192.0.2.1", "--port", "0", "--max-clients", "100"]
    radarsim("serve", "empty_room", *options)
    assert "at most 72 clients: the system permits 200 open files" in caplog.text
    assert "expected 228 for --max-clients 100" in caplog.text
    monkeypatch.setattr("radarsim.listening.raise_file_limit", lambda _: 64)
    radarsim("serve", "empty_room", *options)
    assert "at most 32 clients: the system permits 64 open files" in caplog.text
