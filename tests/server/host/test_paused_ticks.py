"""Ticks in which no time passes: commands are executed, and nothing is read."""

from radarsim.scene.scene import Scene
from radarsim.server.host import Host

INIT = b"INIT {ClassName P3AT} {Name R1} {Start RobotStart1}\r\n"
ASK = b"GETCONF {Type RangeScanner}\r\nGETGEO {Type Robot}\r\n"


def test_robots_are_spawned_and_answered_and_read_nothing(empty_room: Scene) -> None:
    host = Host(empty_room)
    number = host.connect()
    host.take(number)
    host.receive(number, INIT + ASK)
    for _ in range(100):
        host.step(passes=False)
    assert host.simulation.ticks == 0
    lines = host.take(number).splitlines()
    assert [line.split()[0] for line in lines] == [b"CONF", b"GEO"]


def test_watchers_get_the_answers_of_a_paused_robot(empty_room: Scene) -> None:
    host = Host(empty_room)
    watcher, driver = host.connect(), host.connect()
    host.receive(watcher, b"WATCH {Robots All} {Clock true}\r\n")
    host.receive(driver, INIT)
    host.step(passes=False)
    host.take(watcher)
    host.receive(driver, b"GETCONF {Type RangeScanner}\r\n")
    host.step(passes=False)
    (line,) = host.take(watcher).splitlines()
    assert line.startswith(b"SEE {Robot R1} CONF {Type RangeScanner}")


def test_a_pause_changes_nothing_of_what_comes_after_it(empty_room: Scene) -> None:
    def run(pause: int) -> bytes:
        host = Host(empty_room, seed=3)
        number = host.connect()
        host.receive(number, INIT)
        for _ in range(50):
            host.step()
        host.receive(number, b"DRIVE {Left 3} {Right 2}\r\n")
        for _ in range(pause):
            host.step(passes=False)
        for _ in range(50):
            host.step()
        return host.take(number)

    assert run(0) == run(70)
