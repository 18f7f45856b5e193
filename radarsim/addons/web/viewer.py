"""One browser that looks: what it has selected, and what it is still to be sent.

Texts wait in order, and a newer one of the same subject replaces an older one. Frames
do not wait: a browser gets the newest when it has acknowledged the one before, so that
one that is slow sees fewer, and nothing that is old.

All browsers that are connected.
"""

import asyncio
import json
import math
from collections.abc import AsyncIterator, Iterator, Mapping
from typing import Any, Final

MOST_TEXTS: Final = 500  # that wait for a browser that does not read


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
            self._is_gone = True
        else:
            key = object() if subject is None else subject
            self._texts.pop(key, None)
            if not isinstance(message, str):
                message = encode_json(message)
            self._texts[key] = message
        self._wake.set()

    def send_frame(self, frame: bytes, version: int) -> None:
        """Queue a frame; none is ready any more until it is acknowledged."""
        self._frame, self.shown, self.is_ready = frame, version, False
        self._wake.set()

    async def outgoing(self) -> AsyncIterator[str | bytes]:
        """Yield what is to be sent, as it comes.

        Raises:
            SlowViewer: If too much waits.
        """
        while True:
            await self._wake.wait()
            self._wake.clear()
            while self._texts:
                yield self._texts.pop(next(iter(self._texts)))
            if self._is_gone:
                raise SlowViewer
            frame, self._frame = self._frame, None
            if frame is not None:
                yield frame


def encode_json(message: Mapping[str, Any]) -> str:
    """Write compact JSON; numbers that are not finite are null."""
    try:
        return json.dumps(message, separators=(",", ":"), allow_nan=False)
    except ValueError:
        return json.dumps(_finite(message), separators=(",", ":"))


def _finite(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    return value


class Viewers(Mapping[str, Viewer]):
    """The browsers by their names, in the order in which they came."""

    def __init__(self) -> None:
        self._viewers: dict[str, Viewer] = {}
        self._joined = 0  # so far

    def __getitem__(self, name: str) -> Viewer:
        return self._viewers[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._viewers)

    def __len__(self) -> int:
        return len(self._viewers)

    @property
    def looking(self) -> list[Viewer]:
        """Those whose page is on a screen."""
        return [viewer for viewer in self.values() if viewer.is_looking]

    def add(self) -> Viewer:
        """Add a browser, under a name that none has had."""
        self._joined += 1
        viewer = Viewer(f"viewer {self._joined}")
        self._viewers[viewer.name] = viewer
        return viewer

    def remove(self, viewer: Viewer) -> None:
        """Remove a browser that is gone."""
        del self._viewers[viewer.name]

    def broadcast(
        self, message: Mapping[str, Any] | str, subject: object = None
    ) -> None:
        """Send a message to all; arguments as in ``Viewer.send``."""
        text = message if isinstance(message, str) else encode_json(message)
        for viewer in self.values():
            viewer.send(text, subject)
