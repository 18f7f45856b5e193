"""Servers record in a process of its own, which ends well however the server ends."""

import asyncio
import logging
import os
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from commands import run_in_process
from processes import start_radarsim
from recorded_runs import RecordedRun, calls_in

from radarsim.addons.recording import recording_process
from radarsim.addons.recording.bag import BagReader, repair
from radarsim.addons.recording.bag_folder import RecordingInfo, create_folder
from radarsim.addons.recording.recorders import EventType, RunEvent
from radarsim.addons.recording.recording_process import (
    PROGRAM,
    RecordingProcess,
    frame_of,
    opening_of,
)
from radarsim.addons.recording.replay import serve_replay, writes_of
from radarsim.client import Client

DISK_SIZES = (2_000, *range(8_000, 64_000, 7_000))  # bytes
TIMEOUT = 240  # s that a busy machine may need


def serve(folder: Path) -> tuple["subprocess.Popen[bytes]", int]:
    """Start a server that records, and return its process and its port."""
    words = ("serve", "empty_room", "--port", "0", "--record", str(folder))
    server = start_radarsim(*words)
    assert server.stdout is not None
    found = re.search(rb":(\d+)$", server.stdout.readline().strip())
    assert found is not None
    return server, int(found[1])


def drive_a_little(port: int) -> None:
    """Spawn a robot, drive it, and leave."""
    with Client.connect("127.0.0.1", port) as client:
        client.spawn("P3AT", timeout=TIMEOUT)
        client.drive(3.0, 2.0)
        for _ in range(5):
            client.read(timeout=TIMEOUT)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The recording of a server that was interrupted."""
    folder = tmp_path_factory.mktemp("served") / "run"
    server, port = serve(folder)
    drive_a_little(port)
    server.send_signal(signal.SIGINT)
    _, errors = server.communicate(timeout=TIMEOUT)
    assert server.returncode == 130
    assert f"recorded in {folder}" in errors.decode().replace("\n", " ")
    return folder


def test_run_over_tcp_is_repeated_to_the_byte(recorded: Path) -> None:
    done = run_in_process("replay", str(recorded), "--verify")
    assert done.code == 0, done.err
    assert "identical" in done.text


def test_other_map_is_refused(recorded: Path) -> None:
    done = run_in_process("replay", str(recorded), "--verify", "--map", "smoke_room")
    assert done.code == 1
    assert "expected the recorded map" in " ".join(done.err.split())


def test_contents_are_listed(recorded: Path) -> None:
    done = run_in_process("recording", "info", str(recorded))
    assert done.code == 0, done.err
    assert "/radarsim/wire/to_client" in done.text
    assert "map empty_room, seed 0" in done.text


async def test_replay_sends_the_recorded_bytes(recorded: Path) -> None:
    calls = list(BagReader(recorded).calls())
    kinds = EventType.TAKE, EventType.FINISH
    expected = b"".join(call.data for call in calls if call.type in kinds)
    opened = asyncio.get_running_loop().create_future()
    serving = asyncio.ensure_future(
        serve_replay(
            writes_of(calls, None), "127.0.0.1", 0, opened.set_result, speed=20
        )
    )
    reader, writer = await asyncio.open_connection(*await opened)
    writer.write(b"DRIVE {Left 1} {Right 1}\r\n")
    assert await reader.read() == expected
    writer.close()
    os.kill(os.getpid(), signal.SIGTERM)
    assert await serving == 0


def test_replay_names_the_clients_there_are(recorded: Path) -> None:
    done = run_in_process("replay", str(recorded), "--port", "0", "--client", "7")
    assert done.code == 1
    assert "client 7, expected one of 1" in done.err


def test_recording_of_a_killed_server_is_complete(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    server, port = serve(folder)
    drive_a_little(port)
    server.kill()
    server.communicate(timeout=TIMEOUT)
    deadline = time.monotonic() + TIMEOUT
    while not (folder / "metadata.yaml").exists():
        assert time.monotonic() < deadline
        time.sleep(0.05)
    reader = BagReader(folder)
    calls = list(reader.calls())
    assert any(b"{Type RangeScanner}" in call.data for call in calls)
    assert reader.is_complete


def test_existing_folder_is_refused_before_the_map_is_read(tmp_path: Path) -> None:
    words = ("serve", "no_such_map", "--port", "0", "--record", str(tmp_path))
    done = run_in_process(*words)
    assert done.code == 1
    assert "expected a new folder" in " ".join(done.err.split())


def test_wrong_map_leaves_no_folder(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    done = run_in_process(
        "serve", "no_such_map", "--port", "0", "--record", str(folder)
    )
    assert done.code == 1
    assert not folder.exists()


def feed(data: bytes, limit: int | None = None) -> str:
    """Run the program of a recording process on its input; return what it says.

    Args:
        data: The input.
        limit: Largest size of its files, bytes, as if the disk were full then.
    """

    def restrict() -> None:
        if limit is not None:
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    # Coverage writes files as well, and Python byte code, which it does not write again
    # when the limit has cut it off: every later import of the module would fail.
    env = {k: v for k, v in os.environ.items() if not k.startswith("COVERAGE")}
    env["PYTHONDONTWRITEBYTECODE"] = "1"
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *sys.path],
        stdin=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=env,
        preexec_fn=restrict,  # noqa: PLW1509 - it changes limits only
    )
    _, errors = process.communicate(data, timeout=TIMEOUT)
    return errors.decode()


def input_of(folder: Path, run: RecordedRun, events: list[RunEvent]) -> bytes:
    """Return the input of a recording process for events of a run."""
    return opening_of(folder, run.info) + b"".join(map(frame_of, events))


def test_event_that_the_server_did_not_write_whole_is_left_out(
    run: RecordedRun, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    create_folder(folder)
    assert not feed(opening_of(folder, run.info)[:-1])
    assert not [*folder.iterdir()]
    last = max(k for k, event in enumerate(run.events) if event.data)
    assert not feed(input_of(folder, run, run.events[: last + 1])[:-1])
    assert list(BagReader(folder).calls()) == calls_in(run.events[:last])


@pytest.mark.parametrize(
    "limit",
    [
        44_000,
        *(pytest.param(limit, marks=pytest.mark.slow) for limit in DISK_SIZES),
    ],
)
def test_full_disk_ends_the_recording_with_a_sentence(
    limit: int, run: RecordedRun, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    create_folder(folder)
    errors = feed(input_of(folder, run, run.events), limit)
    assert errors.count("\n") == 1
    assert "ends: file too large; the server goes on" in errors
    repair(folder)
    calls = list(BagReader(folder).calls())
    assert calls == run.calls[: len(calls)]


def test_recording_that_falls_behind_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(recording_process, "MAX_WAITING", 1000)
    program = "import sys; sys.stdin.buffer.read()"
    monkeypatch.setattr(recording_process, "PROGRAM", program)
    info = RecordingInfo(version="1")
    process = RecordingProcess(tmp_path / "run", info)
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            process.add(RunEvent(EventType.RECEIVE, 1, 1, bytes(2_000_000)))
    assert caplog.text.count("recording ends") == 1
    assert not process.close()
