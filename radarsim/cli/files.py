"""Files that commands write, and whether they can."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

import click

from radarsim.cli.output import print_message
from radarsim.errors import describe_os_error
from radarsim.files import write_atomically
from radarsim.processes import raise_on_signals

PICTURE_FORMS: Final = ("png", "svg", "pdf")  # endings of files that plots go into


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
