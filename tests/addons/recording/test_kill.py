"""A recording process that is killed leaves a bag that can be repaired."""

import random
import subprocess
import sys
import time
from pathlib import Path

import pytest
import recorded_runs
from rosbags.highlevel import AnyReader

from radarsim.addons.recording.bag import CHUNK_BYTES, BagReader, repair
from radarsim.addons.recording.bag_folder import create_folder, file_name
from radarsim.addons.recording.recorders import RunEvent
from radarsim.addons.recording.recording_process import PROGRAM, frame_of, opening_of
from radarsim.errors import RecordingError
from radarsim.scene.scene import Scene

TIMEOUT = 240  # s that a busy machine may need


@pytest.fixture(scope="module")
def run(foliage_room: Scene) -> recorded_runs.RecordedRun:
    return recorded_runs.run_two_clients(foliage_room, ticks=600)


def start(folder: Path, run: recorded_runs.RecordedRun) -> "subprocess.Popen[bytes]":
    create_folder(folder)
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *sys.path], stdin=subprocess.PIPE, bufsize=0
    )
    assert process.stdin is not None
    process.stdin.write(opening_of(folder, run.info))
    return process


def kill(process: "subprocess.Popen[bytes]") -> None:
    assert process.stdin is not None
    process.kill()
    process.wait(TIMEOUT)
    process.stdin.close()


def wait_until_idle(path: Path) -> None:
    """Wait until a file exists and has stopped growing for a second."""
    deadline, size, since = time.monotonic() + TIMEOUT, -1, time.monotonic()
    while time.monotonic() < since + 1 or size < 0:
        assert time.monotonic() < deadline
        now = path.stat().st_size if path.exists() else -1
        if now != size:
            size, since = now, time.monotonic()
        time.sleep(0.02)


def repaired_calls(folder: Path) -> list[RunEvent]:
    repair(folder)
    with AnyReader([folder]) as reader:
        assert reader.message_count == len(list(BagReader(folder).messages()))
    return list(BagReader(folder).calls())


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_bag_of_a_killed_process_is_repaired(
    seed: int, run: recorded_runs.RecordedRun, tmp_path: Path
) -> None:
    folder, chance = tmp_path / "run", random.Random(seed)
    process = start(folder, run)
    assert process.stdin is not None
    wait_until_idle(folder / file_name(folder))
    until = chance.randrange(len(run.events))
    for event in run.events[:until]:
        process.stdin.write(frame_of(event))
        time.sleep(chance.random() / 1000)
    kill(process)
    calls = repaired_calls(folder)
    expected = recorded_runs.calls_in(run.events[:until])
    assert calls == expected[: len(calls)]


@pytest.mark.slow
def test_at_most_one_chunk_is_lost(
    run: recorded_runs.RecordedRun, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    process = start(folder, run)
    assert process.stdin is not None
    for event in run.events:
        process.stdin.write(frame_of(event))
    wait_until_idle(folder / file_name(folder))
    kill(process)
    calls = repaired_calls(folder)
    expected = run.calls
    assert calls == expected[: len(calls)]
    lost = expected[len(calls) :]
    assert sum(len(call.data) for call in lost) < CHUNK_BYTES
    assert not lost or lost[-1].tick - lost[0].tick <= 100


@pytest.mark.slow
def test_process_that_is_killed_at_once_leaves_no_recording(
    run: recorded_runs.RecordedRun, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    kill(start(folder, run))
    with pytest.raises(RecordingError):
        BagReader(folder)
