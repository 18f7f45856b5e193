"""A client and a host in one process: waiting advances simulated time."""

import pytest

from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.host.lockstep import InProcessTransport
from radarsim.simulation.clock import TICK

INIT = b"INIT {ClassName USARBot.P3AT} {Start RobotStart1}\r\n"


def test_waiting_advances_simulated_time_until_there_is_data(empty_room: Scene) -> None:
    ticks: list[float] = []
    host = Host(empty_room)
    transport = InProcessTransport(
        host, after_tick=lambda: ticks.append(host.simulation.time)
    )
    assert transport.receive(1.0).startswith(b"NFO ")
    assert ticks == []
    transport.send(INIT)
    assert b"STA " in transport.receive(1.0)
    assert transport.time() == pytest.approx(len(ticks) * TICK)


def test_data_of_the_last_tick_of_a_wait_is_returned(empty_room: Scene) -> None:
    transport = InProcessTransport(Host(empty_room))
    transport.receive(1.0)
    transport.send(INIT)
    waits = 0
    while True:
        waits += 1
        try:
            assert transport.receive(TICK)
        except TimeoutError:
            assert waits < 200
        else:
            break


def test_wait_without_data_times_out(empty_room: Scene) -> None:
    transport = InProcessTransport(Host(empty_room))
    transport.receive(1.0)
    with pytest.raises(TimeoutError, match=r"0\.5 s of simulated time"):
        transport.receive(0.5)
    assert transport.time() == pytest.approx(0.5)


def test_closed_transport_refuses_to_send_and_receive(empty_room: Scene) -> None:
    transport = InProcessTransport(Host(empty_room))
    transport.close()
    transport.close()
    with pytest.raises(ConnectionError):
        transport.send(INIT)
    with pytest.raises(ConnectionError):
        transport.receive(1.0)


def test_newest_diagnostics_of_the_own_commands_are_kept(empty_room: Scene) -> None:
    host = Host(empty_room)
    transport, other = InProcessTransport(host), InProcessTransport(host)
    transport.send(b"GETGEO {Type Robot}\r\n" * 40)
    assert transport.receive(1.0).startswith(b"NFO ")
    with pytest.raises(TimeoutError):  # the rest of the commands waits for a tick
        transport.receive(0.5)
    assert transport.diagnostics == ["GETGEO without a robot, expected INIT"] * 10
    assert other.diagnostics == []
