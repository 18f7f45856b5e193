"""The commander as a process of its own beside a server, which it ends with."""

import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Final

from radarsim.cli.output import print_message
from radarsim.errors import ServerError, describe_os_error

END_TIMEOUT: Final = 5.0  # s that it has to end by itself
ANY_ADDRESS: Final = {"0.0.0.0": "127.0.0.1", "::": "::1"}  # where to reach them
# The modules are found where this process has found them.
PROGRAM: Final = (
    "import sys; end = sys.argv.index('commander');"
    "sys.path[:] = sys.argv[1:end]; sys.argv[1:end] = [];"
    "from radarsim.cli import main; main()"
)


class CommanderProcess:
    """A commander that waits until the server listens."""

    def __init__(self, options: Sequence[str]) -> None:
        """Start it.

        Args:
            options: Options of ``radarsim commander``.

        Raises:
            ServerError: If it cannot be started.
        """
        command = [sys.executable, "-c", PROGRAM, *sys.path]
        try:
            self._process = subprocess.Popen(
                [*command, "commander", "--child", *options],
                stdin=subprocess.PIPE,  # closed when this process ends, however it ends
                text=True,
                start_new_session=True,  # Ctrl-C in a terminal is not for it
            )
        except OSError as error:
            text = f"cannot start the commander: {describe_os_error(error)}"
            raise ServerError(text) from error
        self._is_stopping = False
        threading.Thread(target=self._watch, daemon=True).start()

    def connect(self, address: tuple[str, int]) -> None:
        """Tell it where the server listens."""
        host, port = address
        assert self._process.stdin is not None
        with suppress(OSError):  # it has ended, and said why
            self._process.stdin.write(f"{ANY_ADDRESS.get(host, host)} {port}\n")
            self._process.stdin.flush()

    def stop(self) -> None:
        """End it."""
        self._is_stopping = True
        assert self._process.stdin is not None
        with suppress(OSError):
            self._process.stdin.close()
        try:
            self._process.wait(END_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _watch(self) -> None:
        """Tell when it ends by itself; robots are served on without it."""
        code = self._process.wait()
        if not self._is_stopping:
            how = f"exit code {code}" if code >= 0 else f"signal {-code}"
            print_message(f"the commander has ended ({how}); there is no page any more")


@contextmanager
def commander_process(
    options: Sequence[str] | None,
) -> Iterator[CommanderProcess | None]:
    """Run a commander, or none without options, and end it in the end.

    Raises:
        ServerError: If it cannot be started.
    """
    if options is None:
        yield None
        return
    process = CommanderProcess(options)
    try:
        yield process
    finally:
        process.stop()
