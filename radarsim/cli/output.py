"""Output of commands: lines on stdout, messages and logs on stderr, and files.

Printed text may have names from maps, clients and command lines, so unprintable
characters are escaped.
"""

import json
import logging
import os
import shlex
import shutil
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import click

from radarsim.errors import describe_os_error, escape_lines, escape_unprintable
from radarsim.processes import raise_on_signals

MESSAGE_FORM: Final = "radarsim: %(message)s"  # log lines like those of print_message
PICTURE_FORMS: Final = ("png", "svg", "pdf")  # file name endings of plots


def print_lines(lines: Iterable[object]) -> None:
    """Print lines on stdout."""
    click.echo("\n".join(escape_unprintable(str(line)) for line in lines))


def print_bytes(data: bytes) -> None:
    """Write all bytes to stdout, by several writes if stdout is unbuffered."""
    left = memoryview(data)
    while left:
        left = left[sys.stdout.buffer.write(left) :]


def print_now(line: str) -> None:
    """Print a line on stdout and flush, so that a waiting program receives the line."""
    click.echo(line)
    sys.stdout.flush()


def print_message(text: str) -> None:
    """Print a message with the name of the program on stderr, and flush."""
    sys.stderr.write(f"radarsim: {escape_lines(text)}\n")
    sys.stderr.flush()


def program_name() -> str:
    """Return the command that started this program, for hints that can be copied.

    If the program is not on PATH, as in a virtual environment that is not active, the
    command is the path of its file.
    """
    called = Path(sys.argv[0])
    if called.name == "__main__.py":
        return "python -m radarsim"
    # The command may run inside another program, such as pytest; then the name of that
    # program is not returned.
    if called.stem != "radarsim" or shutil.which(called.name) is not None:
        return "radarsim"
    return shlex.quote(sys.argv[0])


def start_log(level: int, form: str, *, as_json: bool = False) -> None:
    """Write the log to stderr.

    Args:
        level: Lowest level that is written.
        form: Format string of a line, for ``logging.Formatter``.
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
        # format() appends tracebacks, whose line breaks must stay, so only the message
        # is escaped.
        return escape_unprintable(super().formatMessage(record))


def list_endings(known: Sequence[str]) -> str:
    """Return the endings of file names as words for an error message.

    >>> list_endings(["json", "csv", "png"])
    'a .json, .csv or .png file'
    """
    *others, last = (f".{each}" for each in known)
    return f"a {', '.join(others)} or {last} file" if others else f"a {last} file"


def check_ending(path: Path, known: Sequence[str], hint: str) -> str:
    """Return the ending of a file's name, in lower case and without the dot.

    Args:
        path: The file to be written.
        known: The allowed endings.
        hint: Name of the option with the file name.

    Raises:
        click.BadParameter: If the ending is not allowed.
    """
    ending = path.suffix.lower().removeprefix(".")
    if ending not in known:
        text = f"{path}, expected {list_endings(known)}"
        raise click.BadParameter(text, param_hint=hint)
    return ending


def check_writable(path: Path, hint: str) -> None:
    """Check, as far as possible, that a file can be written later.

    Args:
        path: The file to be written.
        hint: Name of the option with the file name.

    Raises:
        click.BadParameter: If the folder of the file is missing or not writable, or the
            path is a folder.
    """
    if reason := _obstacle_to_writing(path):
        text = f"cannot write {path}: {reason}"
        raise click.BadParameter(text, param_hint=hint)


def check_new_map(path: Path, hint: str) -> None:
    """Check, as far as possible, that a new map file can be written.

    Args:
        path: The file to be written.
        hint: Name of the option with the file name.

    Raises:
        click.BadParameter: If the file has another ending, exists or cannot be written.
    """
    check_ending(path, ["yaml", "yml"], hint)
    check_writable(path, hint)
    if path.exists():
        text = f"{str(path)!r} exists, expected the name of a new file"
        raise click.BadParameter(text, param_hint=hint)


def check_picture(path: Path | None, hint: str = "--plot") -> str:
    """Check the file name of a picture, and return its format; empty for None.

    Args:
        path: The file to be written; None for no picture.
        hint: Name of the option with the file name.

    Raises:
        click.BadParameter: If the format is not one of ``PICTURE_FORMS``, or the file
            cannot be written.
    """
    if path is None:
        return ""
    check_writable(path, hint)
    return check_ending(path, PICTURE_FORMS, hint)


def write_picture(path: Path, data: bytes) -> None:
    """Write the picture of ``--plot``, and report it on stderr."""
    write_file(path, data, "--plot")
    print_message(f"wrote {path}")


def write_file(path: Path, data: bytes, hint: str = "-o") -> None:
    """Write a file as a whole or not at all; see ``write_atomically``.

    Args:
        path: The file to be written.
        data: Contents of the file.
        hint: Name of the option with the file name.

    Raises:
        click.BadParameter: If the file cannot be written.
    """
    from radarsim.files import write_atomically

    try:
        with raise_on_signals():  # so that a signal leaves no temporary file
            write_atomically({path: data})
    except OSError as error:
        reason = _obstacle_to_writing(path) or describe_os_error(error)
        text = f"cannot write {path}: {reason}"
        raise click.BadParameter(text, param_hint=hint) from None


@contextmanager
def without_empty_folder(folder: Path) -> Iterator[None]:
    """On exit, remove the folder if the context has created it and it is empty."""
    is_new = not os.path.lexists(folder)  # unlike ``Path.exists``, raises no errors
    try:
        yield
    finally:
        if is_new:
            # rmdir() raises an error for a folder that is not empty, which then stays.
            with suppress(OSError):
                folder.rmdir()


def _obstacle_to_writing(path: Path) -> str:
    # For a symbolic link, the file that the link points to is replaced.
    target = Path(os.path.realpath(path))
    try:
        if not path.parent.is_dir() or not target.parent.is_dir():
            return "no such folder"
        if path.is_dir():
            return "it is a folder"
    except OSError as error:  # the folder may not be entered
        return describe_os_error(error)
    # A temporary file is renamed to the path, so only the permissions of the folder
    # matter, even if the file exists.
    return "" if os.access(path.parent, os.W_OK | os.X_OK) else "no permission"
