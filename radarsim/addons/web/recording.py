"""Records all robots of a server when the page asks for it, one recording at a time.

A recording has its own connection to watch the robots, so it does not depend on open
pages. A separate process writes the files.
"""

import asyncio
import math
from datetime import datetime
from importlib import import_module
from pathlib import Path
from typing import Any

from radarsim.addons.recording.bag_folder import RecordingInfo, check_installed
from radarsim.addons.web.requests import BadRequest
from radarsim.addons.web.viewers import Viewers
from radarsim.client import AsyncClient
from radarsim.errors import RadarsimError, RecordingError
from radarsim.simulation.config import SimulationConfig


class RecordingSwitch:
    """Starts and ends recordings, each in a new subfolder of the same folder.

    Attributes:
        state: The message ``recording``, which each new browser is sent.
    """

    def __init__(
        self,
        server: tuple[str, int] | None,
        config: SimulationConfig,
        folder: Path,
        viewers: Viewers,
        *,
        map_: str | None = None,
    ) -> None:
        """Create a switch that is off.

        Args:
            server: Host and port of the server; None if a recording is played.
            config: How the server was started, as far as it is known.
            folder: Folder in which each recording creates a subfolder.
            viewers: The browsers, which are sent the state.
            map_: Name or path of the map that is shown; None if it is not known.
        """
        self._server = server
        self._config = config
        self._folder = folder
        self._map = map_
        self._viewers = viewers
        self._task: asyncio.Task[None] | None = None
        self.state: dict[str, Any] = {"op": "recording", "on": False, "text": ""}

    def switch(self, on: bool) -> None:
        """Start or end a recording; do nothing if this is the present state.

        Raises:
            BadRequest: If the last recording is still being completed, or a recording
                is played.
            RecordingError: If a package that recordings need is not installed.
        """
        if not on:
            if self.state["on"] and self._task is not None:
                self._task.cancel()
        elif self._server is None:
            raise BadRequest("a recording is being played; only servers are recorded")
        elif self._task is None:
            check_installed()
            self._task = asyncio.ensure_future(self._record(self._server))
        elif self._task.cancelling():
            raise BadRequest("the previous recording is not complete yet")

    async def close(self) -> None:
        """End the recording, if there is one, and wait until its files are complete."""
        if self._task is not None:
            # Cancelling the task twice would interrupt the wait for the files.
            if not self._task.cancelling():
                self._task.cancel()
            await asyncio.wait({self._task})

    async def _record(self, server: tuple[str, int]) -> None:
        name = f"recording_{datetime.now().astimezone():%Y%m%d_%H%M%S}"
        folder = self._folder.resolve() / name
        try:
            await self._record_to(server, folder)
        except asyncio.CancelledError:
            self._send_state(False, f"Recorded in {folder}")
        except RadarsimError as error:
            # If only the connection was lost, the recording is complete up to that
            # time.
            is_cut = isinstance(error, RecordingError)
            text = f"{folder} is not complete" if is_cut else f"Recorded in {folder}"
            self._send_state(False, text if self.state["on"] else "")
            self._viewers.broadcast({"op": "error", "text": f"recording: {error}"})
        finally:
            self._task = None

    async def _record_to(self, server: tuple[str, int], folder: Path) -> None:
        """Record until the task is cancelled, and then complete the recording.

        Args:
            server: Host and port of the server.
            folder: Folder to create.

        Raises:
            ClientError: If the server cannot be reached, refuses to be watched, or
                closes the connection.
            RecordingError: If the recording cannot be written.
        """
        # The import takes seconds, so it has to come before the server sends anything.
        # It imports ``recorders`` as well.
        module = "radarsim.addons.recording.recording_process"
        await asyncio.to_thread(import_module, module)
        from radarsim.addons.recording.recorders import WatchRecorder  # noqa: PLC0415
        from radarsim.addons.recording.recording_process import (  # noqa: PLC0415
            RecordingProcess,
        )

        async with AsyncClient.connect(*server) as client:
            client.session.reads_copies = False  # the recording process reads them
            level = (await client.greeting()).level
            # All echoes of all robots are recorded, whether pages show them or not.
            await client.watch(echoes=True)
            drawn = _lasting_name(self._map)
            info = RecordingInfo.of_config(self._config, level=level, drawn_map=drawn)
            process = await asyncio.to_thread(RecordingProcess, folder, info)
            recorder = WatchRecorder(process.add)
            try:
                self._send_state(True, f"Recording to {folder}")
                while not process.has_ended:
                    asked = map(recorder.take, await client.read(math.inf))
                    await client.send(b"".join(asked))
            finally:
                recorder.end()
                if not await asyncio.to_thread(process.close):
                    text = f"{folder} is not complete: is the disk full?"
                    # This error replaces a CancelledError, which would be reported as
                    # success.
                    raise RecordingError(f"{text} radarsim's terminal shows the reason")

    def _send_state(self, on: bool, text: str) -> None:
        self.state = {"op": "recording", "on": on, "text": text}
        self._viewers.broadcast(self.state, "recording")


def _lasting_name(map_: str | None) -> str:
    """Return a map's name, or the absolute path of a map file."""
    if map_ is None or not Path(map_.partition("@")[0]).exists():
        return map_ or ""
    return str(Path(map_).resolve())
