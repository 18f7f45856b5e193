"""An image server: pictures from a robot's camera for viewers.

Theory of operation
===================
While a viewer waits for a picture, one is drawn every ``INTERVAL``, of the poses at
that time, in a process of its own. All viewers that wait get the same picture.

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
from collections.abc import Set as AbstractSet
from typing import TYPE_CHECKING, Final, Protocol

from radarsim.errors import ServerError
from radarsim.protocol.images import WHOLE, Region, RequestBuffer
from radarsim.server.camera.view import View
from radarsim.server.peer_connections import PeerConnection, PeerServer, RefusalLog

if TYPE_CHECKING:
    from radarsim.simulation.simulation import Simulation

log = logging.getLogger("radarsim.server")

INTERVAL: Final = 0.2  # s of the wall clock between two pictures
SILENCE: Final = 1.0  # s
MAX_VIEWERS: Final = 64
READ_PAUSE: Final = 0.01  # s
CLOSE_GRACE: Final = 2.0  # s for a viewer that has closed its side to read a picture


class PictureSource(Protocol):
    """Draws pictures."""

    async def start(self) -> None:
        """Prepare to draw."""
        ...

    async def draw(
        self, view: View, regions: AbstractSet[Region]
    ) -> dict[Region, bytes]:
        """Return the bytes that are sent to viewers for regions of a picture.

        Raises:
            ServerError: If no more pictures can be drawn.
        """
        ...

    async def stop(self) -> None:
        """Stop drawing."""
        ...


class ImageServer(PeerServer):
    """Serves pictures of a simulation.

    Viewers can connect before the simulation has begun; they wait for their pictures.
    """

    def __init__(self, pictures: PictureSource, *, port: int = 5003) -> None:
        """Create a server that does not listen yet.

        Args:
            pictures: Draws the pictures; started and stopped by the server.
            port: Port to listen on; 0 for a free one.
        """
        super().__init__(port)
        self._pictures = pictures
        self._viewers: set[Viewer] = set()
        self._requested = asyncio.Event()
        self._refusals = RefusalLog("viewers")
        self._drawing: asyncio.Task[None] | None = None

    def _accept(self) -> Viewer:
        return Viewer(self._viewers, self._requested, self._refusals)

    async def begin(self, simulation: Simulation) -> None:
        """Draw pictures for viewers that wait.

        Args:
            simulation: What is seen in the pictures.
        """
        await self._pictures.start()
        self._drawing = asyncio.create_task(self._draw_forever(simulation))

    async def stop(self) -> None:
        """Close the port and all connections at once; never raises."""
        self._close(self._viewers)
        if self._drawing is not None:
            self._drawing.cancel()
            await asyncio.wait({self._drawing})
        await self._pictures.stop()
        await asyncio.sleep(0)  # sockets are closed in the next round of the loop

    async def _draw_forever(self, simulation: Simulation) -> None:
        """Draw while viewers wait; close the port if that is not possible any more."""
        try:
            await self._serve_forever(simulation)
        except ServerError as error:
            log.error("no more pictures: %s", error)  # noqa: TRY400 - no bug of this one
            self._close(self._viewers)

    async def _serve_forever(self, simulation: Simulation) -> None:
        loop = asyncio.get_running_loop()
        while True:
            await self._requested.wait()
            self._requested.clear()
            due = loop.time() + INTERVAL
            waiting = [viewer for viewer in self._viewers if viewer.waits]
            if waiting:
                await self._serve(waiting, View.of(simulation))
                await asyncio.sleep(due - loop.time())

    async def _serve(self, viewers: list[Viewer], view: View) -> None:
        """Draw one picture, and send it to viewers."""
        regions = {viewer.region for viewer in viewers if viewer.region is not None}
        pictures = await self._pictures.draw(view, regions)
        for viewer in viewers:
            if viewer.region is not None:  # it has not left meanwhile
                viewer.send(pictures[viewer.region])


class Viewer(PeerConnection):
    """One connection of a viewer.

    Attributes:
        region: The part of a picture that it waits for; None for no request.
    """

    KIND = "viewer"
    MOST = MAX_VIEWERS

    def __init__(
        self,
        viewers: set[Viewer],
        requested: asyncio.Event,
        refusals: RefusalLog,
    ) -> None:
        """Create the protocol of a connection.

        Args:
            viewers: All viewers, to which this one adds itself.
            requested: Set when the viewer waits for a picture.
            refusals: The log of viewers that are refused.
        """
        super().__init__(viewers, refusals)
        self.region: Region | None = None
        self._requested = requested
        self._requests = RequestBuffer()
        self._can_write = True
        self._silence: asyncio.TimerHandle | None = None
        self._grace: asyncio.TimerHandle | None = None  # aborts after eof

    @property
    def waits(self) -> bool:
        """Whether it waits for a picture, and has read all earlier ones."""
        return self.region is not None and self._can_write

    def _begin(self, transport: asyncio.Transport) -> None:
        transport.set_write_buffer_limits(high=0)
        loop = asyncio.get_running_loop()
        self._silence = loop.call_later(SILENCE, self._request, WHOLE)

    def buffer_updated(self, nbytes: int) -> None:
        """Look for a request in received bytes."""
        self._break_silence()
        self._requests.feed(bytes(self._buffer[:nbytes]))
        region = self._requests.take()
        if region is not None:
            self._request(region)
        elif self._transport is not None:
            self._transport.pause_reading()
            asyncio.get_running_loop().call_later(READ_PAUSE, self._read_on)

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
        if self._transport is not None:
            loop = asyncio.get_running_loop()
            self._grace = loop.call_later(CLOSE_GRACE, self._transport.abort)

    def connection_lost(self, error: Exception | None) -> None:
        """Forget the viewer."""
        if self._grace is not None:
            self._grace.cancel()  # a transport that is lost fails to abort
        super().connection_lost(error)

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
        if self._transport is not None and self.region is None:
            self._transport.resume_reading()

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
