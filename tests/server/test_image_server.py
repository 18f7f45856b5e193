"""The image server with viewers, written from the protocol alone."""

import asyncio
import io
import logging
import socket
import struct
from collections.abc import AsyncIterator
from collections.abc import Set as AbstractSet
from contextlib import asynccontextmanager, suppress

import numpy as np
import pytest
from peers import DEADLINE, Peer, wait_until
from PIL import Image

from radarsim.errors import PortUnavailable, ServerError
from radarsim.geometry import Pose2
from radarsim.presets.robots import load_robot
from radarsim.protocol.dialect import UDK
from radarsim.protocol.images import ImageType, Region
from radarsim.scene.scene import Scene
from radarsim.server.camera import Renderer, encode
from radarsim.server.image_server import ImageServer, PictureProcess
from radarsim.server.views import Tiles, View, tiles_of
from radarsim.simulation.config import SimulationConfig
from radarsim.simulation.simulation import Simulation


class InlinePictures(PictureProcess):
    """Draws in the process of the server: it is ready at once."""

    def __init__(self, simulation: Simulation) -> None:
        self.renderer = Renderer(simulation.scene)
        self.image_type: ImageType = simulation.config.dialect.image_type

    async def start(self) -> None: ...

    async def draw(
        self, tiles: Tiles, regions: AbstractSet[Region]
    ) -> dict[Region, bytes]:
        pixels = self.renderer.render_tiles(tiles)
        return {each: encode(pixels, each, self.image_type) for each in regions}

    async def stop(self) -> None: ...


class NeverReady(InlinePictures):
    """Is being started for ever."""

    def __init__(self) -> None: ...

    async def start(self) -> None:
        await asyncio.Event().wait()


class NoPictures(InlinePictures):
    """Cannot draw."""

    async def draw(
        self, tiles: Tiles, regions: AbstractSet[Region]
    ) -> dict[Region, bytes]:
        raise ServerError(f"the brush is lost, for {len(regions)} of {tiles}")


class Viewer(Peer):
    """A viewer with a socket of its own."""

    async def picture(self) -> tuple[int, bytes]:
        """Return type and data of the next picture."""
        async with asyncio.timeout(DEADLINE):
            header = await self.reader.readexactly(5)
            image_type, length = struct.unpack(">BI", header)
            return image_type, await self.reader.readexactly(length)

    async def ask(self) -> tuple[int, int]:
        """Ask for a picture, and return its size."""
        await self.send(b"OK")
        return await self.size()

    async def size(self) -> tuple[int, int]:
        """Return width and height of the next picture, which is a JPEG."""
        image_type, data = await self.picture()
        assert image_type == 2
        with Image.open(io.BytesIO(data)) as image:
            assert image.format == "JPEG"
            return image.size


class RunningServer:
    """A running image server and its viewers."""

    def __init__(self, simulation: Simulation, server: ImageServer) -> None:
        self.simulation = simulation
        self.server = server
        self.viewers: list[Viewer] = []

    async def viewer(self, *, small: bool = False) -> Viewer:
        self.viewers.append(await Viewer.connect(self.server.address, small=small))
        return self.viewers[-1]


@asynccontextmanager
async def serving(
    simulation: Simulation, pictures: PictureProcess | None = None
) -> AsyncIterator[RunningServer]:
    pictures = pictures or InlinePictures(simulation)
    server = ImageServer(simulation, pictures, port=0)
    await server.start()
    running = RunningServer(simulation, server)
    try:
        yield running
    finally:
        for viewer in running.viewers:
            viewer.writer.close()
        await server.stop()
        for viewer in running.viewers:
            await viewer.close()


@pytest.fixture
async def running(empty_room: Scene) -> AsyncIterator[RunningServer]:
    async with serving(Simulation(empty_room)) as server:
        yield server


async def test_requests_are_answered_in_order(running: RunningServer) -> None:
    viewer = await running.viewer()
    part = b"U" + struct.pack(">4I", 100, 20, 30, 40)
    await viewer.send(b"OK" + part + b"OK\r\n" + part)
    sizes = [await viewer.size() for _ in range(4)]
    assert sizes == [(160, 120), (30, 40), (160, 120), (30, 40)]
    assert await viewer.ask() == (160, 120)


async def test_in_the_dialect_udk_pictures_are_those_of_the_renderer_byte_by_byte(
    empty_room: Scene,
) -> None:
    simulation = Simulation(empty_room, config=SimulationConfig(UDK))
    simulation.spawn("R1", load_robot("P3AT"), Pose2(1.0, 2.0, 0.5))
    async with serving(simulation) as running:
        viewer = await running.viewer()
        await viewer.send(b"OK")
        image_type, data = await viewer.picture()
    assert image_type == 0
    assert struct.unpack(">2H", data[:4]) == (160, 120)
    pixels = np.frombuffer(data[4:], np.uint8).reshape(120, 160, 3)[..., ::-1]
    assert (pixels == Renderer(empty_room).render(View.of(simulation))).all()


async def test_picture_follows_the_robot_and_its_leaving(
    running: RunningServer,
) -> None:
    viewer = await running.viewer()
    simulation = running.simulation

    async def seen() -> bytes:
        await viewer.send(b"OK")
        return (await viewer.picture())[1]

    from_start = await seen()
    robot = simulation.spawn("R1", load_robot("P3AT"), Pose2(3.0, 3.0, 1.0))
    assert robot is not None
    from_robot = await seen()
    assert from_robot != from_start
    assert await seen() == from_robot
    simulation.remove(robot)
    assert await seen() == from_start


async def test_each_viewer_sees_a_robot_of_its_own_and_what_it_zooms(
    empty_room: Scene,
) -> None:
    simulation = Simulation(empty_room, config=SimulationConfig(UDK))
    robots = [
        simulation.spawn(name, load_robot("P3AT"), Pose2(x, 2.0, x))
        for name, x in (("R1", 1.0), ("R2", 3.0))
    ]
    assert robots[1] is not None
    robots[1].address = "127.0.0.1"
    renderer = Renderer(empty_room)

    async def seen(viewer: Viewer) -> bytes:
        await viewer.send(b"OK")
        return (await viewer.picture())[1][4:]

    def view_of(number: int) -> bytes:
        pixels = renderer.render_tiles(tiles_of(simulation, (number, None)))
        return pixels[..., ::-1].tobytes()

    async with serving(simulation) as running:
        first, second = await running.viewer(), await running.viewer()
        assert await seen(first) == await seen(second) == view_of(2)
        robots[1].address = "10.0.0.2"
        robots[1].zoom(robots[1].cameras[0], 30.0)
        assert await seen(first) == view_of(2)
        assert await seen(second) == view_of(1)


async def test_viewer_that_says_nothing_gets_one_picture(
    running: RunningServer,
) -> None:
    viewer = await running.viewer()
    assert await viewer.size() == (160, 120)
    assert await viewer.ask() == (160, 120)


async def test_viewer_that_asks_at_once_gets_no_picture_unasked(
    running: RunningServer,
) -> None:
    viewer = await running.viewer()
    await viewer.send(b"OK")
    await viewer.picture()
    viewer.writer.write_eof()
    silent = await running.viewer()
    await silent.picture()  # more than a second later
    assert await viewer.rest() == b""


async def test_viewer_that_closes_its_side_gets_its_last_picture(
    running: RunningServer,
) -> None:
    viewer = await running.viewer()
    await viewer.send(b"OKOK")
    viewer.writer.write_eof()
    assert await viewer.size() == (160, 120)
    assert await viewer.size() == (160, 120)
    assert await viewer.rest() == b""


async def test_viewers_that_do_not_read_hold_up_nobody(running: RunningServer) -> None:
    deaf = [await running.viewer(small=True) for _ in range(5)]
    for viewer in deaf:
        await viewer.send(b"OK" * 5000)
    viewer = await running.viewer()
    for _ in range(5):
        assert await viewer.ask() == (160, 120)
    assert await deaf[0].size() == (160, 120)


async def test_slow_viewer_gets_a_new_picture_when_it_reads_again(
    empty_room: Scene,
) -> None:
    simulation = Simulation(empty_room, config=SimulationConfig(UDK))  # long pictures
    async with serving(simulation) as running:
        slow, other = await running.viewer(small=True), await running.viewer()
        await slow.send(b"OK" * 100)
        for _ in range(3):
            await other.send(b"OK")
            old = await other.picture()
        simulation.spawn("R1", load_robot("P3AT"), Pose2(3.0, 3.0, 1.0))
        await other.send(b"OK")
        new = await other.picture()
        assert new != old
        pictures = [await slow.picture()]
        while pictures[-1] == old:
            pictures.append(await slow.picture())
    assert pictures[-1] == new
    assert len(pictures) < 30  # what was under way when it did not read


@pytest.mark.parametrize(
    "garbage",
    [
        b"GET / HTTP/1.1\r\nHost: x\r\n\r\n",
        b"\x00\xff" * 50_000,
        b"O" * 100_000,  # half requests
        b"DRIVE {Left 1} {Right 1}\r\n" * 1000,
        b"U",
    ],
    ids=lambda garbage: garbage[:8].decode("latin-1"),
)
async def test_garbage_gets_no_picture_and_disturbs_nobody(
    running: RunningServer, garbage: bytes
) -> None:
    noisy, viewer = await running.viewer(), await running.viewer()
    await noisy.send(garbage)
    assert await viewer.ask() == (160, 120)
    noisy.writer.write_eof()
    assert await noisy.rest() == b""


async def test_viewers_that_leave_while_they_wait_are_forgotten(
    running: RunningServer, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "radarsim.server")
    for _ in range(5):
        viewer = await running.viewer()
        await viewer.send(b"OKOK")
        viewer.reset()
    viewer = await running.viewer()
    assert await viewer.ask() == (160, 120)
    await wait_until(lambda: caplog.text.count("viewer disconnected") == 5)


@pytest.mark.parametrize(
    ("sent", "logged"),
    [
        (b"OK", "viewer disconnected"),
        (b"OK" * 1_000_000, "closed: too many requests"),
    ],
    ids=["one request", "flood"],
)
async def test_viewers_that_leave_before_there_are_pictures_are_forgotten(
    empty_room: Scene, caplog: pytest.LogCaptureFixture, sent: bytes, logged: str
) -> None:
    """What they have sent waits unread, and hides that they have gone."""
    caplog.set_level(logging.INFO, "radarsim.server")
    server = ImageServer(Simulation(empty_room), NeverReady(), port=0)
    await server.start()
    _, writer = await asyncio.open_connection(*server.address)
    writer.write(sent)
    writer.close()
    await wait_until(lambda: logged in caplog.text)
    await server.stop()


async def test_few_open_files_permit_few_viewers(
    running: RunningServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "radarsim.server.peer_connections.raise_file_limit", lambda _: 64
    )
    viewers = [await running.viewer() for _ in range(4)]
    refused = await running.viewer()
    with suppress(ConnectionError):
        assert await refused.rest() == b""
    assert await viewers[-1].ask() == (160, 120)


async def test_viewers_beyond_the_limit_are_refused(running: RunningServer) -> None:
    viewers = [await running.viewer() for _ in range(64)]
    await viewers[-1].send(b"OK")
    await viewers[-1].picture()
    refused = await running.viewer()
    assert await refused.rest() == b""
    await viewers[0].close()
    again = await running.viewer()
    assert await again.ask() == (160, 120)


async def test_server_stops_with_viewers_connected(empty_room: Scene) -> None:
    async with serving(Simulation(empty_room)) as running:
        waiting, silent = await running.viewer(), await running.viewer()
        await waiting.send(b"OK")
        await running.server.stop()
        for viewer in (waiting, silent):
            await viewer.rest()
        with pytest.raises(ConnectionRefusedError):
            await running.viewer()


async def test_taken_port_is_an_error_that_names_it(empty_room: Scene) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        simulation = Simulation(empty_room)
        server = ImageServer(simulation, InlinePictures(simulation), port=port)
        with pytest.raises(PortUnavailable, match=f"127.0.0.1:{port}") as caught:
            await server.start()
        await server.stop()
    assert caught.value.port == port


async def test_without_pictures_the_port_closes_and_the_log_says_why(
    empty_room: Scene, caplog: pytest.LogCaptureFixture
) -> None:
    simulation = Simulation(empty_room)
    async with serving(simulation, NoPictures(simulation)) as running:
        viewer = await running.viewer()
        await viewer.send(b"OK")
        assert await viewer.rest() == b""
        with pytest.raises(ConnectionRefusedError):
            await running.viewer()
    assert "the brush is lost" in caplog.text
