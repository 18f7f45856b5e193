"""The process that compiles what a server needs, and writes it into the cache.

It is a process and not a thread, because compiling holds Python's global lock most of
the time, and clients would wait for their greeting.

It writes a line ``compiling`` when it begins to compile, which it does not if all is in
the cache, and a line ``failed`` with the reason before it ends with an error.
"""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from typing import Final

from radarsim.compilation import compilation
from radarsim.errors import ServerError
from radarsim.kernel_cache import mark_complete
from radarsim.os_errors import describe_os_error

COMPILING: Final = "compiling"
FAILED: Final = "failed"
# The modules are found where this process has found them.
PROGRAM: Final = (
    "import sys; sys.path[:] = sys.argv[1:];"
    "from radarsim.server.compiler_process import main; main()"
)


class CompilerProcess:
    """Compiles in a process of its own."""

    def __init__(self) -> None:
        """Describe a process that is not started yet."""
        self._lock = threading.Lock()
        self._process: subprocess.Popen[str] | None = None
        self._stopped = False

    def run(self) -> None:
        """Compile what is not cached, and tell the observers of ``compilation``.

        Raises:
            ServerError: If the process has failed, was ended or cannot be started.
        """
        with self._lock:
            if self._stopped:
                raise ServerError("it was stopped")
            self._process = _start()
        with self._process, ExitStack() as until_end:
            reason = ""
            for word, text in _words(self._process):
                if word == COMPILING:
                    until_end.enter_context(compilation.running())
                elif word == FAILED:
                    reason = text
            code = self._process.wait()
        if code:
            raise ServerError(reason or _describe_end(code))

    def stop(self) -> None:
        """End the process at once, from any thread."""
        with self._lock:
            self._stopped = True
            if self._process is not None:
                self._process.kill()


def _start() -> "subprocess.Popen[str]":
    """Start the process.

    Raises:
        ServerError: If it cannot be started.
    """
    try:
        return subprocess.Popen(
            [sys.executable, "-c", PROGRAM, *sys.path],
            stdin=subprocess.PIPE,  # closed when this process ends, however it ends
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            start_new_session=True,  # Ctrl-C in a terminal is not for it
        )
    except OSError as error:
        raise ServerError(f"cannot start it: {describe_os_error(error)}") from error


def _words(process: "subprocess.Popen[str]") -> Iterator[tuple[str, str]]:
    """Yield first word and text of each line that a process writes."""
    assert process.stdout is not None
    for line in process.stdout:
        word, _, text = line.strip().partition(" ")
        yield word, text


def _describe_end(code: int) -> str:
    """Return how a process has ended, by the code that ``subprocess`` has for it."""
    if code > 0:
        return f"exit code {code}"
    with suppress(ValueError):
        return f"ended by {signal.Signals(-code).name}"
    return f"ended by signal {-code}"


def main() -> None:
    """Compile all that a server needs; the process ends when its parent does."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    compilation.observers.append(_tell)
    compilation.on_unsaved = _fail
    try:
        _compile()
    except (OSError, MemoryError) as error:
        _fail(error)
    mark_complete()


def _compile() -> None:
    from radarsim.host import Host  # noqa: PLC0415 - numba is imported from here on
    from radarsim.scene.map_file import load_map  # noqa: PLC0415

    Host(load_map("empty_room"))


def _end_with_parent() -> None:
    os.read(sys.stdin.fileno(), 1)  # nothing is written to it
    os._exit(1)


def _tell(_: str | None) -> None:
    compilation.observers.remove(_tell)  # once is enough
    print(COMPILING, flush=True)  # noqa: T201


def _fail(error: OSError | MemoryError) -> None:
    """End the process at once, with a reason."""
    if isinstance(error, MemoryError):
        reason = "not enough memory"
    else:
        reason = describe_os_error(error)
    print(FAILED, reason, flush=True)  # noqa: T201
    os._exit(1)
