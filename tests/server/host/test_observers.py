"""Observers see all calls of a host, and change nothing."""

from radarsim.scene.scene import Scene
from radarsim.server.host import Host, HostObserver
from radarsim.simulation.simulation import Simulation
from radarsim.simulation.vehicle import Vehicle

INIT = b"INIT {ClassName USARBot.P3AT} {Name R1} {Start RobotStart1}\r\n"


class Notes(HostObserver):
    """Notes all calls."""

    def __init__(self) -> None:
        self.calls: list[tuple[object, ...]] = []

    def begin(self, simulation: Simulation) -> None:
        self.calls.append(("begin", simulation.seed))

    def connect(self, client: int) -> None:
        self.calls.append(("connect", client))

    def disconnect(self, client: int) -> None:
        self.calls.append(("disconnect", client))

    def receive(self, client: int, data: bytes) -> None:
        self.calls.append(("receive", client, data))

    def execute(self, client: int, vehicle: Vehicle | None) -> None:
        name = None if vehicle is None else vehicle.robot.name
        self.calls.append(("execute", client, name))

    def step(self, *, passes: bool) -> None:  # noqa: ARG002
        self.calls.append(("step",))

    def take(self, client: int, data: bytes) -> None:
        self.calls.append(("take", client, data))

    def finish(self, client: int, data: bytes) -> None:
        self.calls.append(("finish", client, data))


def drive_a_robot(host: Host) -> list[bytes]:
    """Spawn a robot, send more commands than a tick takes, and read all bytes."""
    number = host.connect()
    taken = [host.take(number)]
    host.receive(number, INIT)
    host.receive(number, b"DRIVE {Left 1} {Right 1}\r\n" * 50)
    for _ in range(12):
        host.step()
        taken.append(host.take(number))
    taken.append(host.finish(number))
    host.disconnect(number)
    return taken


def test_observers_see_every_call_in_order(empty_room: Scene) -> None:
    first, second = Notes(), Notes()
    host = Host(empty_room, observers=[first])
    host.add_observer(second)
    taken = drive_a_robot(host)
    assert first.calls == second.calls
    kinds = [call[0] for call in first.calls]
    assert kinds[:3] == ["begin", "connect", "take"]
    assert kinds[-2:] == ["finish", "disconnect"]
    assert kinds.count("step") == 12
    received = [call[2] for call in first.calls if call[0] == "receive"]
    assert received[0] == INIT
    seen = [call[2] for call in first.calls if call[0] in ("take", "finish")]
    assert seen == [data for data in taken[:-1] if data] + taken[-1:]
    executed = [call[2] for call in first.calls if call[0] == "execute"]
    assert executed[0] == "R1"
    # Commands that have waited are executed in the ticks, which are reported as well.
    assert len(executed) > len(received)


def test_observers_change_no_byte(empty_room: Scene) -> None:
    assert drive_a_robot(Host(empty_room)) == drive_a_robot(
        Host(empty_room, observers=[Notes(), HostObserver()])
    )
