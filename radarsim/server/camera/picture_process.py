"""The process that draws pictures.

It is a process and not a thread, because a thread that draws holds Python's global lock
every now and then. Where the processors are busy it may have to wait while it does, and
ticks would wait with it.
"""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Set as AbstractSet
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from typing import TYPE_CHECKING

from radarsim.errors import ServerError
from radarsim.processes import worker_pool

if TYPE_CHECKING:
    from radarsim.protocol.images import ImageType, Region
    from radarsim.scene.scene import Scene
    from radarsim.server.camera.renderer import Renderer
    from radarsim.server.camera.view import View

NICENESS = 10  # ticks of the server go first


class PictureProcess:
    """Draws pictures of one scene in a process of its own."""

    def __init__(self, scene: Scene, image_type: ImageType) -> None:
        """Describe a process that is not started yet."""
        self._setting = scene, image_type
        self._until_stop = ExitStack()
        self._pool: ProcessPoolExecutor | None = None
        self._starting: asyncio.Future[None] | None = None

    async def start(self) -> None:
        """Start the process, which takes a second until it draws."""
        # The scene is handed over as fast as the process starts to read it.
        self._starting = asyncio.ensure_future(asyncio.to_thread(self._start))
        await asyncio.shield(self._starting)

    def _start(self) -> None:
        pool = worker_pool(1, _Painter.prepare, *self._setting)
        self._pool = self._until_stop.enter_context(pool)
        self._pool.submit(os.getpid)  # processes start with their first task

    async def draw(
        self, view: View, regions: AbstractSet[Region]
    ) -> dict[Region, bytes]:
        """Return the bytes that are sent to viewers for regions of a picture.

        Raises:
            ServerError: If the process has ended.
        """
        assert self._pool is not None
        try:
            pictures = self._pool.submit(_Painter.draw, view, regions)
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
        from radarsim.server.camera.renderer import Renderer  # noqa: PLC0415 - imports much

        cls._renderer, cls._image_type = Renderer(scene), image_type

    @classmethod
    def draw(cls, view: View, regions: AbstractSet[Region]) -> dict[Region, bytes]:
        """Draw a picture, and encode regions of it."""
        from radarsim.server.camera.encoding import encode  # noqa: PLC0415

        pixels = cls._renderer.render(view)
        return {each: encode(pixels, each, cls._image_type) for each in regions}
