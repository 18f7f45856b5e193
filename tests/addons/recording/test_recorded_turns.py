"""Recordings have the spectra of turning radars."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import recorded_runs
from commands import run_in_process

import radarsim
from radarsim.addons.fmcw.rotation import Sector
from radarsim.addons.fmcw.rotation_schedule import LATENCY, antennas_of
from radarsim.addons.fmcw.spectrum import Spectrum
from radarsim.addons.recording.bag_folder import (
    RecordingInfo,
    create_folder,
    digest_of,
)
from radarsim.addons.recording.recorders import (
    EventType,
    HostRecorder,
    RunEvent,
    TurnCollector,
    unpack,
)
from radarsim.addons.recording.recording_process import write_recording
from radarsim.addons.recording.replay import repeat_run
from radarsim.geometry import Pose3
from radarsim.presets.fmcw_settings import RADAR_MODEL
from radarsim.presets.robots import load_robot
from radarsim.rng import generator_for
from radarsim.scene.map_file import find_map
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

INIT = b"INIT {ClassName USARBot.P3AT_Navtech} {Name R1} {Start RobotStart1}\r\n"
TURN = 25  # ticks
TICKS = 2 * TURN + 3 + LATENCY  # the first turn is not received


@pytest.fixture(scope="module")
def events(foliage_room: Scene) -> list[RunEvent]:
    """A run with one turn."""
    events: list[RunEvent] = []
    recorder = HostRecorder(events.append, spectra=True)
    host = Host(foliage_room, observers=[recorder])
    client = host.connect()
    host.receive(client, INIT)
    for _ in range(TICKS):
        host.step()
        host.take(client)
    recorder.end()
    return events


def expected_counts(scene: Scene) -> np.ndarray[tuple[int, int], np.dtype[np.uint8]]:
    """Return the first turn of a radar that stands where the robot does."""
    model = load_robot("P3AT_Navtech")
    item = model.items_of("RangeScanner")[1]
    lift = Pose3(0.0, 0.0, model.origin_height)
    pose = scene.starts[0].pose.compose(lift).compose(item.mount)
    radar = SimulationConfig().scanner(item).fmcw
    rng = radarsim.generator_for(0, "R1", "Navtech")
    turn: Spectrum = radar.spectrum(scene, pose, rng)
    assert turn.counts.ndim == 2
    return turn.counts


def test_turn_is_what_the_radar_receives_there(
    events: list[RunEvent], foliage_room: Scene, tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    create_folder(folder)
    write_recording(folder, RecordingInfo(version="1"), events)
    recording = radarsim.load_recording(folder)
    (turn,) = recording.turns("R1/Navtech")
    np.testing.assert_array_equal(turn.counts, expected_counts(foliage_room))
    assert turn.frame == "R1/Navtech"
    azimuths, bins = turn.counts.shape
    assert turn.angles == pytest.approx(
        -2 * np.pi * np.arange(azimuths) / azimuths, abs=2 * np.pi / 5600
    )
    assert turn.times == pytest.approx(
        turn.times[0] + 0.25 * np.arange(azimuths) / azimuths, abs=2e-6
    )
    assert turn.ranges[-1] == pytest.approx(0.0438 * (bins - 1), rel=0.01)
    assert not list(recording.turns("R1/lms200"))


def test_recorded_spectra_change_nothing_else(
    events: list[RunEvent], foliage_room: Scene
) -> None:
    (turn,) = [event.data for event in events if event.type is EventType.TURN]
    assert unpack(turn)[0] == "Navtech"
    host = Host(foliage_room)
    assert not repeat_run(host, recorded_runs.calls_in(events)).difference


@pytest.mark.parametrize("revision", [1, 2, RADAR_MODEL])
def test_recording_of_another_radar_model_says_why_it_differs(
    revision: int, events: list[RunEvent], tmp_path: Path
) -> None:
    folder = tmp_path / "run"
    create_folder(folder)
    # The first bytes that a client was sent are others than now.
    first = next(k for k, each in enumerate(events) if each.type is EventType.TAKE)
    changed = events[first]._replace(data=b"SEN {Type None}\r\n")
    path, _ = find_map("foliage_room")
    info = RecordingInfo(
        version="1",
        map="foliage_room",
        map_digest=digest_of(path),
        radar_model=revision,
    )
    write_recording(folder, info, [*events[:first], changed, *events[first + 1 :]])
    done = run_in_process("replay", str(folder), "--verify")
    assert done.code == 1
    printed = " ".join(done.err.split())
    assert "differs at" in printed
    is_reported = "FMCW radars detect different targets" in printed
    assert is_reported is (revision != RADAR_MODEL)


def test_spectra_are_recorded_on_request_only(foliage_room: Scene) -> None:
    events: list[RunEvent] = []
    host = Host(foliage_room, observers=[HostRecorder(events.append)])
    host.receive(host.connect(), INIT)
    (antenna,) = antennas_of(host.simulation).all
    assert not antenna.observers


@pytest.mark.parametrize(
    "received", [slice(200, 400), slice(9)], ids=["begun before", "not ended"]
)
def test_part_of_a_turn_is_no_turn_and_no_part_of_the_next(
    received: slice, foliage_room: Scene
) -> None:
    radar = radarsim.load_sensor("navtech_cts350x")
    whole = radar.spectrum(foliage_room, (-7.8, 0, 0), generator_for(1, "turn"))
    part = replace(whole, angles=whole.angles[received], power=whole.power[received])
    turns: list[bytes] = []
    collector = TurnCollector("Navtech", turns.append)
    collector.take(Sector(0, received.start or 0, part), 1.0)
    assert not turns
    collector.take(Sector(1, 0, whole), 7.0)
    _, time, _, rows = unpack(*turns)
    assert (time, len(rows)) == (7.0, 400)
