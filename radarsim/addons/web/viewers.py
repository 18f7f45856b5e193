"""The browsers that show the page, and the messages that wait to be sent to them.

Text messages wait in a queue, in which a newer message replaces an older one of the
same subject. Frames hold the newest state of all robots and are never queued: a browser
is sent the newest frame once it has acknowledged the last one, so a slow browser gets
fewer frames, but no old ones. A change is sent soon, at a limited rate.
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from typing import Any, Final

from pydantic_core import to_json

MOST_TEXTS: Final = 500  # messages that may wait for a browser
INTERVAL: Final = 0.1  # s; least mean interval between two frames
COALESCED: Final = 0.004  # s; changes that arrive within it share a frame


class SlowViewer(Exception):
    """Raised if too many messages wait for a browser that does not read them."""


class Viewer:
    """One browser.

    Attributes:
        name: Name of the browser that other browsers show.
        selected: Robot whose echoes the browser receives; None for none.
        is_looking: Whether the page is visible, and not in a hidden tab.
        is_ready: Whether the browser has acknowledged the last frame.
        shown: Version of the newest frame that the browser was sent.
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
            message: A mapping, which is sent as JSON, or JSON text.
            subject: The message replaces a waiting message with the same subject.
        """
        if len(self._texts) >= MOST_TEXTS:
            # Only set a flag: ``outgoing`` raises the error in the browser's own task.
            # An error here would end the loop that sends a message to all browsers.
            self._is_gone = True
        else:
            key = object() if subject is None else subject
            self._texts.pop(key, None)  # a replaced message moves to the end
            if not isinstance(message, str):
                message = encode_json(message)
            self._texts[key] = message
        self._wake.set()

    def send_frame(self, frame: bytes, version: int) -> None:
        """Queue a frame; the browser is not ready until it acknowledges the frame."""
        self._frame, self.shown, self.is_ready = frame, version, False
        self._wake.set()

    async def outgoing(self) -> AsyncIterator[str | bytes]:
        """Yield messages and frames to send, as they are queued.

        Raises:
            SlowViewer: If more than ``MOST_TEXTS`` messages wait.
        """
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._texts:
                # Only one message is taken at a time, because newer messages may
                # replace waiting ones.
                yield self._texts.pop(next(iter(self._texts)))
            if self._is_gone:
                raise SlowViewer
            frame, self._frame = self._frame, None
            if frame is not None:
                yield frame


class Viewers:
    """All browsers, in the order in which they connected."""

    def __init__(self, make_frame: Callable[[str | None], bytes]) -> None:
        """Create an empty list of browsers; call it in the event loop.

        Args:
            make_frame: Called with the name of a robot, or None; returns the newest
                frame, with the echoes of that robot.
        """
        self._viewers: list[Viewer] = []
        self._joined = 0  # number of browsers that have joined so far
        self._make_frame = make_frame
        self._loop = asyncio.get_running_loop()
        self._version = 1  # version of the state that frames show
        self._due = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def __iter__(self) -> Iterator[Viewer]:
        return iter(self._viewers)

    def add(self) -> Viewer:
        """Add a browser under a new name, which no earlier browser has had."""
        self._joined += 1
        viewer = Viewer(f"viewer {self._joined}")
        self._viewers.append(viewer)
        return viewer

    def remove(self, viewer: Viewer) -> None:
        """Remove a browser that has disconnected."""
        self._viewers.remove(viewer)

    def broadcast(
        self, message: Mapping[str, Any] | str, subject: object = None
    ) -> None:
        """Send a message to all browsers; see ``Viewer.send`` for the arguments."""
        text = message if isinstance(message, str) else encode_json(message)
        for viewer in self:
            viewer.send(text, subject)

    def update(self) -> None:
        """Send a new frame to all browsers soon."""
        self._version += 1
        if self._timer is None:
            # After a pause, a change is sent at once; otherwise it waits for the next
            # frame.
            due = max(self._loop.time() + COALESCED, self._due)
            self._timer = self._loop.call_at(due, self._send_frames)

    def acknowledge(self, viewer: Viewer) -> None:
        """Mark a viewer as ready, and send a newer frame if there is one."""
        viewer.is_ready = True
        self.catch_up(viewer)

    def catch_up(self, viewer: Viewer) -> None:
        """Send a frame to a viewer that is ready, if its last frame is outdated."""
        # If the timer is set, the next frame is sent soon anyway.
        can_take = viewer.is_ready and viewer.is_looking
        if self._timer is None and can_take and viewer.shown < self._version:
            self.send_frame(viewer)

    def send_frame(self, viewer: Viewer) -> None:
        """Send a frame to one viewer, whether it is ready or not."""
        viewer.send_frame(self._make_frame(viewer.selected), self._version)

    def _send_frames(self) -> None:
        """Send a frame to all viewers that are ready, and set the next due time."""
        self._timer = None
        # A late frame does not delay the frames after it. Otherwise frames, which have
        # about the rate of scans, would lag more and more behind the scans.
        self._due = max(self._loop.time(), self._due + INTERVAL)
        frames: dict[str | None, bytes] = {}
        for viewer in self:
            if viewer.is_ready and viewer.is_looking:
                if viewer.selected not in frames:
                    frames[viewer.selected] = self._make_frame(viewer.selected)
                viewer.send_frame(frames[viewer.selected], self._version)


def encode_json(message: Mapping[str, Any]) -> str:
    """Return compact JSON, with null for numbers that are not finite."""
    return to_json(message, inf_nan_mode="null").decode()
