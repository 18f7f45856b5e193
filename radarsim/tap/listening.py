"""The thread that listens, so that nobody who talks has to wait for it.

The interpreter runs one thread at a time. While a listener works it lets go of it ten
times as often as usual, which keeps what is forwarded meanwhile from waiting.
"""

import logging
import sys
import threading
from typing import Final

from radarsim.tap.backlog import Backlog
from radarsim.tap.choice import Choice
from radarsim.tap.lines import Line, Side
from radarsim.tap.overheard import Overheard

log = logging.getLogger("radarsim.tap")

TURN: Final = 0.0005  # s that a thread may keep the interpreter when others want it


class Listener:
    """Understands what passes a tap, and has one robot's reports made use of.

    Attributes:
        error: What went wrong in the making; None if nothing did. Nothing is listened
            to from then on, and whatever passes, passes.
    """

    def __init__(self, choice: Choice, backlog: Backlog | None = None) -> None:
        """Make a listener that does nothing yet.

        Args:
            choice: Works in the listener's thread, with its consumer.
            backlog: None for one of the usual size.
        """
        self.error: Exception | None = None
        self._choice = choice
        self._backlog = backlog or Backlog()
        self._overheard: dict[int, Overheard] = {}
        self._is_settled = False
        self._turn = 0.0
        # A consumer that hangs does not keep the process from ending.
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def dropped(self) -> int:
        """How many scans were left out because their consumer was too slow."""
        return self._backlog.dropped

    def start(self) -> None:
        """Begin to listen."""
        self._turn = sys.getswitchinterval()
        sys.setswitchinterval(min(TURN, self._turn))
        self._thread.start()

    def hear(self, number: int, side: Side, data: bytes) -> None:
        """Keep a piece of what one side says; what ``Tap`` calls."""
        self._backlog.put(number, side, data)

    def finish(self, timeout: float = 30.0) -> bool:
        """Hear no more, and let what was heard be made use of.

        Args:
            timeout: Longest wait for that, s.

        Returns:
            Whether it is all done; else the consumer is still at work.
        """
        self._backlog.end()
        self._thread.join(timeout)
        sys.setswitchinterval(self._turn)
        return not self._thread.is_alive()

    def _run(self) -> None:
        try:
            while (line := self._backlog.take()) is not None:
                self._understand(line)
            self._choice.finish()
        except Exception as error:  # noqa: BLE001 - who waits for the end is told
            self.error = error
            self._backlog.end()
            log.warning("nothing is made of what passes any more: %s", error)

    def _understand(self, line: Line) -> None:
        overheard = self._overheard.setdefault(line.number, Overheard(line.number))
        if line.side == "client":
            overheard.hear_client(line.text)
            return
        report = overheard.hear_server(line.text)
        if report is not None:
            self._choice.take(overheard, report)
        if not self._is_settled and self._choice.chosen is not None:
            self._is_settled = True
            self._backlog.keep_only(self._choice.chosen.number)
            self._overheard = {self._choice.chosen.number: self._choice.chosen}
