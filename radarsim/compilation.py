"""Whether kernels are being compiled right now, for those who wait for it.

The first start on a machine compiles for up to half a minute. The log tells of it; a
program can add an observer as well, before numba is imported.
"""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final

from radarsim.kernel_cache import cache_folder

logger: Final = logging.getLogger(__name__)


@dataclass(slots=True)
class Compilation:
    """The compilation in this process.

    Attributes:
        observers: Called with True when compiling begins, and with False when it ends.
        has_begun: Whether anything was compiled so far.
    """

    observers: list[Callable[[bool], object]] = field(default_factory=list)
    has_begun: bool = False
    _depth: int = 0

    @contextmanager
    def running(self) -> Iterator[None]:
        """Tell the observers that something is compiled meanwhile."""
        self.begin()
        try:
            yield
        finally:
            self.end()

    def begin(self) -> None:
        """Begin to compile; kernels that are compiled into others are within."""
        if not self.has_begun:
            self.has_begun = True
            logger.info("%s", describe())
        self._depth += 1
        if self._depth == 1:
            self._tell(True)

    def end(self) -> None:
        """End what was begun last."""
        self._depth -= 1
        if self._depth == 0:
            self._tell(False)

    def _tell(self, running: bool) -> None:
        for observer in tuple(self.observers):
            observer(running)


compilation: Final = Compilation()


def describe() -> str:
    """Return what happens, and how often."""
    if cache_folder() is None:
        return (
            "compiling the ray engine, at each start, since no cache folder can be"
            " written, see NUMBA_CACHE_DIR"
        )
    return "compiling the ray engine, once on this machine"
