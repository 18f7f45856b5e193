"""The process that draws pictures.

It is a process and not a thread, because a thread that draws holds Python's global lock
every now and then. Where the processors are busy it may have to wait while it does, and
ticks would wait with it.
"""

import asyncio
import os
import pickle
import struct
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import Set as AbstractSet
from contextlib import suppress

from radarsim.camera.view import View
from radarsim.errors import ServerError
from radarsim.protocol.images import ImageType, Region
from radarsim.scene.scene import Scene


class PictureProcess:
    """Draws pictures of one scene in a process of its own."""

    def __init__(self, scene: Scene, image_type: ImageType) -> None:
        """Describe a process that is not started yet."""
        self._setting = scene, image_type
        self._process: Process | None = None

    async def start(self) -> None:
        """Start the process, which takes a second until it draws."""
        self._process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "radarsim.camera"),
            stdin=PIPE,
            stdout=PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            start_new_session=True,  # Ctrl-C is for the server, which stops it
        )
        self._write(self._setting)

    async def draw(
        self, view: View, regions: AbstractSet[Region]
    ) -> dict[Region, bytes]:
        """Return the bytes that are sent to viewers for regions of a picture.

        Raises:
            ServerError: If the process has ended.
        """
        assert self._process is not None
        assert self._process.stdout is not None
        self._write((view, regions))
        try:
            header = await self._process.stdout.readexactly(8)
            (length,) = struct.unpack(">Q", header)
            data = await self._process.stdout.readexactly(length)
        except (asyncio.IncompleteReadError, ConnectionError):
            code = await self._process.wait()
            raise ServerError(
                f"the process that draws pictures has ended with exit code {code}"
            ) from None
        pictures: dict[Region, bytes] = pickle.loads(data)
        return pictures

    async def stop(self) -> None:
        """End the process at once."""
        if self._process is not None:
            with suppress(ProcessLookupError):
                self._process.kill()
            await self._process.wait()

    def _write(self, request: object) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        self._process.stdin.write(pickle.dumps(request))
