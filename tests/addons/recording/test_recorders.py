"""What recorders report of a host, which does nothing else for it, and of lines."""

import pytest
import recorded_runs

from radarsim.addons.recording.recorders import (
    EventType,
    HostRecorder,
    RunEvent,
    WireRecorder,
)
from radarsim.addons.recording.replay import repeat_run
from radarsim.scene.scene import Scene
from radarsim.server.host import Host

INIT = b"INIT {ClassName P3AT} {Name R1} {Start RobotStart1}\r\n"
SETTING = (
    b"SET {Type RangeScanner} {Name lms200} {Opcode SETTING} {Params max_range=5}\r\n"
)


def events_of(scene: Scene, *received: bytes) -> list[RunEvent]:
    """Return the events of one client that sends something in each of some ticks."""
    events: list[RunEvent] = []
    host = Host(scene, observers=[HostRecorder(events.append)])
    client = host.connect()
    for data in received:
        host.receive(client, data)
        for _ in range(120):  # who replaces its robot has to wait a second
            host.step()
        host.take(client)
    return events


def described(events: list[RunEvent]) -> list[str]:
    return [e.data.decode() for e in events if e.type is EventType.ROBOT]


def test_ticks_before_the_beginning_are_counted(foliage_room: Scene) -> None:
    run = recorded_runs.run_two_clients(foliage_room, ticks=1)
    waits = [call.client for call in run.calls if call.type is EventType.WAIT]
    assert waits == [3, 1]  # before the first command, and before it begins
    kinds = [call.type for call in run.calls]
    assert kinds[0] is EventType.BEGIN
    assert run.calls[-1] == RunEvent(EventType.END, 2)


def test_takes_of_nothing_are_no_calls(foliage_room: Scene) -> None:
    events: list[RunEvent] = []
    host = Host(foliage_room, observers=[HostRecorder(events.append)])
    client = host.connect()
    assert host.take(client)
    assert not host.take(client)
    assert [call.type for call in recorded_runs.calls_in(events)].count(
        EventType.TAKE
    ) == 1


def test_robot_is_described_once(foliage_room: Scene) -> None:
    (text,) = described(events_of(foliage_room, INIT, b"DRIVE {Left 1}\r\n"))
    name, *lines = text.split("\r\n")
    assert name == "R1"
    assert [line.split()[0] for line in lines if line] == ["GEO", "CONF"] * 3
    assert "{Name lms200}" in text
    assert "{Name InsTest" in text


@pytest.mark.parametrize("change", [SETTING, INIT.replace(b"R1", b"R2")])
def test_changed_robot_is_described_again(foliage_room: Scene, change: bytes) -> None:
    texts = described(events_of(foliage_room, INIT, change))
    assert len(texts) == 2
    assert texts[0] != texts[1]


def test_robot_of_a_command_that_waits_is_described(foliage_room: Scene) -> None:
    many = b"GETSTARTPOSES\r\n" * 40
    texts = described(events_of(foliage_room, many + INIT, b"", b"", b""))
    assert len(texts) == 1


def test_a_run_that_was_paused_is_repeated_to_the_byte(foliage_room: Scene) -> None:
    events: list[RunEvent] = []
    recorder = HostRecorder(events.append)
    host = Host(foliage_room, observers=[recorder])
    number = host.connect()
    host.receive(number, b"INIT {ClassName P3AT} {Start RobotStart1}\r\n")
    # More commands than a tick has time for, so that some wait in the pause.
    host.receive(number, 45 * b"GETCONF {Type RangeScanner}\r\n")
    for tick in range(60):
        host.step(passes=tick < 1 or tick > 20)
        host.take(number)
    assert EventType.WAIT in [event.type for event in events]
    calls = recorded_runs.calls_in(events)
    repeated = Host(foliage_room)
    result = repeat_run(repeated, calls)
    assert not result.difference
    assert repeated.simulation.ticks == host.simulation.ticks


@pytest.mark.parametrize(
    "conf",
    [
        "CONF {Type GroundVehicle} {Name P3AT} {MaxSpeed 8.17}",
        "CONF {Name P3AT} {Type GroundVehicle} {MaxSpeed 1.2999}",
    ],
    ids=["compat", "udk"],
)
def test_configuration_of_a_robot_is_kept_once_whatever_comes_first(conf: str) -> None:
    events: list[RunEvent] = []
    recorder = WireRecorder(events.append)
    recorder.begin(1, "R1")
    for time in (0.1, 0.2):
        recorder.received(1, f"STA {{Time {time}}}\r\n{conf}\r\n".encode())
    recorded = [each.data.decode() for each in events if each.type is EventType.ROBOT]
    assert recorded == ["R1\r\n", f"R1\r\n{conf}\r\n"]
