"""A run of two clients, and its recording with the map and pictures."""

from pathlib import Path

import pytest
import recorded_runs
from recorded_runs import RecordedRun

from radarsim.addons.recording.bag_folder import create_folder
from radarsim.addons.recording.recording_process import write_recording
from radarsim.scene.scene import Scene


@pytest.fixture(scope="session")
def run(foliage_room: Scene) -> RecordedRun:
    """A run with a picture each 20 ticks."""
    return recorded_runs.run_two_clients(foliage_room, camera_interval=20)


@pytest.fixture(scope="session")
def bag(
    run: RecordedRun, foliage_room: Scene, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """The recording of the run, which no test changes."""
    folder = tmp_path_factory.mktemp("recording") / "run"
    create_folder(folder)
    write_recording(folder, run.info, run.events, foliage_room)
    return folder
