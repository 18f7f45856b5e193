"""The commander as a process of its own beside a server, which it ends with."""

import subprocess
import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Final

import typer

from radarsim.cli.output import print_message
from radarsim.cli.serve_extension import ServedMap, ServeExtension
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


OPTION: Final = "--web"


@dataclass(frozen=True, slots=True)
class WebOptions:
    """The option ``--web`` of ``radarsim serve``.

    Attributes:
        web: Port of the page; 0 for a free one, None for no page.
    """

    web: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            help="Serve a web page on this port as well, to see and drive robots; 0"
            " takes a free one. 'radarsim commander' has more options.",
        ),
    ] = None

    def extension(self, served: ServedMap) -> "CommanderExtension | None":
        """See ``ExtensionOptions.extension``."""
        return None if self.web is None else CommanderExtension(self.web, served)


class CommanderExtension(ServeExtension):
    """A commander beside the server that it shows."""

    address = "127.0.0.1"  # the page is for this machine alone

    def __init__(self, port: int, served: ServedMap) -> None:
        """Plan a commander; port 0 is a free one."""
        self.ports = {OPTION: port}
        self._options = ["--web", str(port), "--map", served.map]
        self._options += served.options.words()
        self._process: CommanderProcess | None = None

    def open(self) -> None:
        """Start it: it can import what it needs while the map is read."""
        self._process = CommanderProcess(self._options)

    def announce(self, address: tuple[str, int]) -> None:
        """Tell it where the server listens."""
        if self._process is not None:
            self._process.connect(address)

    def close(self) -> None:
        """End it."""
        if self._process is not None:
            self._process.stop()
