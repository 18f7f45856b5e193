"""When frames are sent: soon after something is new, and not too often."""

import asyncio
from collections.abc import Callable, Mapping
from typing import Final

from radarsim.commander.viewer import Viewer

INTERVAL: Final = 0.1  # s between two frames, on average at least
COALESCED: Final = 0.004  # s; what arrives together is in one frame


class FrameSender:
    """Sends frames to the viewers that are ready for one."""

    def __init__(
        self,
        viewers: Mapping[str, Viewer],
        make_frame: Callable[[str | None], bytes],
    ) -> None:
        """Create a sender; to be called in the event loop.

        Args:
            viewers: The viewers, which may come and go.
            make_frame: Returns the newest frame, with the echoes of the robot of a
                name, or of none.
        """
        self._viewers = viewers
        self._make_frame = make_frame
        self._loop = asyncio.get_running_loop()
        self._version = 1  # of what frames show
        self._due = 0.0
        self._timer: asyncio.TimerHandle | None = None

    def changed(self) -> None:
        """Show soon what is new."""
        self._version += 1
        if self._timer is None:
            due = max(self._loop.time() + COALESCED, self._due)
            self._timer = self._loop.call_at(due, self._send)

    def acknowledge(self, viewer: Viewer) -> None:
        """Send a frame to a viewer that has shown the one before, if it is old."""
        viewer.is_ready = True
        self.catch_up(viewer)

    def catch_up(self, viewer: Viewer) -> None:
        """Send a frame to a viewer that is ready, if the one that it has is old."""
        if self._timer is None and _can_take(viewer) and viewer.shown < self._version:
            self.send_to(viewer)

    def send_to(self, viewer: Viewer) -> None:
        """Send a frame to one viewer."""
        viewer.send_frame(self._make_frame(viewer.selected), self._version)

    def _send(self) -> None:
        """Send a frame to all viewers that are ready, and set when the next is due."""
        self._timer = None
        # One that is late puts off no other: else frames would follow scans, which
        # come as often, by that time for ever.
        self._due = max(self._loop.time(), self._due + INTERVAL)
        frames: dict[str | None, bytes] = {}
        for viewer in self._viewers.values():
            if _can_take(viewer):
                if viewer.selected not in frames:
                    frames[viewer.selected] = self._make_frame(viewer.selected)
                viewer.send_frame(frames[viewer.selected], self._version)


def _can_take(viewer: Viewer) -> bool:
    return viewer.is_ready and viewer.is_looking
