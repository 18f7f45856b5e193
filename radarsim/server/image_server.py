"""An image server: pictures from a robot's camera for viewers.

Theory of operation
===================
While a viewer waits for a picture, one is drawn every ``INTERVAL``, of the poses at
that time. All viewers that wait and see the same get the same picture.

Pictures are drawn in a process of its own and not in a thread: a thread that draws
holds Python's global lock every now and then. Where the processors are busy it may have
to wait while it does, and ticks would wait with it.

Rule 1: a viewer's next request is read when its last one is answered. What it sends
meanwhile waits in its socket; no queue grows.
Rule 2: a viewer gets no picture while an earlier one is still to be sent. Its request
waits, and is answered with a new picture: a slow viewer misses pictures, and holds up
nobody.
Rule 3: after bytes without a request a viewer is not read for ``READ_PAUSE``, so that
garbage takes little time from the ticks, however much comes.
Rule 4: some viewers wait for a picture before they send anything. One that is silent
for ``SILENCE`` after it has connected gets a picture unasked.
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

NICENESS = 10  # ticks of the server go first


class PictureProcess:
    """Draws pictures of one scene in a process of its own."""

    def __init__(self, scene: Scene, image_type: ImageType) -> None:
        """Describe a process that is not started yet."""
        self._setting = scene, image_type
        self._until_stop = ExitStack()
        self._pool: ProcessPoolExecutor | None = None
        self._starting: asyncio.Future[ProcessPoolExecutor] | None = None

    async def start(self) -> None:
        """Start the process, which takes a second until it draws."""
        # The scene is handed over as fast as the process starts to read it.
        process = worker_process(partial(_Painter.prepare, *self._setting))
        starting = asyncio.to_thread(self._until_stop.enter_context, process)
        self._starting = asyncio.ensure_future(starting)
        self._pool = await asyncio.shield(self._starting)

    async def draw(
        self, tiles: Tiles, regions: AbstractSet[Region]
    ) -> dict[Region, bytes]:
        """Return the bytes that are sent to viewers for regions of a picture.

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
        """End the process at once, also one that is being started."""
        if self._starting is not None:
            await asyncio.wait({self._starting})
        self._until_stop.close()


class _Painter:
    """What the process keeps from one picture to the next."""

    _renderer: Renderer
    _image_type: ImageType

    @classmethod
    def prepare(cls, scene: Scene, image_type: ImageType) -> None:
        """Read the scene, once."""
        if sys.platform != "win32":
            os.nice(NICENESS)
        from radarsim.server.camera import Renderer  # noqa: PLC0415 - imports much

        cls._renderer, cls._image_type = Renderer(scene), image_type

    @classmethod
    def draw(cls, tiles: Tiles, regions: AbstractSet[Region]) -> dict[Region, bytes]:
        """Draw a picture, and encode regions of it."""
        from radarsim.server.camera import encode  # noqa: PLC0415

        pixels = cls._renderer.render_tiles(tiles)
        return {each: encode(pixels, each, cls._image_type) for each in regions}


log = logging.getLogger("radarsim.server")

INTERVAL: Final = 0.2  # s of the wall clock between two pictures
SILENCE: Final = 1.0  # s
MAX_VIEWERS: Final = 64
LOOK_INTERVAL: Final = 0.1  # s between two looks at a viewer that is not read


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
            simulation: The simulation in the pictures.
            pictures: Draws the pictures; started and stopped by the server.
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
        """Draw while viewers wait; close the port if that is not possible any more."""
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
                log.error("no more pictures: %s", error)  # noqa: TRY400 - no bug of this one
                self._close()
                return
            # From the beginning of the picture, so that the rate does not depend on how
            # long it takes to draw.
            await asyncio.sleep(due - loop.time())

    async def _answer(self, waiting: list[Viewer]) -> None:
        """Draw what viewers wait for, once for all that see the same.

        Raises:
            ServerError: If no more pictures can be drawn.
        """
        viewers = sorted(self.peers, key=lambda viewer: viewer.number)
        seen = dict(zip(viewers, assign(self._simulation, viewers), strict=True))
        groups: dict[Shown, list[Viewer]] = {}
        for viewer in waiting:
            groups.setdefault(seen[viewer], []).append(viewer)
        # All of the same moment, also those that are drawn after others.
        tiles = {shown: tiles_of(self._simulation, shown) for shown in groups}
        for shown, group in groups.items():
            regions = {each.region for each in group if each.region is not None}
            pictures = await self._pictures.draw(tiles[shown], regions)
            for viewer in group:
                if viewer.region in pictures:  # it has not left meanwhile
                    viewer.send(pictures[viewer.region])


class Viewer(PeerConnection):
    """One connection of a viewer.

    Attributes:
        region: The part of a picture that it waits for; None for no request.
        robot: Number of the robot that it saw last; 0 for none.
        number: Counts the viewers in the order of connecting.
    """

    KIND = "viewer"
    MOST = MAX_VIEWERS

    def __init__(self, server: ImageServer, number: int) -> None:
        """Create the protocol of a connection; the number is that of the viewer."""
        super().__init__(server)
        self.region: Region | None = None
        self.robot, self.number = 0, number
        self._requested = server.requested
        self._requests = RequestBuffer()
        self._can_write = True
        self._silence: asyncio.TimerHandle | None = None

    @property
    def address(self) -> str:
        """Address of its machine."""
        return self.peer.rpartition(":")[0]

    @property
    def waits(self) -> bool:
        """Whether it waits for a picture, and has read all earlier ones."""
        return self.region is not None and self._can_write

    def _begin(self, transport: asyncio.Transport) -> None:
        # Any byte that waits pauses writing, which shows that the last picture is not
        # read yet (rule 2).
        transport.set_write_buffer_limits(high=0)
        loop = asyncio.get_running_loop()
        self._silence = loop.call_later(SILENCE, self._request, WHOLE)
        loop.call_later(LOOK_INTERVAL, self.look)

    def look(self) -> None:
        """Look again and again, as a viewer that waits is not read."""
        if self._transport is not None:
            super().look()
            asyncio.get_running_loop().call_later(LOOK_INTERVAL, self.look)

    def buffer_updated(self, nbytes: int) -> None:
        """Look for a request in received bytes."""
        self._break_silence()
        self._requests.feed(bytes(self._buffer[:nbytes]))
        region = self._requests.take()
        if region is not None:
            self._request(region)
        else:
            self._rest()  # rule 3

    def pause_writing(self) -> None:
        """Note that a picture is still to be sent."""
        self._can_write = False

    def resume_writing(self) -> None:
        """Note that all pictures are sent."""
        self._can_write = True
        self._requested.set()

    def eof_received(self) -> None:
        """Close the connection when its last picture is sent.

        Reading is paused while a request waits, so there is none.
        """
        self._end_in_time()

    def send(self, picture: bytes) -> None:
        """Answer the request that waits, and read the next one."""
        if self._transport is None:
            return
        self._transport.write(picture)
        self.region = self._requests.take()
        if self.region is None:
            self._read_on()
        else:
            self._requested.set()

    def _read_on(self) -> None:
        """Look for the next request, unless one waits."""
        if self.region is None:
            super()._read_on()

    def _request(self, region: Region) -> None:
        """Wait for a picture, and read nothing meanwhile."""
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
