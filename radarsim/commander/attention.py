"""What the server is asked to tell: what somebody looks at, and nothing else.

Copies of the robots' lines take time of the server, echoes far more. Without a page on
a screen, and without a map that is being made, the server tells nothing.
"""

import asyncio
from typing import Final

from radarsim.commander.activities import Activities
from radarsim.commander.roster import Roster
from radarsim.commander.server_link import ServerLink
from radarsim.commander.viewers import Viewers

LINGER: Final = 2.0  # s that lines still come when nobody looks, as during a reload


class Attention:
    """Asks the server for what is needed, and no more for what is not."""

    def __init__(
        self,
        link: ServerLink,
        viewers: Viewers,
        roster: Roster,
        activities: Activities,
    ) -> None:
        """Ask for nothing yet; to be called in the event loop.

        Args:
            link: The connection to the server.
            viewers: The browsers.
            roster: The robots.
            activities: What goes on with the robots.
        """
        self._link = link
        self._viewers = viewers
        self._roster = roster
        self._activities = activities
        self._loop = asyncio.get_running_loop()
        self._end: asyncio.TimerHandle | None = None

    def update(self) -> None:
        """Ask for what is needed now."""
        looking, mapped = self._viewers.looking, self._activities.mapped
        if looking or mapped:
            if self._end is not None:
                self._end.cancel()
                self._end = None
            wanted = mapped | {viewer.selected for viewer in looking}
            self._link.watch(self._roster.views.keys() & wanted)
        elif self._end is None:
            self._end = self._loop.call_later(LINGER, self._link.watch, None)
