"""Watchers get copies of what robots' clients are sent, and change no byte of it."""

import gc
import re
import tracemalloc
from collections.abc import Mapping, Sequence
from typing import Any

import pytest
from host_client import DIALECTS, HostClient
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.protocol.dialect import COMPAT, UDK, Dialect
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.server.host.spawning import SPAWN_COOLDOWN
from radarsim.server.host.watchers import MAX_WATCHERS
from radarsim.simulation.config import SimulationConfig

INIT = b"INIT {ClassName USARBot.P3AT} {Name R1} {Start RobotStart1}\r\n"
SECOND = b"INIT {ClassName P3AT_Compare} {Name R2} {Start RobotStart2}\r\n"
BYSTANDER = INIT.replace(b"R1", b"R2").replace(b"RobotStart1", b"RobotStart3")
WATCH_ALL = b"WATCH {Robots All}\r\n"
WITH_ECHOES = b"WATCH {Robots All} {Echoes true}\r\n"
ANSWER = b"NFO {Watching All} {Echoes None}\r\n"
ECHOES = b"SET {Type RangeScanner} {Opcode ECHOES} {Params true}\r\n"
ECHO = b"{Type Echoes}"
COMMANDS = (
    *(b"GETSTARTPOSES\r\n", b"GETGEO {Type Robot}\r\n", b"GETCONF {Type INS}\r\n"),
    *(b"DRIVE {Left 3} {Right 2,5}\r\n", b"DRIVE {Left -8} {Right 1}\r\n"),
    *(b"SET {Type RangeScanner} {Opcode SCAN}\r\n", b"FOO {\r\n"),
    *(ECHOES, ECHOES.replace(b"true", b"false")),
    b"SET {Type INS} {Opcode POSE} {Params 1,1,1,0,0,0}\r\n",
    *(SECOND, b"INIT {ClassName USARBot.P2DX} {Location 3 0 0}\r\n"),
)
SCRIPT = st.lists(  # data sent before a number of steps
    st.tuples(st.lists(st.sampled_from(COMMANDS), max_size=4), st.integers(1, 25)),
    max_size=6,
)
QUICK = settings(
    max_examples=15,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def step(ticks: int, *clients: HostClient) -> None:
    for _ in range(ticks):
        clients[0].host.step()
        for client in clients:
            client.read()


def lines_of(data: bytes) -> list[bytes]:
    return data.splitlines(keepends=True)


def seen(data: bytes, name: bytes = b"[^{}]*") -> bytes:
    """Return the lines of the robots of a name, without what precedes each."""
    found = [re.match(rb"SEE {Robot %b} (.*)" % name, x, re.S) for x in lines_of(data)]
    return b"".join(match[1] for match in found if match)


def without_echoes(data: bytes) -> bytes:
    return b"".join(line for line in lines_of(data) if ECHO not in line)


def news(data: bytes) -> list[bytes]:
    """Return the lines that report robots, and answers of other kinds."""
    lines = lines_of(data)
    return [x for x in lines if x.startswith(b"NFO") and b"{Watching" not in x]


def play(
    scene: Scene,
    script: Sequence[tuple[Sequence[bytes], int]],
    dialect: Dialect,
    watches: Sequence[bytes] = (),
) -> tuple[HostClient, list[HostClient]]:
    """Let a client with a robot play a script, watched by others that read."""
    host = Host(scene, config=SimulationConfig(dialect))
    client = HostClient(host)
    bystander = HostClient(host, BYSTANDER)
    watchers = [HostClient(host, watch) for watch in watches]
    client.send(INIT)
    for commands, ticks in script:
        client.send(b"".join(commands))
        step(ticks, client, bystander, *watchers)
    step(1, client, bystander, *watchers)
    client.writes += bystander.writes
    return client, watchers


@QUICK
@given(script=SCRIPT, udk=st.booleans())
def test_watcher_is_sent_exactly_the_bytes_of_the_watched_clients(
    foliage_room: Scene, script: list[tuple[list[bytes], int]], udk: bool
) -> None:
    dialect = UDK if udk else COMPAT
    both, (plain, asking) = play(
        foliage_room, script, dialect, (WATCH_ALL, WITH_ECHOES)
    )
    unwatched, _ = play(foliage_room, script, dialect)
    assert both.writes == unwatched.writes
    half = len(both.writes) // 2
    own, bystander = both.writes[:half], both.writes[half:]
    for write, other, copies in zip(own, bystander, plain.writes, strict=True):
        assert sorted(lines_of(seen(copies))) == sorted(lines_of(write + other))
        assert seen(copies) in (write + other, other + write)
    assert without_echoes(seen(asking.data)) == without_echoes(seen(plain.data))
    if any(b"RangeScanner" in write for write in bystander):
        assert ECHO in seen(asking.data)
        assert ECHO not in b"".join(bystander)


@DIALECTS
def test_echoes_for_a_watcher_are_those_that_the_client_could_ask_for(
    foliage_room: Scene, dialect: Dialect
) -> None:
    config = SimulationConfig(dialect)
    watched = HostClient(Host(foliage_room, config=config), INIT)
    asking = HostClient(Host(foliage_room, config=config), INIT, ECHOES)
    watcher = HostClient(watched.host, WITH_ECHOES)
    step(60, watched, watcher)
    step(60, asking)
    assert ECHO not in watched.data
    assert seen(watcher.data) == asking.data
    assert watched.data == without_echoes(asking.data)


def test_echoes_are_of_the_robots_that_are_named(foliage_room: Scene) -> None:
    host = Host(foliage_room)
    one, two = HostClient(host, INIT), HostClient(host, SECOND)
    watcher = HostClient(host, b"WATCH {Robots All} {Echoes r2}\r\n")
    leaving = HostClient(host, WITH_ECHOES)
    step(30, one, two, watcher)
    assert ECHO not in seen(watcher.data, b"R1")
    assert seen(watcher.data, b"R2").count(ECHO) > 20
    host.disconnect(leaving.number)
    watcher.writes.clear()
    step(30, one, two, watcher)
    assert seen(watcher.data, b"R2").count(ECHO) > 20
    assert watcher.send(WATCH_ALL) == []
    watcher.writes.clear()
    step(30, one, two, watcher)
    assert ECHO not in watcher.data


def test_client_and_watcher_both_ask_for_echoes_of_different_scanners(
    foliage_room: Scene,
) -> None:
    host = Host(foliage_room)
    client = HostClient(host, SECOND, ECHOES.replace(b"} {O", b"} {Name lms200} {O"))
    plain, asking = HostClient(host, WATCH_ALL), HostClient(host, WITH_ECHOES)
    step(30, client, plain, asking)
    assert seen(plain.data) == client.data
    assert b"{Name lms200} {Line" in client.data
    assert b"{Name Hokuyo} {Line" not in client.data
    assert b"{Name Hokuyo} {Line" in seen(asking.data)


@DIALECTS
def test_watcher_of_all_learns_which_robots_there_are(
    empty_room: Scene, dialect: Dialect
) -> None:
    host = Host(empty_room, config=SimulationConfig(dialect))
    first = HostClient(host, INIT)
    watcher = HostClient(host, WATCH_ALL)
    assert watcher.read() == ANSWER + b"NFO {Joined R1} {ClassName P3AT}\r\n"
    second = HostClient(host, SECOND)
    step(SPAWN_COOLDOWN, first, second, watcher)
    host.disconnect(first.number)
    second.send(INIT.replace(b"R1", b"R3"))
    step(1, second, watcher)
    assert news(watcher.data) == [
        b"NFO {Joined R1} {ClassName P3AT}\r\n",
        b"NFO {Joined R2} {ClassName P3AT_Compare}\r\n",
        b"NFO {Left R1}\r\n",
        b"NFO {Left R2}\r\n",
        b"NFO {Joined R3} {ClassName P3AT}\r\n",
    ]
    late = HostClient(host, WATCH_ALL)
    assert late.read() == ANSWER + b"NFO {Joined R3} {ClassName P3AT}\r\n"


def test_named_robots_are_watched_whenever_they_are_there(empty_room: Scene) -> None:
    host = Host(empty_room)
    watcher = HostClient(host, b"WATCH {Robots r1,R9}\r\n")
    one, two = HostClient(host, INIT), HostClient(host, SECOND)
    step(20, one, two, watcher)
    assert news(watcher.data) == []
    assert seen(watcher.data) == seen(watcher.data, b"R1") == one.data
    host.disconnect(one.number)
    again = HostClient(host, INIT)
    watcher.writes.clear()
    step(20, again, watcher)
    assert seen(watcher.data) == again.data != b""


def test_later_watch_replaces_the_former(empty_room: Scene) -> None:
    host = Host(empty_room)
    one, two = HostClient(host, INIT), HostClient(host, SECOND)
    watcher = HostClient(host, WATCH_ALL)
    step(20, one, two, watcher)
    for watch, names in (
        (b"R2", {b"R2"}),
        (b"R1,R2", {b"R1", b"R2"}),
        (b"None", set()),
    ):
        assert watcher.send(b"WATCH {Robots %b}\r\n" % watch) == []
        watcher.writes.clear()
        step(20, one, two, watcher)
        assert set(re.findall(rb"SEE {Robot (\w+)}", watcher.data)) == names
    host.disconnect(two.number)
    step(5, one, watcher)
    assert news(watcher.data) == []


def test_watcher_can_have_a_robot_and_watch_it(empty_room: Scene) -> None:
    host = Host(empty_room)
    both = HostClient(host, INIT, WATCH_ALL)
    alone = HostClient(Host(empty_room), INIT)
    step(30, both)
    step(30, alone)
    for write, own in zip(both.writes, alone.writes, strict=True):
        assert write.startswith(own)  # copies come last in a write
    copies = b"".join(x for x in lines_of(both.data) if x.startswith(b"SEE"))
    assert seen(copies) == alone.data


def test_names_read_as_on_the_wire(empty_room: Scene) -> None:
    host = Host(empty_room)
    init = b"INIT {ClassName P3AT} {Name %b} {Location %d,0,0}\r\n"
    clients = [
        HostClient(host, init % (b"Caf\xe9 \x07  2", -4)),
        HostClient(host, init % (b"<img src=x onerror=alert(1)>", 0)),
        HostClient(host, init % (b"Caf\xe8 \x08  2", 4)),
    ]
    watcher = HostClient(host, WATCH_ALL)
    joined = re.findall(rb"{Joined ([^}]*)}", watcher.read())
    assert joined == [b"Caf? ? 2", b"<img src=x onerror=alert(1)>", b"Caf? ? 2"]
    step(20, *clients, watcher)
    assert seen(watcher.data, re.escape(joined[1])) == clients[1].data
    assert watcher.send(b"WATCH {Robots Caf? ? 2}\r\n") == []
    watcher.writes.clear()
    step(20, *clients, watcher)
    assert set(re.findall(rb"SEE {Robot ([^}]*)}", watcher.data)) == {b"Caf? ? 2"}


@pytest.mark.parametrize(
    "line", [b"WATCH\r\n", b"WATCH {Robot All}\r\n", b"WATCH {Robots ,}\r\n"]
)
@pytest.mark.parametrize("init", [b"", INIT])
def test_wrong_watch_is_answered_and_watches_nothing(
    empty_room: Scene, line: bytes, init: bytes
) -> None:
    host = Host(empty_room)
    other = HostClient(host, SECOND)
    client = HostClient(host, *([init] if init else []))
    (kind,) = client.send(line)
    step(1, client)
    assert kind == "malformed WATCH"
    (error,) = news(client.data)
    assert error.startswith(b"NFO {Error ")
    step(20, client, other)
    assert b"SEE" not in client.data


def test_number_of_watchers_is_limited(empty_room: Scene) -> None:
    host = Host(empty_room)
    watchers = []
    for _ in range(MAX_WATCHERS):
        watchers.append(HostClient(host, WATCH_ALL))
        host.step()  # has only so much time for commands
    late = HostClient(host)
    assert late.send(WATCH_ALL) == ["watchers"]
    assert late.read().startswith(b"NFO {Error ")
    assert watchers[0].send(b"WATCH {Robots R1}\r\n") == []
    assert watchers[1].send(b"WATCH {Robots None}\r\n") == []
    assert late.send(WATCH_ALL) == []
    assert HostClient(host).send(b"WATCH {Robots None}\r\n") == []
    assert HostClient(host).send(WATCH_ALL) == ["watchers"]
    host.disconnect(watchers[2].number)
    assert HostClient(host).send(WATCH_ALL) == []


def test_watcher_that_does_not_read_loses_the_oldest_and_holds_up_nobody(
    foliage_room: Scene,
) -> None:
    host = Host(foliage_room)
    client = HostClient(host, SECOND, ECHOES)
    deaf, reader = (HostClient(host, WITH_ECHOES) for _ in range(2))
    while host.dropped_readings(deaf.number) == 0:
        step(100, client, reader)
        assert host.unsent_bytes(deaf.number) < 2**22 + 2**16
        assert not host.close_reason(deaf.number)
    assert seen(reader.data) == client.data
    assert host.dropped_readings(reader.number) == 0
    late = deaf.read()
    (joined,) = news(late)
    assert late.startswith(ANSWER.replace(b"Echoes None", b"Echoes All") + joined)
    assert len(late) > 2**20
    assert client.data.endswith(seen(late))
    lost = lines_of(client.data)[: -len(lines_of(seen(late)))]
    assert host.dropped_readings(deaf.number) == len(lost)
    assert lines_of(seen(late))[0].startswith(b"STA")  # of a tick all or nothing
    step(20, client, deaf)
    assert client.data.endswith(seen(deaf.data)[-5000:])


def test_memory_of_watchers_that_do_not_read_is_bounded(empty_room: Scene) -> None:
    host = Host(empty_room)
    client = HostClient(host)
    for _ in range(4):
        HostClient(host, WATCH_ALL)
    numbers = range(2, 6)
    for number in range(3):
        client.send(INIT.replace(b"R1", b"R%d" % number))
        for _ in range(SPAWN_COOLDOWN):
            host.step()
        host.take(client.number)
    gc.collect()
    tracemalloc.start()
    try:
        for _ in range(300):
            host.step()
            host.take(client.number)
        size, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    waiting = host.unsent_bytes(numbers[0])
    assert {host.unsent_bytes(number) for number in numbers} == {waiting}
    assert size < 2 * waiting + 2**18  # the watchers share the copies


def test_watcher_that_asks_again_and_again_without_reading_is_closed(
    empty_room: Scene,
) -> None:
    host = Host(empty_room)
    for number in range(8):
        place = b"{Location %d,0,0}" % (2 * number - 8)
        name = b"x" * 60 + b"%d" % number
        HostClient(host, b"INIT {ClassName P3AT} {Name %b} %b\r\n" % (name, place))
        host.step()
    watcher = HostClient(host)
    for _ in range(2000):
        watcher.send(WATCH_ALL)
        host.step()
        if host.close_reason(watcher.number):
            break
    assert host.close_reason(watcher.number)
    assert host.unsent_bytes(watcher.number) < 2**23
    host.disconnect(watcher.number)
    host.step()


def test_robot_without_a_client_is_not_watched(empty_room: Scene) -> None:
    host = Host(empty_room)
    assert host.simulation.spawn("R9", load_robot("P3AT"), Pose2(0.0, 0.0))
    watcher = HostClient(host, WATCH_ALL)
    step(30, watcher)
    assert watcher.data == ANSWER


@pytest.mark.parametrize(
    "scanner",
    [
        {"ray_choice": "together", "side_offset_uu": 30},
        {"range_noise": 0.1, "range_resolution": 0.3},
        {"return_mode": "strongest"},
    ],
)
def test_echoes_for_watchers_leave_the_scans_as_they_are(
    foliage_room: Scene, scanner: Mapping[str, Any]
) -> None:
    config = SimulationConfig(item_settings={"lms200": scanner})
    alone = HostClient(Host(foliage_room, config=config), INIT)
    watched = HostClient(Host(foliage_room, config=config), INIT)
    watcher = HostClient(watched.host, WITH_ECHOES)
    for client in (alone, watched):
        client.send(b"DRIVE {Left 3} {Right 2}\r\n")
    step(60, alone)
    step(60, watched, watcher)
    assert watched.data == alone.data
    assert ECHO in watcher.data


def test_robot_with_an_empty_battery_is_watched(empty_room: Scene) -> None:
    often = {"lms200": {"scan_rate_hz": 50}}  # there are ticks with nothing but scans
    host = Host(empty_room, config=SimulationConfig(UDK, item_settings=often))
    client = HostClient(host, INIT)
    watcher = HostClient(host, WITH_ECHOES)
    step(20, client, watcher)
    host.simulation.ticks += 120_000
    step(40, client, watcher)
    assert without_echoes(seen(watcher.data)) == client.data
    assert client.data.endswith(b"{RearSteer 0}\r\n")


@DIALECTS
def test_watcher_asks_about_the_robot_of_another(
    empty_room: Scene, dialect: Dialect
) -> None:
    host = Host(empty_room, config=SimulationConfig(dialect))
    client = HostClient(host, INIT)
    watcher = HostClient(host)
    for question in (b"GETGEO {Type RangeScanner}", b"GETCONF {Type Robot}"):
        client.writes.clear()
        watcher.writes.clear()
        client.send(question + b"\r\n")
        assert watcher.send(question + b" {Robot r1}\r\n") == []
        step(1, client, watcher)
        assert watcher.data == b"SEE {Robot R1} " + client.data
        assert client.data != b""
    client.send(b"SET {Type RangeScanner} {Opcode SETTING} {Params max_range=3}\r\n")
    watcher.send(b"GETCONF {Type RangeScanner} {Robot R1}\r\n")
    step(1, client, watcher)
    assert b"{MaxRange 3.0" in watcher.data


def test_robots_of_the_same_name_on_the_wire_both_answer(empty_room: Scene) -> None:
    host = Host(empty_room)
    HostClient(host, INIT.replace(b"R1", b"a,\xe9"))
    second = SECOND.replace(b"R2", b"a,\xe8").replace(b"_Compare", b"")
    HostClient(host, second)
    asker = HostClient(host)
    assert asker.send(b"GETGEO {Type Robot} {Robot A,\xe7}\r\n") == []
    one, two = lines_of(asker.read())
    assert one == two
    assert one.startswith(b"SEE {Robot a,?} GEO ")


@pytest.mark.parametrize(
    ("question", "kind"),
    [
        (b"GETGEO {Type Robot} {Robot R9}\r\n", "no robot"),
        (b"GETCONF {Type Gripper} {Robot R1}\r\n", "item type"),
        (b"GETGEO {Type INS} {Name x} {Robot R1}\r\n", "item name"),
        (b"GETGEO {Type Robot} {Robot ,}\r\n", "no robot"),
    ],
)
def test_question_about_what_is_not_there_is_answered(
    empty_room: Scene, question: bytes, kind: str
) -> None:
    host = Host(empty_room)
    HostClient(host, INIT)
    asker = HostClient(host)
    assert asker.send(question) == [kind]
    (error,) = news(asker.read())
    assert error.startswith(b"NFO {Error ")


def test_it_is_known_for_whom_only_lines_of_others_wait(empty_room: Scene) -> None:
    host = Host(empty_room)
    driver = HostClient(host, INIT)
    watcher = HostClient(host, WATCH_ALL)
    step(10, driver, watcher)
    host.step()
    assert host.only_watches(watcher.number)
    assert not host.only_watches(driver.number)
    watcher.send(b"GETSTARTPOSES\r\n")
    assert not host.only_watches(watcher.number)  # it waits for an answer
