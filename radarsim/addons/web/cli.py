"""``radarsim commander``: show and drive robots in a browser.

``radarsim serve --web`` runs the same command in a child process of the server.
"""

from __future__ import annotations

import asyncio
import json
import logging
import subprocess
import sys
import threading
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Final
from urllib.parse import urlencode

import click

from radarsim.cli.fields import Address, MapName, Port
from radarsim.cli.output import print_message, print_now, start_log
from radarsim.cli.server_options import (
    Listener,
    ServedMap,
    ServeExtension,
    ServerOptions,
    check_item_settings,
    hint_of_port,
)
from radarsim.errors import (
    MapError,
    RecordingError,
    ServerError,
    describe_os_error,
    join_address,
)
from radarsim.plans import RARE, Option
from radarsim.processes import exit_immediately, set_exit_code_of_sigterm

if TYPE_CHECKING:
    from radarsim.server.tcp_server import Pace
    from radarsim.simulation.config import SimulationConfig

END_TIMEOUT: Final = 5.0  # s; the process is killed if it takes longer to end
# Loopback addresses for servers that listen on all addresses.
ANY_ADDRESS: Final = {"0.0.0.0": "127.0.0.1", "::": "::1"}
# The child process gets the module search path of this process.
PROGRAM: Final = (
    "import sys; end = sys.argv.index('commander');"
    "sys.path[:] = sys.argv[1:end]; sys.argv[1:end] = [];"
    "from radarsim.cli import main; main()"
)
OPTION: Final = "--web"


@dataclass(frozen=True, slots=True, kw_only=True)
class ShownServer(ServerOptions):
    """The server whose robots a page shows.

    Attributes:
        map: Map to serve: a map file or the name of a shipped map; MAP@VARIANT selects
            a variant.
        connect: Show the robots of a running server at this address, instead of MAP.
        recording: Play the recording in this folder, instead of MAP.
        draw: Map of the server, which the page draws; by default only robots and scans
            are drawn, or the map of the recording.
        dialect: Protocol dialect of the server.
        settings: Setting of the robots' items on the server, such as
            lms200.max_range=20.
        drive_unit: Unit of wheel speeds that the server expects; by default the
            dialect's.
        robots: File of another robot class; repeat the option for several.
    """

    option_group: ClassVar = "Server"
    one_required: ClassVar = (("map", "connect", "recording"),)

    map: MapName | None = None
    connect: Address | None = None
    recording: Annotated[Path | None, Option(metavar="DIR")] = None
    draw: Annotated[
        str | None,
        Option(
            metavar="MAP", words="maps", is_rare=True, needs=("connect", "recording")
        ),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PageOptions:
    """Options of the web page.

    Attributes:
        web: Port of the web page; 0 selects a free port.
        web_host: Address on which the page is served.
        record_to: Folder in which each recording of the page gets its own folder.
    """

    option_group: ClassVar = "Page"

    web: Port = 8000
    web_host: Annotated[str, RARE] = "127.0.0.1"
    record_to: Annotated[Path, Option(metavar="DIR", is_rare=True)] = Path()

    def words(self) -> list[str]:
        """Return the options as arguments of a command line."""
        words = ["--web", str(self.web), "--web-host", self.web_host]
        return [*words, "--record-to", str(self.record_to)]

    def extension(self, served: ServedMap) -> CommanderExtension:
        """Return the extension of a server that serves the page."""
        return CommanderExtension(self, served)


def commander(
    server: ShownServer,
    page: PageOptions,
    *,
    child: Annotated[bool, Option(is_rare=True, needs=("map",))] = False,
) -> int:
    """Show and drive robots in a browser.

    MAP is served on a free port; 'radarsim serve MAP --web PORT' has more options.

    Args:
        server: The server.
        page: The page.
        child: Read the server's host and port from stdin; exit when stdin closes.

    Returns:
        The exit code.
    """
    if server.map is not None and not child:
        from radarsim.cli.serve import LogOptions, serve

        log = LogOptions()
        return serve(
            server.map, Listener(port=0), server, log_options=log, extensions=(page,)
        )
    from radarsim.listening import check_port, exit_code_of_signal

    if page.record_to.is_file():
        text = f"{page.record_to} is a file, expected a folder"
        raise click.BadParameter(text, param_hint="--record-to")
    with hint_of_port({OPTION: page.web}):  # check ports before slow imports
        check_port(page.web_host, page.web)
    from radarsim.addons.web.program import serve_page
    from radarsim.server.web_server import LOOPBACK, make_token

    config, drawn = server.config(), server.map or server.draw
    if server.recording is not None:
        config, drawn = conditions_of(server.recording, drawn)
    shown = _read_address() if child else server.connect or server.recording
    assert shown is not None  # the command line requires one of the options
    if not child:  # for a child, the parent reports errors in the settings
        check_item_settings(config)
    if page.web_host not in LOOPBACK:
        print_message(
            f"whoever reaches {page.web_host} and knows the token can drive the robots"
        )
    token = make_token()

    async def run() -> int:
        with exit_code_of_signal() as end:
            await serve_page(
                shown,
                page,
                config,
                token=token,
                map_=drawn,
                end=end,
                announce=lambda at: announce_commander(at, token),
                is_child=child,
            )
            return end.result() if end.done() else 0

    start_log(logging.WARNING, "%(asctime)s %(levelname)s %(message)s")
    logging.getLogger("uvicorn").setLevel(logging.ERROR)  # peers cannot fill the log
    with hint_of_port({OPTION: page.web}):
        code = asyncio.run(run())
    return exit_immediately(code)  # threads may still import or compute


def _read_address() -> tuple[str, int]:
    """Read host and port from stdin, to which the parent process writes them."""
    host, _, port = sys.stdin.readline().strip().rpartition(" ")
    if not host:  # the parent has ended, and printed the reason
        raise click.exceptions.Exit(1)
    return host, int(port)


def conditions_of(
    folder: Path, drawn: str | None
) -> tuple[SimulationConfig, str | None]:
    """Return the configuration of a recorded server, and the map to draw.

    Args:
        folder: Folder of the recording.
        drawn: Map that the user wants; None for the recorded map, if it is unchanged.

    Raises:
        RecordingError: If there is no recording in the folder.
    """
    from radarsim.addons.recording.bag_folder import check_map, open_bag

    info = open_bag(folder).info
    name = info.map or info.drawn_map
    if drawn is None and name:
        try:
            check_map(info, name)
            drawn = name
        except (MapError, OSError, RecordingError) as error:
            print_message(f"no map is drawn: {error}; --draw MAP selects one")
    return info.config(), drawn


def announce_commander(address: tuple[str, int], token: str) -> None:
    """Print the address of the page with its token, on one line."""
    set_exit_code_of_sigterm(0)
    fragment = urlencode({"token": token})  # a plus in base64 would be read as a blank
    print_now(f"radarsim: commander on http://{join_address(*address)}/#{fragment}")


@dataclass(frozen=True, slots=True)
class WebOptions:
    """The option ``--web`` of ``radarsim serve``.

    Attributes:
        web: Port of a web page that shows and drives robots; 0 selects a free port.
            'radarsim commander' has more options.
    """

    option_group: ClassVar = "Additional services"

    web: Port | None = None

    def extension(self, served: ServedMap) -> CommanderExtension | None:
        """See ``ExtensionOptions.extension``."""
        if self.web is None:
            return None
        return PageOptions(web=self.web).extension(served)


class CommanderExtension(ServeExtension):
    """Runs a commander in a child process of the server."""

    def __init__(self, page: PageOptions, served: ServedMap) -> None:
        """Prepare the command line; ``open`` starts the process."""
        self.ports = {OPTION: page.web}
        self.address = page.web_host
        self._words = [served.map, *page.words(), *served.options.words()]
        self._process: subprocess.Popen[str] | None = None
        self._pace: Pace | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._is_stopping = False

    def open(self) -> None:
        """Start the process, so that it imports its modules while the map is loaded.

        Raises:
            ServerError: If the process cannot be started.
        """
        command = [sys.executable, "-c", PROGRAM, *sys.path]
        try:
            self._process = subprocess.Popen(
                [*command, "commander", "--child", *self._words],
                stdin=subprocess.PIPE,  # the pipe closes when this process ends
                stdout=subprocess.PIPE,
                text=True,
                start_new_session=True,  # so that Ctrl-C does not interrupt it
            )
        except OSError as error:
            text = f"cannot start the commander: {describe_os_error(error)}"
            raise ServerError(text) from error
        threading.Thread(target=self._watch, args=(self._process,), daemon=True).start()

    def follow_pace(self, pace: Pace) -> None:
        """Let browsers change the speed of the simulation, and report all changes."""
        self._pace = pace
        pace.observers.append(self._send_pace)

    async def start(self, address: str) -> None:  # noqa: ARG002
        """Store the event loop of the server."""
        self._loop = asyncio.get_running_loop()

    async def stop(self) -> None:
        """End the process first; otherwise it would try to reconnect to the server."""
        await asyncio.to_thread(self.close)

    def announce(self, address: tuple[str, int]) -> None:
        """Send the address of the server to the process."""
        host, port = address
        self._send(f"{ANY_ADDRESS.get(host, host)} {port}")
        self._send_pace()

    def _send_pace(self) -> None:
        if self._pace is not None:
            state = {"paused": self._pace.is_paused, "speed": self._pace.speed}
            self._send(json.dumps(state))

    def _send(self, line: str) -> None:
        if self._process is not None and self._process.stdin is not None:
            with suppress(OSError, ValueError):  # the process has ended and printed why
                self._process.stdin.write(f"{line}\n")
                self._process.stdin.flush()

    def _change_pace(self, request: str) -> None:
        """Change the speed for a browser; call it in the server's event loop."""
        assert self._pace is not None  # the server starts before its page
        self._pace.change(**json.loads(request))

    def close(self) -> None:
        """End the process; kill it after a timeout."""
        process, self._is_stopping = self._process, True
        if process is None or process.stdin is None:
            return
        with suppress(OSError):
            # The process ends when its stdin is closed.
            process.stdin.close()
        try:
            process.wait(END_TIMEOUT)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _watch(self, process: subprocess.Popen[str]) -> None:
        """Forward the output and the requests of the process, and report its end.

        The server continues without the process.
        """
        assert process.stdout is not None
        for line in process.stdout:
            if not line.startswith("{"):
                with suppress(OSError):  # the reader of stdout is gone
                    print_now(line.rstrip("\n"))
            elif self._loop is not None:
                with suppress(RuntimeError):  # the server has ended
                    self._loop.call_soon_threadsafe(self._change_pace, line)
        code = process.wait()
        if not self._is_stopping:
            how = f"exit code {code}" if code >= 0 else f"signal {-code}"
            print_message(f"the commander has ended ({how}), and with it the page")
