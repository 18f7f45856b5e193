"""Runs that are recorded in the process of a test."""

import functools
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.highlevel import AnyReader

from radarsim.addons.recording.bag_folder import RecordingInfo, create_folder
from radarsim.addons.recording.recorders import HostRecorder, RunEvent
from radarsim.addons.recording.recording_process import write_recording
from radarsim.protocol.dialect import UDK, get_dialect
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

FIRST = "INIT {{ClassName USARBot.P3AT_Compare}} {{Name R 1}} {{Start {}}}\r\n"
SECOND = "INIT {{ClassName P3AT}} {{Name R_1}} {{Start {}}}\r\n"
STARTS = ("RobotStart1", "RobotStart2")
ECHOES = b"SET {Type RangeScanner} {Name lms200} {Opcode ECHOES} {Params true}\r\n"
DRIVE = b"DRIVE {Left 3} {Right 2}\r\n"


class RecordedRun(NamedTuple):
    """A run of two clients."""

    events: list[RunEvent]
    sent: dict[int, bytes]
    info: RecordingInfo

    @property
    def calls(self) -> list[RunEvent]:
        """The calls of the host."""
        return calls_in(self.events)


def run_two_clients(
    scene: Scene,
    *,
    ticks: int = 100,
    config: SimulationConfig | None = None,
    starts: Sequence[str] = STARTS,
    camera_interval: int = 0,
) -> RecordedRun:
    """Run two clients; one spawns before simulated time begins, and leaves first."""
    first_spawn, second_spawn = (
        line.format(start).encode()
        for line, start in zip((FIRST, SECOND), starts, strict=True)
    )
    config = config or SimulationConfig()
    events: list[RunEvent] = []
    recorder = HostRecorder(events.append, camera_interval=camera_interval)
    host = Host(scene, config=config, seed=1, observers=[recorder])
    first = host.connect()
    sent = {first: host.take(first)}
    for _ in range(3):
        host.step(passes=False)
    host.receive(first, first_spawn)
    host.step(passes=False)
    second = host.connect()
    sent[second] = b""
    for tick in range(ticks):
        host.step()
        if tick == ticks // 10:
            host.receive(first, ECHOES + DRIVE)
            host.receive(second, second_spawn + b"GETSTARTPOSES\r\n")
        for number in host.clients_to_send():
            sent[number] += host.take(number)
    sent[first] += host.finish(first)
    host.disconnect(first)
    host.step()
    recorder.end()
    info = RecordingInfo(
        version="1",
        map=scene.name,
        seed=1,
        dialect="udk" if config.dialect is UDK else "compat",
    )
    return RecordedRun(events, sent, info)


def write_run(run: RecordedRun, folder: Path) -> None:
    """Write the bag of a run."""
    create_folder(folder)
    write_recording(folder, run.info, run.events)


def host_of(run: RecordedRun, scene: Scene, *, seed: int = 1) -> Host:
    """Create a host of the conditions of a run."""
    config = SimulationConfig(get_dialect(run.info.dialect))
    return Host(scene, config=config, seed=seed)


def calls_in(events: Sequence[RunEvent]) -> list[RunEvent]:
    """Return the calls, which are in bags as they are."""
    return [event for event in events if event.is_call]


@functools.lru_cache(2)
def all_messages(folder: Path) -> list[tuple[str, Any]]:
    """Return all messages of a recording that does not change, with their topics."""
    with AnyReader([folder]) as reader:
        return [
            (connection.topic, reader.deserialize(data, connection.msgtype))
            for connection, _, data in reader.messages()
        ]


def messages_of(folder: Path, *topics: str) -> list[Any]:
    """Return the messages of topics, in order; see ``all_messages``."""
    return [message for topic, message in all_messages(folder) if topic in topics]
