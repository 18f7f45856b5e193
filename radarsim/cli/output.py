"""What commands print and write: lines on stdout, messages and logs on stderr, files.

Names from maps, clients and command lines are in what they print, so all is made
printable.
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

MESSAGE_FORM: Final = "radarsim: %(message)s"  # of logs that look like messages
PICTURE_FORMS: Final = ("png", "svg", "pdf")  # endings of files that plots go into


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


def list_endings(known: Sequence[str]) -> str:
    """Return the kinds of files that there are, in words.

    >>> list_endings(["json", "csv", "png"])
    'a .json, .csv or .png file'
    """
    *others, last = (f".{each}" for each in known)
    return f"a {', '.join(others)} or {last} file" if others else f"a {last} file"


def check_ending(path: Path, known: Sequence[str], hint: str) -> str:
    """Return the ending of a file's name, in lower case and without the dot.

    Args:
        path: The file to be written.
        known: The endings that are possible.
        hint: Name of the option that asks for it.

    Raises:
        click.BadParameter: If it is none of them.
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
        hint: Name of the option that asks for it.

    Raises:
        click.BadParameter: If its folder is missing or not writable, or it is a folder.
    """
    if reason := _obstacle_to_writing(path):
        text = f"cannot write {path}: {reason}"
        raise click.BadParameter(text, param_hint=hint)


def check_new_map(path: Path, hint: str) -> None:
    """Check, as far as possible, that a map file can be written that is not there yet.

    Args:
        path: The file to be written.
        hint: Name of the option that asks for it.

    Raises:
        click.BadParameter: If it has another ending, exists or cannot be written.
    """
    check_ending(path, ["yaml", "yml"], hint)
    check_writable(path, hint)
    if path.exists():
        text = f"{str(path)!r} exists, expected the name of a new file"
        raise click.BadParameter(text, param_hint=hint)


def check_picture(path: Path | None, hint: str = "--plot") -> str:
    """Return the format of a picture that is to be written later; empty for None.

    Args:
        path: The file to be written; None for no picture.
        hint: Name of the option that asks for it.

    Raises:
        click.BadParameter: If it is no ``PICTURE_FORMS``, or cannot be written.
    """
    if path is None:
        return ""
    check_writable(path, hint)
    return check_ending(path, PICTURE_FORMS, hint)


def write_picture(path: Path, data: bytes) -> None:
    """Write the picture of ``--plot``, and say so on stderr."""
    write_file(path, data, "--plot")
    print_message(f"wrote {path}")


def write_file(path: Path, data: bytes, hint: str = "-o") -> None:
    """Write a file as a whole or not at all; see ``write_atomically``.

    Args:
        path: The file to be written.
        data: Contents of the file.
        hint: Name of the option that asks for it.

    Raises:
        click.BadParameter: If it cannot be written.
    """
    from radarsim.files import write_atomically

    try:
        with raise_on_signals():  # which leaves no temporary file
            write_atomically({path: data})
    except OSError as error:
        reason = _obstacle_to_writing(path) or describe_os_error(error)
        text = f"cannot write {path}: {reason}"
        raise click.BadParameter(text, param_hint=hint) from None


@contextmanager
def without_empty_folder(folder: Path) -> Iterator[None]:
    """Remove a folder in the end that was not there before, if nothing is in it."""
    is_new = not os.path.lexists(folder)  # which raises nothing
    try:
        yield
    finally:
        if is_new:
            # Usually because the folder is not empty, which is as it should be.
            with suppress(OSError):
                folder.rmdir()


def _obstacle_to_writing(path: Path) -> str:
    # Through links: the file that a link leads to is the one that is replaced.
    target = Path(os.path.realpath(path))
    try:
        if not path.parent.is_dir() or not target.parent.is_dir():
            return "no such folder"
        if path.is_dir():
            return "a folder of that name"
    except OSError as error:  # the folder may not be entered
        return describe_os_error(error)
    # A new file is renamed over the old one, so the folder's permissions count, not
    # those of the file.
    return "" if os.access(path.parent, os.W_OK | os.X_OK) else "no permission"
