"""``radarsim commander``: see, drive and explain robots in a browser."""

from __future__ import annotations

import asyncio
import logging
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn
from urllib.parse import urlencode

import typer

from radarsim.cli.options import DEFAULT_PORT, DriveUnit
from radarsim.cli.output import print_message, start_log
from radarsim.cli.serve import check_item_settings, cure_of_port
from radarsim.cli.server_options import DialectName, ServerOptions
from radarsim.errors import describe_os_error
from radarsim.processes import exit_immediately, set_exit_code_of_sigterm

if TYPE_CHECKING:
    from radarsim.addons.web.program import CommanderSettings

LONGEST_TOKEN = 200  # characters


ServerHostOption = Annotated[str, typer.Option(help="Host of the server.")]
ServerPortOption = Annotated[
    int, typer.Option(min=1, max=65535, help="Port of the server.")
]
WebPortOption = Annotated[
    int,
    typer.Option(min=0, max=65535, help="Port of the web page; 0 takes a free one."),
]
WebHostOption = Annotated[
    str, typer.Option(help="Address on which browsers reach the page.")
]
TokenFileOption = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="Read the token from here instead of making a new one."
    ),
]
ServedMapOption = Annotated[
    str | None,
    typer.Option(
        "--map",
        metavar="MAP",
        help="The map that the server serves, to be drawn; @VARIANT may follow.",
    ),
]
ServedDialectOption = Annotated[
    DialectName, typer.Option(help="Dialect of the server.")
]
ServedUnitOption = Annotated[
    DriveUnit | None,
    typer.Option(
        help="Unit in which the server takes wheel speeds; the dialect's by default."
    ),
]
ServedItemSettingsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="ITEM.KEY=VALUE",
        help="Setting with which the server was started, so that the page shows it.",
    ),
]
ServedRobotsOption = Annotated[
    list[Path] | None,
    typer.Option(
        "--robots",
        metavar="FILE",
        help="File of a robot class with which the server was started, so that the page"
        " offers it; repeat it.",
    ),
]
RecordToOption = Annotated[
    Path,
    typer.Option(
        metavar="DIR",
        file_okay=False,
        help="Folder in which the page's recordings get folders of their own.",
    ),
]
ChildOption = Annotated[
    bool,
    typer.Option(
        hidden=True,
        help="Read host and port of the server from stdin, and end with it.",
    ),
]


def commander(
    *,
    host: ServerHostOption = "127.0.0.1",
    port: ServerPortOption = DEFAULT_PORT,
    web: WebPortOption = 8000,
    web_host: WebHostOption = "127.0.0.1",
    web_token_file: TokenFileOption = None,
    map_: ServedMapOption = None,
    dialect: ServedDialectOption = DialectName.COMPAT,
    drive_unit: ServedUnitOption = None,
    settings: ServedItemSettingsOption = None,
    robots: ServedRobotsOption = None,
    record_to: RecordToOption = Path(),
    child: ChildOption = False,
) -> None:
    """See, drive and explain robots in a browser."""
    from radarsim.listening import check_port

    with cure_of_port({"--web": web}):  # before imports that take long
        check_port(web_host, web)
    from radarsim.addons.web.program import CommanderSettings
    from radarsim.server.web_server import make_token

    # The parent says what is wrong with the options that it passes on, and ends.
    server = _read_address() if child else (host, port)
    config = ServerOptions(dialect, drive_unit, settings, robots or ()).config()
    if not child:
        check_item_settings(config)
    token = make_token() if web_token_file is None else read_token(web_token_file)
    if web_host not in ("127.0.0.1", "localhost", "::1"):
        print_message(
            f"whoever reaches {web_host} and knows the token can drive the robots"
        )
    _run(
        CommanderSettings(
            server=server,
            web_host=web_host,
            web_port=web,
            token=token,
            config=config,
            map=map_,
            record_to=record_to,
            is_child=child,
        )
    )


def _run(settings: CommanderSettings) -> NoReturn:
    """Serve the page until a signal comes."""
    from radarsim.addons.web.program import run_commander

    start_log(logging.WARNING, "%(asctime)s %(levelname)s %(message)s")
    logging.getLogger("uvicorn").setLevel(logging.ERROR)  # peers cannot fill the log
    running = run_commander(
        settings, lambda address: announce_commander(address, settings.token)
    )
    with cure_of_port({"--web": settings.web_port}):
        code = asyncio.run(running)
    exit_immediately(code)  # threads may still import or compute


def read_token(path: Path) -> str:
    """Read a token: the first line of a file.

    Raises:
        typer.BadParameter: If there is none.
    """
    try:
        with path.open(encoding="ascii") as file:
            token = file.readline(LONGEST_TOKEN + 2).strip()
    except OSError as error:
        reason = describe_os_error(error)
    except UnicodeError:
        reason = "not ASCII"
    else:
        if 16 <= len(token) <= LONGEST_TOKEN and token.isprintable():
            return token
        reason = f"{len(token)} characters, expected 16 to {LONGEST_TOKEN}"
    text = f"no token in {path}: {reason}"
    raise typer.BadParameter(text, param_hint="--web-token-file")


def announce_commander(address: tuple[str, int], token: str) -> None:
    """Tell on stdout, on one line, what a browser has to open."""
    set_exit_code_of_sigterm(0)
    host = f"[{address[0]}]" if ":" in address[0] else address[0]
    fragment = urlencode({"token": token})  # those of base64 have a plus, a blank else
    typer.echo(f"radarsim: commander on http://{host}:{address[1]}/#{fragment}")
    sys.stdout.flush()


def _read_address() -> tuple[str, int]:
    """Read host and port of the server, which the parent writes when it listens.

    Raises:
        typer.Exit: If the parent has ended instead, and said why.
    """
    host, _, port = sys.stdin.readline().strip().rpartition(" ")
    if not host:
        raise typer.Exit(1)
    return host, int(port)
