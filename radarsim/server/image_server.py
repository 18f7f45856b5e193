"""An image server, which sends pictures from the cameras of robots to viewers.

Theory of operation
===================
While a viewer waits for a picture, the server renders one every ``INTERVAL`` with the
poses at that time. All waiting viewers of the same cameras get the same picture.

Pictures are rendered in a separate process instead of a thread. A rendering thread
would sometimes hold Python's global interpreter lock, and on a busy machine it could be
preempted while it holds the lock, which would delay ticks.

Rule 1: a viewer's next request is read after its last one is answered. Further data
waits in its socket, so no queue grows.
Rule 2: a viewer gets no picture while an earlier one is still being sent. Its request
waits and is answered with a newer picture, so a slow viewer misses pictures but delays
no other viewer.
Rule 3: after bytes without a request, a viewer is not read for ``READ_PAUSE``, so that
invalid data of any length takes little time from the simulation.
Rule 4: some viewers wait for a picture before they send anything. A viewer that sends
nothing for ``SILENCE`` after it has connected gets a picture without a request.
"""

from __future__ import annotations

import asyncio
import logging
import os
import sys
from collections.abc import Set as AbstractSet
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, Final

from radarsim.errors import ServerError
from radarsim.processes import worker_process
from radarsim.protocol.images import WHOLE, Region, RequestBuffer
from radarsim.server.peer_connections import PeerConnection, PeerServer
from radarsim.server.views import Shown, Tiles, assign, tiles_of

if TYPE_CHECKING:
    from radarsim.protocol.images import ImageType
    from radarsim.scene.scene import Scene
    from radarsim.server.camera import Renderer
    from radarsim.simulation.simulation import Simulation

NICENESS = 10  # lowers the priority of rendering below that of the simulation


class PictureProcess:
    """Renders pictures of one scene in a separate process."""

    def __init__(self, scene: Scene, image_type: ImageType) -> None:
        """Create the object without starting the process."""
        self._setting = scene, image_type
        self._until_stop = ExitStack()
        self._pool: ProcessPoolExecutor | None = None
        self._starting: asyncio.Future[ProcessPoolExecutor] | None = None

    async def start(self) -> None:
        """Start the process, which takes about a second."""
        # The start runs in a thread, because sending the scene blocks until the process
        # has read it.
        process = worker_process(partial(_Painter.prepare, *self._setting))
        starting = asyncio.to_thread(self._until_stop.enter_context, process)
        self._starting = asyncio.ensure_future(starting)
        self._pool = await asyncio.shield(self._starting)

    async def draw(
        self, tiles: Tiles, regions: AbstractSet[Region]
    ) -> dict[Region, bytes]:
        """Render a picture; return the bytes to send for each region.

        Raises:
            ServerError: If the process has ended.
        """
        assert self._pool is not None
        try:
            pictures = self._pool.submit(_Painter.draw, tiles, regions)
            return await asyncio.wrap_future(pictures)
        except BrokenProcessPool:
            raise ServerError("the process that draws pictures has ended") from None

    async def stop(self) -> None:
        """End the process at once, even if it is still starting."""
        if self._starting is not None:
            await asyncio.wait({self._starting})
        self._until_stop.close()


class _Painter:
    """The state that the rendering process keeps between pictures."""

    _renderer: Renderer
    _image_type: ImageType

    @classmethod
    def prepare(cls, scene: Scene, image_type: ImageType) -> None:
        """Create the renderer of the scene, once per process."""
        if sys.platform != "win32":
            os.nice(NICENESS)
        from radarsim.server.camera import Renderer  # noqa: PLC0415 - imports much

        cls._renderer, cls._image_type = Renderer(scene), image_type

    @classmethod
    def draw(cls, tiles: Tiles, regions: AbstractSet[Region]) -> dict[Region, bytes]:
        """Render a picture, and encode its regions."""
        from radarsim.server.camera import encode  # noqa: PLC0415

        pixels = cls._renderer.render_tiles(tiles)
        return {each: encode(pixels, each, cls._image_type) for each in regions}


log = logging.getLogger("radarsim.server")

INTERVAL: Final = 0.2  # s of the wall clock between two pictures
SILENCE: Final = 1.0  # s until a silent viewer gets a picture (rule 4)
MAX_VIEWERS: Final = 64
LOOK_INTERVAL: Final = 0.1  # s between two checks of a viewer's connection


class ImageServer(PeerServer):
    """Serves pictures of a simulation.

    Attributes:
        requested: Set when a viewer waits for a picture.
    """

    def __init__(
        self, simulation: Simulation, pictures: PictureProcess, *, port: int = 5003
    ) -> None:
        """Create a server that does not listen yet.

        Args:
            simulation: The simulation to show.
            pictures: Renders the pictures; the server starts and stops it.
            port: Port to listen on; 0 for a free one.
        """
        super().__init__(port, "viewers")
        self.requested = asyncio.Event()
        self._simulation, self._pictures = simulation, pictures
        self._connected = 0

    def _accept(self) -> Viewer:
        self._connected += 1
        return Viewer(self, self._connected)

    async def stop(self) -> None:
        """Close the port and all connections at once; never raises."""
        await super().stop()
        await self._pictures.stop()

    async def _work(self) -> None:
        """Render pictures for waiting viewers; close the port if the process ends."""
        loop = asyncio.get_running_loop()
        await self._pictures.start()
        while True:
            await self.requested.wait()
            self.requested.clear()
            due = loop.time() + INTERVAL
            waiting = [viewer for viewer in self.peers if viewer.waits]
            if not waiting:
                continue
            try:
                await self._answer(waiting)
            except ServerError as error:
                log.error("the image server has stopped: %s", error)  # noqa: TRY400 - no bug of this one
                self._close()
                return
            # The pause is counted from the start of the picture, so that the rate does
            # not depend on the rendering time.
            await asyncio.sleep(due - loop.time())

    async def _answer(self, waiting: list[Viewer]) -> None:
        """Render and send the pictures of waiting viewers, one per set of cameras.

        Raises:
            ServerError: If the rendering process has ended.
        """
        viewers = sorted(self.peers, key=lambda viewer: viewer.number)
        seen = dict(zip(viewers, assign(self._simulation, viewers), strict=True))
        groups: dict[Shown, list[Viewer]] = {}
        for viewer in waiting:
            groups.setdefault(seen[viewer], []).append(viewer)
        # All views are taken now, so that all pictures show the same time.
        tiles = {shown: tiles_of(self._simulation, shown) for shown in groups}
        for shown, group in groups.items():
            regions = {each.region for each in group if each.region is not None}
            pictures = await self._pictures.draw(tiles[shown], regions)
            for viewer in group:
                if viewer.region in pictures:  # the viewer has not disconnected
                    viewer.send(pictures[viewer.region])


class Viewer(PeerConnection):
    """One connection of a viewer.

    Attributes:
        region: The requested part of a picture; None without a request.
        robot: Number of the robot that the viewer saw last; 0 for none.
        number: Serial number of the viewer, in the order of connecting.
    """

    KIND = "viewer"
    MOST = MAX_VIEWERS

    def __init__(self, server: ImageServer, number: int) -> None:
        """Create the protocol of the connection of viewer ``number``."""
        super().__init__(server)
        self.region: Region | None = None
        self.robot, self.number = 0, number
        self._requested = server.requested
        self._requests = RequestBuffer()
        self._can_write = True
        self._silence: asyncio.TimerHandle | None = None

    @property
    def address(self) -> str:
        """IP address of the viewer's machine."""
        return self.peer.rpartition(":")[0]

    @property
    def waits(self) -> bool:
        """Whether the viewer waits for a picture, and all earlier ones are sent."""
        return self.region is not None and self._can_write

    def _begin(self, transport: asyncio.Transport) -> None:
        # With a limit of 0, writing is paused while any byte is unsent (rule 2).
        transport.set_write_buffer_limits(high=0)
        loop = asyncio.get_running_loop()
        self._silence = loop.call_later(SILENCE, self._request, WHOLE)
        loop.call_later(LOOK_INTERVAL, self.look)

    def look(self) -> None:
        """Check the connection; nothing is read from it while the viewer waits."""
        if self._transport is not None:
            super().look()
            asyncio.get_running_loop().call_later(LOOK_INTERVAL, self.look)

    def buffer_updated(self, nbytes: int) -> None:
        """Search the received bytes for a request."""
        self._break_silence()
        self._requests.feed(bytes(self._buffer[:nbytes]))
        region = self._requests.take()
        if region is not None:
            self._request(region)
        else:
            self._rest()  # rule 3

    def pause_writing(self) -> None:
        """Hold back pictures until the previous picture is completely sent."""
        self._can_write = False

    def resume_writing(self) -> None:
        """Allow the next picture, as the previous one is completely sent."""
        self._can_write = True
        self._requested.set()

    def eof_received(self) -> None:
        """Close the connection when its last picture is sent.

        No request can be waiting, because reading is paused while one waits.
        """
        self._end_in_time()

    def send(self, picture: bytes) -> None:
        """Answer the waiting request, and read the next one."""
        if self._transport is None:
            return
        self._transport.write(picture)
        self.region = self._requests.take()
        if self.region is None:
            self._read_on()
        else:
            self._requested.set()

    def _read_on(self) -> None:
        """Resume reading, unless a request is waiting."""
        if self.region is None:
            super()._read_on()

    def _request(self, region: Region) -> None:
        """Queue a request for a picture, and pause reading until it is answered."""
        if self._transport is not None:
            self.region = region
            self._transport.pause_reading()
            self._requested.set()

    def _break_silence(self) -> None:
        if self._silence is not None:
            self._silence.cancel()

    def _forget(self) -> None:
        super()._forget()
        self.region = None
        self._break_silence()
