"""Options from files and the environment, the log as JSON, and completion."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from processes import start_radarsim

from radarsim.cli.completion import complete_map, complete_robot, complete_sensor
from radarsim.client import Client

Command = Callable[..., Any]
TIMEOUT = 240  # s that a busy machine may need


def test_server_takes_its_options_from_a_file(tmp_path: Path) -> None:
    config = tmp_path / "server.yaml"
    config.write_text("map: empty_room\nport: 0\nlog_format: json\nverbose: true\n")
    with start_radarsim("serve", "--config", str(config)) as server:
        assert server.stdout is not None
        port = int(server.stdout.readline().strip().rpartition(b":")[2])
        with Client.connect("127.0.0.1", port) as client:
            assert client.greeting().level == "DM-EmptyRoom"
        server.send_signal(signal.SIGINT)
        _, errors = server.communicate(timeout=TIMEOUT)
    lines = [line for line in errors.decode().splitlines() if line.startswith("{")]
    records = [json.loads(line) for line in lines]
    assert {"time", "level", "logger", "message"} == records[0].keys()
    assert any("connected" in record["message"] for record in records)


def test_level_of_the_log_counts_before_verbose() -> None:
    options = ("--verbose", "--log-level", "error", "--port", "0")
    with start_radarsim("serve", "empty_room", *options) as server:
        assert server.stdout is not None
        port = int(server.stdout.readline().strip().rpartition(b":")[2])
        with Client.connect("127.0.0.1", port) as client:
            client.greeting()
            client.send(b"NONSENSE\r\n")
            assert client.start_poses()
        server.send_signal(signal.SIGINT)
        _, errors = server.communicate(timeout=TIMEOUT)
    assert b"INFO" not in errors
    assert b"WARNING" not in errors


@pytest.mark.parametrize(
    "text", ["mapp: empty_room", "port: 99999", "- 1", "a: [", "speed: fast"]
)
def test_wrong_file_of_options_is_refused(
    radarsim: Command, tmp_path: Path, text: str
) -> None:
    config = tmp_path / "server.yaml"
    config.write_text(text)
    done = radarsim("serve", "empty_room", "--config", str(config))
    assert done.code == 2
    assert "expected" in done.err or "not YAML" in done.err
    assert done.err.count("\n") == 1


def test_options_come_from_the_environment(
    radarsim: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RADARSIM_SERVE_PORT", "99999")
    assert "SERVE_PORT: '99999'" in radarsim("serve", "empty_room").err


def test_names_are_completed(tmp_path: Path) -> None:
    assert list(complete_map("folia")) == ["foliage_room"]
    assert list(complete_sensor("usarsim_s")) == ["usarsim_sick"]
    assert "P3AT_Navtech" in list(complete_robot("P3AT"))
    (tmp_path / "room.yaml").touch()
    (tmp_path / "notes.txt").touch()
    assert list(complete_map(f"{tmp_path}/")) == [f"{tmp_path}/room.yaml"]


def test_completion_compiles_nothing() -> None:
    code = "import sys, radarsim.cli.completion; print('numba' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert done.stdout == "False\n"
