"""A host before its simulation has begun: clients are greeted, and robots wait."""

import pytest

from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.simulation.simulation import Simulation

INIT = b"INIT {ClassName USARBot.P3AT} {Name R1} {Start RobotStart1}\r\n"
STARTS = b"GETSTARTPOSES\r\n"


@pytest.fixture
def host(empty_room: Scene) -> Host:
    return Host(empty_room, begins=False)


@pytest.fixture
def simulation(host: Host) -> Simulation:
    return host.make_simulation()


def connected(host: Host) -> int:
    number = host.connect()
    assert host.take(number).startswith(b"NFO {Gametype")
    return number


def test_clients_are_greeted_and_questions_answered(host: Host) -> None:
    number = connected(host)
    assert host.receive(number, STARTS) == []
    assert host.take(number).startswith(b"NFO {StartPoses 3}")
    (diagnostic,) = host.receive(number, b"DRIVE {Left 1} {Right 1}\r\n")
    assert "without a robot" in diagnostic.text
    assert not host.has_begun


def test_questions_are_answered_however_many_there_are(host: Host) -> None:
    number = connected(host)
    questions = 200
    host.receive(number, STARTS * questions)
    answers = host.take(number)
    for _ in range(questions):
        assert host.step() == []
        answers += host.take(number)
    assert answers.count(b"StartPoses") == questions


def test_robot_waits_for_the_simulation(host: Host, simulation: Simulation) -> None:
    number = connected(host)
    assert host.receive(number, INIT) == []
    for _ in range(10):
        assert host.step() == []
        assert (host.is_busy(number), host.has_robot(number)) == (True, False)
    host.begin(simulation)
    host.step()
    assert (host.is_busy(number), host.has_robot(number)) == (False, True)
    assert host.simulation is simulation


def test_client_that_waits_for_its_robot_can_leave(
    host: Host, simulation: Simulation
) -> None:
    number = connected(host)
    host.receive(number, INIT)
    host.disconnect(number)
    host.begin(simulation)
    host.step()
    assert simulation.vehicles == ()


def test_simulated_time_begins_with_the_simulation(
    host: Host, simulation: Simulation, empty_room: Scene
) -> None:
    late = connected(host)
    host.receive(late, STARTS)
    for _ in range(100):
        host.step()
    host.begin(simulation)
    host.take(late)
    begun = Host(empty_room)
    assert connected(begun) == late
    for each in (host, begun):
        each.receive(late, INIT)
    for _ in range(30):
        host.step()
        begun.step()
        assert host.take(late) == begun.take(late)
    assert simulation.time == begun.simulation.time == 0.3


def test_scene_and_configuration_are_known_before(
    host: Host, empty_room: Scene, simulation: Simulation
) -> None:
    assert host.scene is empty_room
    assert host.config is simulation.config
