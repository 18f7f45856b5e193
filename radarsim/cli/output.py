"""What commands print: lines of text on stdout, messages and logs on stderr.

Names from maps, clients and command lines are in them, so all is made printable.
"""

import json
import logging
import shlex
import shutil
import sys
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import click

from radarsim.errors import escape_lines, escape_unprintable

MESSAGE_FORM: Final = "radarsim: %(message)s"  # of logs that look like messages


def print_lines(lines: Iterable[object]) -> None:
    """Print lines on stdout."""
    click.echo("\n".join(escape_unprintable(str(line)) for line in lines))


def print_bytes(data: bytes) -> None:
    """Print bytes on stdout, all of them also where Python does not buffer it."""
    left = memoryview(data)
    while left:
        left = left[sys.stdout.buffer.write(left) :]


def print_now(line: str) -> None:
    """Print a line on stdout at once, for programs that wait for it."""
    click.echo(line)
    sys.stdout.flush()


def print_message(text: str) -> None:
    """Print a message with the name of the program on stderr, at once."""
    sys.stderr.write(f"radarsim: {escape_lines(text)}\n")
    sys.stderr.flush()


def program_name() -> str:
    """Return how this program was called, for commands that can be copied.

    Where it is not on the path, as in an environment that is not active, that is its
    file.
    """
    called = Path(sys.argv[0])
    if called.name == "__main__.py":
        return "python -m radarsim"
    # Another program, such as pytest, may run a command: its name would help nobody.
    if called.stem != "radarsim" or shutil.which(called.name) is not None:
        return "radarsim"
    return shlex.quote(sys.argv[0])


def start_log(level: int, form: str, *, as_json: bool = False) -> None:
    """Write the log to stderr.

    Args:
        level: Lowest level that is written.
        form: Format of a line, as ``logging.Formatter`` takes it.
        as_json: Whether each line is a JSON object instead.
    """
    handler = logging.StreamHandler()
    handler.setFormatter(_JsonFormatter() if as_json else _PrintableFormatter(form))
    logging.basicConfig(handlers=[handler], level=level)


class _JsonFormatter(logging.Formatter):
    def format(self, record: logging.LogRecord) -> str:
        """Return a record as a JSON object, without its traceback."""
        time = datetime.fromtimestamp(record.created, UTC).isoformat()
        keys = {"time": time, "level": record.levelname, "logger": record.name}
        return json.dumps({**keys, "message": record.getMessage()})


class _PrintableFormatter(logging.Formatter):
    def formatMessage(self, record: logging.LogRecord) -> str:  # noqa: N802 - logging's name
        """Return the line of a record, without its traceback."""
        # Not in format(), which appends tracebacks: their line breaks have to stay.
        return escape_unprintable(super().formatMessage(record))
