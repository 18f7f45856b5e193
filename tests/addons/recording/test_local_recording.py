"""A simulation in Python is recorded as a server is, and can be repeated."""

from pathlib import Path

import numpy as np
import pytest
from commands import run_in_process

import radarsim
from radarsim.errors import RecordingError
from radarsim.scene.scene import Scene


def test_recorded_run_is_repeated_byte_by_byte(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    with radarsim.simulate("foliage_room", seed=5) as sim:
        sim.record(folder)
        robots = [sim.spawn(name=name) for name in ("one", "two")]
        robots[0].request_echoes()
        for k in range(5):
            robots[0].drive(0.4, turn=0.1 * k)
            robots[1].drive_wheels(2.0, -1.0)
            sim.step(0.1)
        robots[1].remove()
        sim.step(0.2)
        ranges = robots[0].scan().ranges
    verified = run_in_process("replay", str(folder), "--verify")
    assert verified.code == 0, verified.err
    assert "0.7 s of 2 clients" in verified.text
    recording = radarsim.load_recording(folder)
    scans = recording.scans["one/lms200"]
    assert len(scans.times) == 7
    came_back = np.isfinite(scans.ranges[-1])
    np.testing.assert_allclose(scans.ranges[-1][came_back], ranges[came_back])
    assert "one/lms200" in recording.echoes


@pytest.mark.slow
def test_run_in_a_scene_of_ones_own_is_readable(
    foliage_room: Scene, tmp_path: Path
) -> None:
    with radarsim.simulate(foliage_room) as sim:
        sim.record(tmp_path / "run")
        sim.spawn(name="one")
        sim.step(0.5)
    assert list(radarsim.load_recording(tmp_path / "run").scans) == ["one/lms200"]


def test_recording_begins_with_the_simulation(
    foliage_room: Scene, tmp_path: Path
) -> None:
    sim = radarsim.simulate(foliage_room)
    sim.step(0.01)
    with pytest.raises(RecordingError, match="before the first robot"):
        sim.record(tmp_path / "run")
    assert not (tmp_path / "run").exists()
