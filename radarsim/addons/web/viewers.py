"""The browsers that look, and what they are still to be sent.

Texts wait in order, and a newer one of the same subject replaces an older one. Frames,
the newest state of all robots, do not wait: a browser gets the newest when it has
acknowledged the one before, so that one that is slow sees fewer, and nothing that is
old. They are sent soon after something is new, and not too often.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from typing import Any, Final

from pydantic_core import to_json

MOST_TEXTS: Final = 500  # that wait for a browser that does not read
INTERVAL: Final = 0.1  # s between two frames, on average at least
COALESCED: Final = 0.004  # s; what arrives together is in one frame


class SlowViewer(Exception):
    """A browser does not read what it is sent."""


class Viewer:
    """One browser.

    Attributes:
        name: Name that others see it by.
        selected: Robot whose echoes it is sent; None for none.
        is_looking: Whether its page is on a screen, and not in a hidden tab.
        is_ready: Whether it can take another frame.
        shown: Version of the newest frame that it was sent.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.selected: str | None = None
        self.is_looking = True
        self.is_ready = True
        self.shown = 0
        self._texts: dict[object, str] = {}
        self._frame: bytes | None = None
        self._wake = asyncio.Event()
        self._is_gone = False

    def send(self, message: Mapping[str, Any] | str, subject: object = None) -> None:
        """Queue a message.

        Args:
            message: Goes out as JSON, which a text is already.
            subject: A message of the same subject that still waits is replaced.
        """
        if len(self._texts) >= MOST_TEXTS:
            # Its own task closes it: this is called in a loop over all browsers.
            self._is_gone = True
        else:
            key = object() if subject is None else subject
            self._texts.pop(key, None)  # the newer one goes to the end
            if not isinstance(message, str):
                message = encode_json(message)
            self._texts[key] = message
        self._wake.set()

    def send_frame(self, frame: bytes, version: int) -> None:
        """Queue a frame; none is ready any more until it is acknowledged."""
        self._frame, self.shown, self.is_ready = frame, version, False
        self._wake.set()

    async def outgoing(self) -> AsyncIterator[str | bytes]:
        """Yield messages and frames to send, as they come.

        Raises:
            SlowViewer: If too much waits.
        """
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._texts:
                # One by one: what comes meanwhile replaces what still waits.
                yield self._texts.pop(next(iter(self._texts)))
            if self._is_gone:
                raise SlowViewer
            frame, self._frame = self._frame, None
            if frame is not None:
                yield frame


class Viewers:
    """All browsers, in the order in which they came."""

    def __init__(self, make_frame: Callable[[str | None], bytes]) -> None:
        """Begin without any; to be called in the event loop.

        Args:
            make_frame: Returns the newest frame, with the echoes of the robot of a
                name, or of none.
        """
        self._viewers: list[Viewer] = []
        self._joined = 0  # so far
        self._make_frame = make_frame
        self._loop = asyncio.get_running_loop()
        self._version = 1  # of what frames show
        self._due = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def __iter__(self) -> Iterator[Viewer]:
        return iter(self._viewers)

    def add(self) -> Viewer:
        """Add a browser, under a name that none has had."""
        self._joined += 1
        viewer = Viewer(f"viewer {self._joined}")
        self._viewers.append(viewer)
        return viewer

    def remove(self, viewer: Viewer) -> None:
        """Remove a browser that is gone."""
        self._viewers.remove(viewer)

    def broadcast(
        self, message: Mapping[str, Any] | str, subject: object = None
    ) -> None:
        """Send a message to all; arguments as in ``Viewer.send``."""
        text = message if isinstance(message, str) else encode_json(message)
        for viewer in self:
            viewer.send(text, subject)

    def update(self) -> None:
        """Send all of them a new frame soon."""
        self._version += 1
        if self._timer is None:
            # After a pause a change is shown at once, else with others in one frame.
            due = max(self._loop.time() + COALESCED, self._due)
            self._timer = self._loop.call_at(due, self._send_frames)

    def acknowledge(self, viewer: Viewer) -> None:
        """Send a frame to a viewer that has shown the one before, if it is old."""
        viewer.is_ready = True
        self.catch_up(viewer)

    def catch_up(self, viewer: Viewer) -> None:
        """Send a frame to a viewer that is ready, if the one that it has is old."""
        # With a timer, a frame that is newer still comes soon.
        can_take = viewer.is_ready and viewer.is_looking
        if self._timer is None and can_take and viewer.shown < self._version:
            self.send_frame(viewer)

    def send_frame(self, viewer: Viewer) -> None:
        """Send a frame to one viewer, ready or not."""
        viewer.send_frame(self._make_frame(viewer.selected), self._version)

    def _send_frames(self) -> None:
        """Send a frame to all viewers that are ready, and set when the next is due."""
        self._timer = None
        # One that is late puts off no other: else frames would follow scans, which
        # come as often, by that time for ever.
        self._due = max(self._loop.time(), self._due + INTERVAL)
        frames: dict[str | None, bytes] = {}
        for viewer in self:
            if viewer.is_ready and viewer.is_looking:
                if viewer.selected not in frames:
                    frames[viewer.selected] = self._make_frame(viewer.selected)
                viewer.send_frame(frames[viewer.selected], self._version)


def encode_json(message: Mapping[str, Any]) -> str:
    """Write compact JSON; numbers that are not finite are null."""
    return to_json(message, inf_nan_mode="null").decode()
