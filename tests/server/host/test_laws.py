"""Properties of the host for any input, however it is split into packets."""

from itertools import pairwise

from host_client import HostClient
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from radarsim.protocol.dialect import UDK
from radarsim.scene.scene import Scene
from radarsim.server.host import Host
from radarsim.simulation.config import SimulationConfig

INITS = (
    b"INIT {ClassName USARBot.P3AT} {Name R1} {Start RobotStart1}\r\n",
    b"INIT {ClassName USARBot.P2DX} {Location 10.4 0 0}\n\r",
    b"INIT {ClassName P3AT_Compare} {Location 1e9,-1e9,7} {Rotation 0,0,1e9}\r\n",
    b"INIT {ClassName Nobody}\r\n",
)
COMMANDS = (
    *INITS,
    *(b"GETSTARTPOSES\r\n", b"GETGEO {Type Robot}\r\n", b"GETCONF {Type INS}\n"),
    *(b"DRIVE {Left 3} {Right 2,5}\r\n", b"DRIVE {Left -800} {Right 1}\r\n"),
    *(b"DRIVE {Left 90} {Right -90} {Normalized True}\r\n", b"DRIVE {Left 1}\r"),
    *(b"SET {Type RangeScanner} {Opcode SCAN}\r\n", b"DRIVE {Light true}\r\n"),
    b"SET {Type RangeScanner} {Opcode ECHOES} {Params true}\r\n",
    b"SET {Type RangeScanner} {Opcode ECHOES} {Params false}\r\n",
    b"SET {Type INS} {Opcode POSE} {Params 1e9,-1e9,1e9,1e9,-1e9,1e9}\r\n",
    *(b"SET {Type Encoder} {Opcode RESET}\r\n", b"SET {Type GPS} {Opcode RESET}\r\n"),
    b"SET {Type RangeScanner} {Opcode SETTING} {Params max_range=9}\r\n",
    b"SET {Type RangeScanner} {Opcode SETTING} {Params scan_rate_hz=30 fov_deg=-1}\r\n",
    b"GETGEO {Type Robot} {Robot r1}\r\n",
    *(b"WATCH {Robots All}\r\n", b"WATCH {Robots R1} {Echoes true}\r\n", b"WATCH\r\n"),
    *(b"FOO {", b"}\r\n", b"\r\n\r\n", b"{Name }", b"MISPKG {Link 1}\r\n", b"\xff\x00"),
)
SCRIPT = st.lists(  # data sent before a number of steps
    st.tuples(st.lists(st.sampled_from(COMMANDS), max_size=6), st.integers(1, 12)),
    max_size=8,
)
QUICK = settings(
    max_examples=20,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)

Script = list[tuple[list[bytes], int]]


def send(client: HostClient, data: bytes, cuts: list[int]) -> None:
    """Send data in pieces."""
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts), len(data)]
    for start, end in pairwise(edges):
        client.send(data[start:end])


def play(host: Host, script: Script, cuts: list[int]) -> list[bytes]:
    client = HostClient(host)
    for commands, ticks in script:
        send(client, b"".join(commands), cuts)
        client.read(ticks)
    return client.writes


@QUICK
@given(script=SCRIPT, seed=st.integers(0, 3))
def test_same_seed_and_input_give_the_same_output(
    foliage_room: Scene, script: Script, seed: int
) -> None:
    one = play(Host(foliage_room, seed=seed), script, [])
    assert play(Host(foliage_room, seed=seed), script, []) == one


@QUICK
@given(script=SCRIPT, cuts=st.lists(st.integers(0, 400), max_size=12))
@example(script=[([INITS[0], *COMMANDS[4:9], INITS[1]] * 3, 30)], cuts=[*range(300)])
@example(script=[([INITS[0], *([COMMANDS[7]] * 150), COMMANDS[4]], 9)], cuts=[2000])
def test_output_does_not_depend_on_how_the_input_is_split(
    empty_room: Scene, script: Script, cuts: list[int]
) -> None:
    whole = play(Host(empty_room), script, [])
    assert play(Host(empty_room), script, cuts) == whole


@QUICK
@given(script=SCRIPT)
def test_seed_changes_only_the_noise(empty_room: Scene, script: Script) -> None:
    one = play(Host(empty_room, seed=1), script, [])
    other = play(Host(empty_room, seed=2), script, [])
    # scans depend on the noise, and so does the number of echo lines
    echoes = b"{Type Echoes}"
    lines, others = (
        [w.count(b"\n") - w.count(echoes) for w in writes] for writes in (one, other)
    )
    assert lines == others
    assert [echoes in w for w in one] == [echoes in w for w in other]


@QUICK
@given(
    data=st.lists(
        st.one_of(
            st.binary(max_size=300),
            st.sampled_from(COMMANDS),
            st.text("{}LeftRight0123456789.,-+e \r\nDRIVEGTO", max_size=80).map(
                lambda text: text.encode("ascii")
            ),
        ),
        max_size=30,
    ),
    udk=st.booleans(),
)
def test_nothing_that_a_client_sends_raises(
    foliage_room: Scene, data: list[bytes], udk: bool
) -> None:
    host = Host(foliage_room, config=SimulationConfig(UDK) if udk else None)
    client = HostClient(host)
    for piece in data:
        client.send(piece)
        client.read(1)
    client.read(30)
    for write in client.writes:
        assert not write or write.endswith(b"\r\n")
        write.decode("ascii")
    host.disconnect(client.number)
    assert host.simulation.vehicles == ()


def _first_of_two(scene: Scene, second: bytes = b"") -> bytes:
    """Return what a robot reads that faces west, with another behind it or none."""
    host = Host(scene, seed=5)
    first, other = HostClient(host), HostClient(host)
    first.send(
        b"INIT {ClassName P3AT} {Name A} {Location -8,0,0} {Rotation 0,0,3.14159}\r\n"
        b"DRIVE {Left 0.5} {Right 0.6}\r\n"
    )
    if second:
        other.send(second + b"DRIVE {Left -1} {Right 2}\r\n")
    return first.read(120)


def test_another_robot_changes_the_scans_in_sight_and_never_the_noise(
    foliage_room: Scene,
) -> None:
    alone = _first_of_two(foliage_room)
    assert b"RangeScanner" in alone
    for name in (b"B", b"A"):
        second = b"INIT {ClassName P3AT} {Name %s} {Location -4,2,0}\r\n" % name
        assert _first_of_two(foliage_room, second) == alone
    in_sight = b"INIT {ClassName P3AT} {Name B} {Location -9.2,0,0}\r\n"
    assert _first_of_two(foliage_room, in_sight) != alone
