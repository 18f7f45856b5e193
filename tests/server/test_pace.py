"""Simulated time is paused, goes on by steps, and at other speeds."""

import asyncio

import pytest

from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.tcp_server import Pace, Server
from radarsim.simulation.clock import TICK

INIT = b"INIT {ClassName P3AT} {Name R1} {Start RobotStart1}\r\n"


def test_a_step_lets_its_duration_pass_and_no_more() -> None:
    pace = Pace()
    pace.change(step=0.1)
    assert pace.is_paused
    assert sum(pace.take_tick() for _ in range(50)) == 10
    pace.change(step=0.001)  # at least a tick
    pace.change(step=0.03)  # after the one before
    assert sum(pace.take_tick() for _ in range(50)) == 4
    pace.change(step=1.0)
    pace.change(paused=True)  # which ends it
    assert not pace.take_tick()


def test_ticks_without_time_are_as_frequent_at_any_speed() -> None:
    pace = Pace(speed=4)
    assert pace.interval == TICK / 4
    pace.change(paused=True)
    assert pace.interval == TICK
    pace.change(step=0.1)
    assert pace.interval == TICK / 4


@pytest.mark.parametrize("speed", [0, -1, float("nan"), float("inf")])
def test_a_speed_is_finite_and_above_0(speed: float) -> None:
    with pytest.raises(ValueError, match="expected a finite number above 0"):
        Pace().change(speed=speed)


def test_observers_see_changes_alone() -> None:
    pace, seen = Pace(), []
    pace.observers.append(lambda: seen.append((pace.speed, pace.is_paused)))
    pace.change(paused=False)
    pace.change(paused=True)
    pace.change(paused=True)
    pace.change(step=0.5)
    pace.change(speed=2)
    assert seen == [(1.0, True), (2, True)]


async def test_a_paused_server_answers_while_its_time_stands_still(
    empty_room: Scene,
) -> None:
    host = Host(empty_room)
    server = Server(host, speed=5)
    await server.start(port=0)
    server.pace.change(paused=True)
    ticks = host.simulation.ticks
    reader, writer = await asyncio.open_connection(*server.address)
    try:
        async with asyncio.timeout(60):
            await reader.readline()  # its greeting
            writer.write(INIT + b"GETCONF {Type RangeScanner}\r\n")
            assert (await reader.readline()).startswith(b"CONF {Type RangeScanner}")
            assert host.simulation.ticks == ticks
            server.pace.change(step=0.2)
            while b"{Name lms200}" not in (line := await reader.readline()):
                assert line
            assert b"SEN" in line
            await asyncio.sleep(0.1)
        assert host.simulation.ticks == ticks + 20
    finally:
        writer.close()
        await server.stop()
