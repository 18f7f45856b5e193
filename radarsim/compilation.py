"""Which kernels are being compiled right now, for those who wait for it.

The first scan on a machine compiles the ray engine for a minute or so; the first
server, the first map and the first camera compile what they need besides. The log tells
of it; a program can add an observer as well, before numba is imported.
"""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Final

from radarsim.kernel_cache import cache_folder
from radarsim.os_errors import describe_os_error

logger: Final = logging.getLogger(__name__)

ENGINE: Final = "the ray engine"
# What kernels belong to, by the beginning of their module; others are of the engine.
_SUBJECTS: Final = {
    "radarsim.sensors.echo": "the extraction of echoes",
    "radarsim.mapping": "mapping",
    "radarsim.exploration": "exploration",
    "radarsim.camera": "the camera",
}


@dataclass(slots=True)
class Compilation:
    """The compilation in this process.

    Attributes:
        observers: Called with what is compiled when it begins, and with None when it
            ends.
        subjects: What was compiled so far.
        unsaved: Why compiled code could not be kept, if that has happened.
        on_unsaved: Called when that happens for the first time.
    """

    observers: list[Callable[[str | None], object]] = field(default_factory=list)
    subjects: set[str] = field(default_factory=set)
    unsaved: OSError | None = None
    on_unsaved: Callable[[OSError], object] = lambda _: None
    _depth: int = 0

    @contextmanager
    def running(self, subject: str = ENGINE) -> Iterator[None]:
        """Tell the observers that something is compiled meanwhile."""
        self.begin(subject)
        try:
            yield
        finally:
            self.end()

    def begin(self, subject: str = ENGINE) -> None:
        """Begin to compile; kernels that are compiled into others are within."""
        self._depth += 1
        if self._depth > 1:
            return
        if subject not in self.subjects:
            logger.info("%s", describe(subject, again=bool(self.subjects)))
            self.subjects.add(subject)
        self._tell(subject)

    def end(self) -> None:
        """End what was begun last."""
        self._depth -= 1
        if self._depth == 0:
            self._tell(None)

    def report_unsaved(self, error: OSError) -> None:
        """Report that compiled code cannot be kept; the log is told once."""
        if self.unsaved is None:
            self.unsaved = error
            text = "compiled code cannot be kept in %s, see NUMBA_CACHE_DIR: %s"
            logger.warning(text, cache_folder(), describe_os_error(error))
            self.on_unsaved(error)

    def _tell(self, subject: str | None) -> None:
        for observer in tuple(self.observers):
            observer(subject)


compilation: Final = Compilation()


def subject_of(module: str) -> str:
    """Return what the kernels of a module belong to.

    >>> subject_of("radarsim.mapping.scan_matching")
    'mapping'
    """
    found = (name for start, name in _SUBJECTS.items() if module.startswith(start))
    return next(found, ENGINE)


def describe(subject: str, *, again: bool = False) -> str:
    """Return what happens, and how often.

    Args:
        subject: What is compiled.
        again: Whether something else was told before, and how often that happens.
    """
    if again:
        return f"compiling {subject} as well"
    if cache_folder() is None:
        return (
            f"compiling {subject}, at each start, since no cache folder can be"
            " written, see NUMBA_CACHE_DIR"
        )
    return f"compiling {subject}, once on this machine"
