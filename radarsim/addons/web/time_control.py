"""What lets time pass, for all browsers alike: of a simulation, or of a recording."""

import sys
import time
from collections.abc import Callable
from typing import Any, Final

from radarsim.addons.web.requests import BadRequest, Pace, Seek

FOREIGN: Final = (
    "this page has not started the server; 'radarsim serve MAP --web PORT' has a page"
    " that can"
)


class TimeControl:
    """Time that passes by itself, which is all that is known of other servers.

    Attributes:
        speed: Simulated seconds in one second of the wall clock.
        is_paused: Whether time passes only by steps.
        on_change: Called in the event loop when one of these is another one.
    """

    refusal: str = FOREIGN  # why it cannot be controlled; empty if it can

    def __init__(self) -> None:
        """Let time pass at a speed of 1."""
        self.speed = 1.0
        self.is_paused = False
        self.on_change: Callable[[], None] = lambda: None

    @property
    def position(self) -> float | None:
        """The time that is shown, s; None for that of the newest reports."""
        return None

    def message(self) -> dict[str, Any]:
        """Return what browsers have to know."""
        return {
            "op": "time",
            "refusal": self.refusal,
            "paused": self.is_paused,
            "speed": self.speed,
            "t": self.position,
            "end": None,  # only that of a recording is known
        }

    def change(self, request: Pace) -> None:  # noqa: ARG002 - of those that can
        """Pause, go on, step, or change the speed.

        Raises:
            BadRequest: If that is not possible.
        """
        raise BadRequest(f"time cannot be changed: {self.refusal}")

    def seek(self, request: Seek) -> None:  # noqa: ARG002 - of recordings
        """Show another time.

        Raises:
            BadRequest: If that is not possible.
        """
        raise BadRequest("only a recording can be played from another time")

    def _set(self, speed: float, is_paused: bool) -> None:
        if (speed, is_paused) != (self.speed, self.is_paused):
            self.speed, self.is_paused = speed, is_paused
            self.on_change()


class ServerTime(TimeControl):
    """Time of the server that runs in the parent process.

    Requests go to the parent on stdout, a line of JSON each; the parent tells the state
    on stdin, likewise.
    """

    refusal = ""

    def change(self, request: Pace) -> None:
        """See ``TimeControl.change``."""
        sys.stdout.write(f"{request.model_dump_json(exclude={'op'})}\n")
        sys.stdout.flush()

    def take(self, state: Pace) -> None:
        """Take the state that the parent tells."""
        speed = self.speed if state.speed is None else state.speed
        self._set(speed, bool(state.paused))


class TaskClock:
    """The clock of what robots do by themselves.

    It follows simulated time, so that nothing that waits for a scan gives up while the
    simulation is paused. Threads may read it at any time.
    """

    def __init__(self) -> None:
        """Begin at 0 s."""
        self._since = (time.monotonic(), 0.0, 1.0)  # s of the wall, own time, and rate

    def time(self) -> float:
        """Return the time, s."""
        wall, began, rate = self._since
        return began + rate * (time.monotonic() - wall)

    def set_rate(self, rate: float) -> None:
        """Change how many seconds pass in one of the wall clock."""
        self._since = (time.monotonic(), self.time(), rate)
