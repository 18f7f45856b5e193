"""Begins and ends recordings, one at a time, and tells all browsers."""

from __future__ import annotations

import asyncio
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.addons.recording.bag_folder import check_installed
from radarsim.addons.web.requests import BadRequest
from radarsim.addons.web.viewer import Viewers
from radarsim.errors import RadarsimError, RecordingError
from radarsim.simulation.config import SimulationConfig

if TYPE_CHECKING:
    from radarsim.addons.web.robots_recording import RobotsRecording


class RecordingSwitch:
    """Records all robots into new folders, all below the same one."""

    def __init__(
        self,
        server: tuple[str, int],
        config: SimulationConfig,
        folder: Path,
        viewers: Viewers,
    ) -> None:
        """Record nothing yet.

        Args:
            server: Host and port of the server.
            config: How the server was started, as far as it is known.
            folder: Folder in which each recording gets one of its own.
            viewers: Who is told.
        """
        self._server = server
        self._config = config
        self._folder = folder
        self._viewers = viewers
        self._task: asyncio.Task[None] | None = None
        self._state: dict[str, Any] = {"op": "recording", "on": False, "text": ""}

    def message(self) -> dict[str, Any]:
        """Return what a new browser has to know."""
        return self._state

    def switch(self, on: bool) -> None:
        """Begin to record, or end it; what is so already stays so.

        Raises:
            BadRequest: If the recording before is still being completed.
            RecordingError: If something is missing that recordings need.
        """
        if not on:
            if self._state["on"] and self._task is not None:
                self._task.cancel()
            return
        if self._task is None:
            check_installed()
            self._task = asyncio.ensure_future(self._record())
        elif self._task.cancelling():
            raise BadRequest("the recording before is not complete yet")

    async def close(self) -> None:
        """End a recording, and wait until it is complete."""
        if self._task is not None:
            if not self._task.cancelling():
                self._task.cancel()
            await asyncio.wait({self._task})

    async def _record(self) -> None:
        try:
            recording = await asyncio.to_thread(self._plan)
            await self._run(recording)
        finally:
            self._task = None

    async def _run(self, recording: RobotsRecording) -> None:
        folder = recording.folder
        try:
            await recording.run(
                lambda: self._tell(on=True, text=f"Records to {folder}")
            )
        except asyncio.CancelledError:
            self._tell(False, f"Recorded in {folder}")
        except RadarsimError as error:
            was_on = self._state["on"] and not isinstance(error, RecordingError)
            self._tell(False, f"Recorded in {folder}" if was_on else "")
            text = f"recording: {error}"
            self._viewers.broadcast({"op": "error", "text": text})

    def _plan(self) -> RobotsRecording:
        from radarsim.addons.web.robots_recording import (  # noqa: PLC0415 - imports much
            RobotsRecording,
        )

        name = f"recording_{datetime.now().astimezone():%Y%m%d_%H%M%S}"
        folder = self._folder.resolve() / name
        return RobotsRecording(self._server, folder, self._config)

    def _tell(self, on: bool, text: str) -> None:
        self._state = {"op": "recording", "on": on, "text": text}
        self._viewers.broadcast(self._state, "recording")
