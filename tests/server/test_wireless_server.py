"""The wireless server: programs of robots that register, ask, and talk through it."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import TypeAlias

import pytest
from peers import DEADLINE, Peer

from radarsim.errors import ServerError
from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.robots.obstacles import Obstacles
from radarsim.scene.scene import Scene
from radarsim.server import wireless_server
from radarsim.server.wireless_server import WirelessServer
from radarsim.simulation.simulation import Simulation

NEAR, FAR = Pose2(-4, 0), Pose2(8, 3)  # of R1, the far one behind eight walls


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(wireless_server, "LOOK_INTERVAL", 0.01)
    monkeypatch.setattr(wireless_server, "REST", 0.001)


Streams: TypeAlias = tuple[asyncio.StreamReader, asyncio.StreamWriter]


class Program(Peer):
    """A robot's program: it asks the server, and listens on a port of its own."""

    def __init__(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        super().__init__(reader, writer)
        self.port = 0
        self.calls: asyncio.Queue[Streams] = asyncio.Queue()
        self.listener: asyncio.Server | None = None
        self._writers = [writer]

    async def listen(self) -> None:
        async def take(r: asyncio.StreamReader, w: asyncio.StreamWriter) -> None:
            self._writers.append(w)
            await self.calls.put((r, w))

        self.listener = await asyncio.start_server(take, "127.0.0.1", 0)
        self.port = self.listener.sockets[0].getsockname()[1]

    async def ask(self, line: str) -> str:
        self.writer.write(f"{line}\r\n".encode())
        return (await self.line()).decode().removesuffix("\r\n")

    async def port_of(self, robot: str) -> int:
        reply = await self.ask(f"DNS {{Robot {robot}}}")
        return int(reply.rpartition("{Port ")[2].removesuffix("}"))

    async def call(self, robot: str, address: str = "127.0.0.1") -> Streams:
        return await self.connect_to(await self.port_of(robot), address)

    async def connect_to(self, port: int, address: str = "127.0.0.1") -> Streams:
        reader, writer = await asyncio.open_connection(address, port)
        self._writers.append(writer)
        return reader, writer

    async def connect_when_open(self, port: int) -> Streams:
        """Try until somebody listens."""
        async with asyncio.timeout(DEADLINE):
            while True:
                with suppress(ConnectionError):
                    return await self.connect_to(port)
                await asyncio.sleep(0.005)

    async def connect_until_refused(self, port: int) -> None:
        """Try until nobody listens any more."""
        async with asyncio.timeout(DEADLINE):
            with suppress(ConnectionRefusedError):
                while True:
                    # Reset if the port is closed before it has accepted.
                    with suppress(ConnectionResetError):
                        # Closed each time: many at once would use up open files.
                        _, writer = await asyncio.open_connection("127.0.0.1", port)
                        writer.close()
                        await writer.wait_closed()
                    await asyncio.sleep(0.005)

    async def next_call(self) -> Streams:
        async with asyncio.timeout(DEADLINE):
            return await self.calls.get()

    async def close(self) -> None:
        if self.listener is not None:
            self.listener.close()
        for writer in self._writers:
            writer.close()
            with suppress(ConnectionError):
                await writer.wait_closed()


@asynccontextmanager
async def program(server: WirelessServer, name: str = "") -> AsyncIterator[Program]:
    made = await Program.connect(server.address)
    if name:
        await made.listen()
        reply = await made.ask(f"INIT {{Robot {name}}} {{Port {made.port}}}")
        assert reply == "INITREPLY {Status OK}"
    yield made
    await made.close()


@pytest.fixture
def simulation(empty_room: Scene) -> Simulation:
    scene = empty_room
    for number in range(8):
        box = {"box": [0.05, 12, 3], "position": [3 + number / 4, 0, 1.5]}
        scene = scene.with_object(f"wall{number}", material="concrete", **box)
    made = Simulation(scene)
    for name, pose in (("R1", Pose2(0, 0)), ("R2", NEAR), ("R3", FAR)):
        made.spawn(name, load_robot("P3AT"), pose)
    return made


@pytest.fixture
async def server(simulation: Simulation) -> AsyncIterator[WirelessServer]:
    made = WirelessServer(simulation, port=0)
    await made.start()
    yield made
    await made.stop()


@pytest.fixture
async def one(server: WirelessServer) -> AsyncIterator[Program]:
    async with program(server, "R1") as made:
        yield made


@pytest.fixture
async def two(server: WirelessServer) -> AsyncIterator[Program]:
    async with program(server, "R2") as made:
        yield made


def move(simulation: Simulation, name: str, pose: Pose2) -> None:
    (robot,) = [v.robot for v in simulation.vehicles if v.robot.name == name]
    robot.fleet.place(robot, pose, Obstacles())


async def rest_of(reader: asyncio.StreamReader) -> bytes:
    """Return what comes until the connection is closed."""
    async with asyncio.timeout(DEADLINE):
        with suppress(ConnectionError):
            return await reader.read()
    return b""


async def test_requests_are_answered_as_by_the_original(server: WirelessServer) -> None:
    async with program(server) as one:
        ask = one.ask
        first = "ERROR {Reason Must.Use.INIT.Method.First}"
        assert await ask("GETSS {Robot R2}") == first
        assert await ask("{") == first
        ports = "ERROR {Reason Ports.List.Must.Be.Integer}"
        assert await ask("INIT {Robot R1} {Port a}") == ports
        nameless = "ERROR {Reason Robot.Name.Must.Not.Be.Empty}"
        assert await ask("INIT {Port 7000}") == nameless
        assert await ask("INIT {Robot R1} {Port 7000}") == "INITREPLY {Status OK}"
        once = "ERROR {Reason Method.Unknown.Or.Can.INIT.only.once}"
        assert await ask("INIT {Robot R1} {Port 7000}") == once
        async with program(server) as two, program(server, "R2"):
            taken = "ERROR {Reason Robot.Alread.Exists}"
            assert await two.ask("INIT {Robot R1}") == taken
            assert await two.ask("INIT {Robot Silent}") == "INITREPLY {Status OK}"
            strength = "SS {Robot R2} {Strength -52.6803}"  # 4 m away
            assert await ask("GETSS {Robot R2}") == strength
            assert await ask("GETSS {Robot R1}") == (
                "SS {Robot R1} {Strength INF} {Error SS.To.Self}"
            )
            assert await ask("GETSS {Robot R9}") == (
                "SS {Robot R9} {Strength NaN} {Error Robot.Does.Not.Exist}"
            )
            assert await ask("GETSS {Robot Silent}") == (
                "SS {Robot Silent} {Strength NaN} {Error Model.Returned.NaN}"
            )
            assert await ask("GETSS") == nameless
            assert await ask("DNS {Robot R2} {Port -1}") == (
                "ERROR {Reason Port.Must.Be.Integer}"
            )
            for name in ("R1", "R9"):
                error = "{Port -1} {Error NoSuchRobot}"
                assert await ask(f"DNS {{Robot {name}}}") == (
                    f"DNSREPLY {{Robot {name}}} {error}"
                )
            for request in ("{Robot R2} {Port 1}", "{Robot Silent}"):
                reply = await ask(f"DNS {request}")
                assert reply.endswith("{Port -1} {Error RobotDoesNotListenOnThisPort}")
            assert await ask("REVERSEDNS {Port 7}") == (
                "REVERSEDNSREPLY {Port 7} {Error UnknownOrIllegalPort}"
            )


async def test_robots_talk_in_both_directions(one: Program, two: Program) -> None:
    reader, writer = await one.call("R2")
    writer.write(b"hello")
    his_reader, his_writer = await two.next_call()
    async with asyncio.timeout(DEADLINE):
        assert await his_reader.readexactly(5) == b"hello"
    port = his_writer.get_extra_info("peername")[1]
    reply = f"REVERSEDNSREPLY {{Port {port}}} {{Robot R1}}"
    assert await two.ask(f"REVERSEDNS {{Port {port}}}") == reply
    # More than all buffers hold, to somebody who begins to read late.
    data = bytes(range(256)) * 40_000
    his_writer.write(data)
    await asyncio.sleep(0.1)
    async with asyncio.timeout(DEADLINE):
        assert await reader.readexactly(len(data)) == data
    writer.write(b"bye")
    writer.close()
    async with asyncio.timeout(DEADLINE):
        assert await his_reader.read() == b"bye"
    # The same port again, from the same robot to the same port.
    assert (await one.ask("DNS {Robot R2}")) == (
        await one.ask(f"DNS {{Robot R2}} {{Port {two.port}}}")
    )


@pytest.mark.asyncio
async def test_robots_are_reached_at_all_addresses(simulation: Simulation) -> None:
    server = WirelessServer(simulation, port=0)
    try:
        await server.start("127.0.0.1,::1")
    except ServerError:
        pytest.skip("no IPv6 here")
    async with program(server, "R1") as one, program(server, "R2") as two:
        for address in ("127.0.0.1", "::1"):
            reader, writer = await one.call("R2", address)
            writer.write(b"hello")
            his_reader, _ = await two.next_call()
            async with asyncio.timeout(DEADLINE):
                assert await his_reader.readexactly(5) == b"hello"
        move(simulation, "R2", FAR)
        assert await rest_of(reader) == b""
    await server.stop()


@pytest.mark.asyncio
async def test_who_is_too_far_is_cut_off_and_comes_back(
    simulation: Simulation, one: Program, two: Program
) -> None:
    port = await one.port_of("R2")
    reader, writer = await one.connect_to(port)
    writer.write(b"x")
    his_reader, _ = await two.next_call()
    move(simulation, "R2", FAR)
    assert await rest_of(reader) == b""
    assert await rest_of(his_reader) == b"x"
    reply = await one.ask("GETSS {Robot R2}")
    assert float(reply.rpartition(" ")[2].removesuffix("}")) < -93
    with pytest.raises(ConnectionError):
        await one.call("R2")
    move(simulation, "R2", NEAR)
    _, writer = await one.connect_when_open(port)
    writer.write(b"again")
    his_reader, _ = await two.next_call()
    async with asyncio.timeout(DEADLINE):
        assert await his_reader.readexactly(5) == b"again"


async def test_who_has_left_the_simulation_is_closed(
    simulation: Simulation, one: Program, two: Program, server: WirelessServer
) -> None:
    async with program(server, "Later"):
        port = await one.port_of("R2")
        reader, _ = await one.connect_to(port)
        move(simulation, "R2", FAR)
        assert await rest_of(reader) == b""  # it was seen
        move(simulation, "R2", NEAR)
        reader, _ = await one.connect_when_open(port)
        (robot,) = [v for v in simulation.vehicles if v.robot.name == "R2"]
        simulation.remove(robot)
        assert await rest_of(two.reader) == b""
        assert await rest_of(reader) == b""
        assert [*server.robots] == ["R1", "Later"]  # who is not there yet stays
        reply = await one.ask("DNS {Robot R2}")
        assert reply == "DNSREPLY {Robot R2} {Port -1} {Error NoSuchRobot}"


async def test_calls_that_nobody_takes_are_closed(
    one: Program, server: WirelessServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with program(server, "R2") as two:
        assert two.listener is not None
        two.listener.close()
        await two.listener.wait_closed()
        reader, _ = await one.call("R2")
        assert await rest_of(reader) == b""
        # Who goes while the other is being reached leaves nothing behind.
        _, writer = await one.call("R2")
        writer.transport.abort()
        monkeypatch.setattr(wireless_server, "MAX_LINKS", 0)
        port = await one.port_of("R2")
        reader, _ = await one.connect_to(port)
        assert await rest_of(reader) == b""
    async with asyncio.timeout(DEADLINE):
        with suppress(ConnectionError):
            while True:  # until its port is closed
                await one.connect_to(port)


async def test_ports_are_limited_and_may_be_taken(
    simulation: Simulation,
    one: Program,
    server: WirelessServer,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    none = "ERROR {Reason Could.Not.Allocate.Port}"
    async with program(server, "R2"), program(server, "R3") as three:
        port = await one.port_of("R3")
        other = await asyncio.start_server(lambda *_: None, "127.0.0.1", port)
        move(simulation, "R3", Pose2(-6, 2))
        await asyncio.sleep(0.05)
        other.close()
        await other.wait_closed()
        await one.connect_when_open(port)
        await three.next_call()
        monkeypatch.setattr(wireless_server, "MAX_RELAYS", 1)
        assert await one.ask("DNS {Robot R2}") == none
        monkeypatch.setattr(wireless_server, "MAX_RELAYS", 9)

        def refuse(*_: object) -> None:
            raise ServerError("no port")

        monkeypatch.setattr(wireless_server, "bind", refuse)
        assert await one.ask("DNS {Robot R2}") == none


async def test_a_long_line_closes_a_connection(
    one: Program, server: WirelessServer
) -> None:
    async with program(server) as two:
        two.writer.write(b"GETSS {Robot " + b"x" * 5000)
        assert await rest_of(two.reader) == b""
    assert (await one.ask("GETSS {Robot R1}")).startswith("SS {Robot R1}")


async def test_one_robot_too_many_is_refused(
    server: WirelessServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(wireless_server.WirelessClient, "MOST", 1)
    async with program(server, "R1"), program(server) as refused:
        assert await rest_of(refused.reader) == b""


async def test_a_reader_that_pauses_gets_each_answer_once(
    one: Program,
    server: WirelessServer,
) -> None:
    client = server.robots["R1"]
    names = [f"X{k}" for k in range(4)]
    lines = "".join(f"GETSS {{Robot {name}}}\r\n" for name in names).encode()
    await asyncio.sleep(0.1)  # no answer is due
    client.get_buffer(-1)[: len(lines)] = lines
    client.buffer_updated(len(lines))
    client.pause_writing()
    client.resume_writing()  # before the next answer is due
    replies = [(await one.line()).decode() for _ in names]
    assert [reply.split("}")[0] for reply in replies] == [
        f"SS {{Robot {name}" for name in names
    ]
    assert (await one.ask("GETSS {Robot R1}")).startswith("SS {Robot R1}")


async def test_robots_are_answered_in_turns(one: Program, two: Program) -> None:
    one.writer.write(b"GETSS {Robot R9}\r\n" * 60)
    assert "Robot.Does.Not.Exist" in await two.ask("GETSS {Robot R9}")
    answers = await one.reader.read(100_000)
    assert answers.count(b"\r\n") < 60
    for _ in range(60 - answers.count(b"\r\n")):
        assert await one.line()


async def test_requests_of_browsers_are_not_answered(server: WirelessServer) -> None:
    async with program(server) as page:
        page.writer.write(b"POST / HTTP/1.1\r\n\r\nINIT {Robot R1} {Port 22}\r\n")
        assert await rest_of(page.reader) == b""
        assert server.robots == {}


@pytest.mark.parametrize("limit", ["STALL_TIMEOUT", "CLOSE_GRACE"])
async def test_who_never_reads_holds_no_link(
    simulation: Simulation,
    one: Program,
    two: Program,
    monkeypatch: pytest.MonkeyPatch,
    limit: str,
) -> None:
    monkeypatch.setattr(wireless_server, limit, 0.05)
    monkeypatch.setattr(wireless_server, "MAX_LINKS", 1)
    _, writer = await one.call("R2")
    _, his_writer = await two.next_call()
    his_writer.transport.pause_reading()  # type: ignore[attr-defined]
    writer.write(bytes(30_000_000))
    if limit == "CLOSE_GRACE":
        move(simulation, "R2", FAR)
        await one.connect_until_refused(await one.port_of("R2"))
        move(simulation, "R2", NEAR)
    async with asyncio.timeout(DEADLINE):
        while two.calls.empty():  # while the old link counts, a new one is refused
            with suppress(ConnectionError):
                await one.call("R2")
            await asyncio.sleep(0.02)
    writer.transport.abort()
