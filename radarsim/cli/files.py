"""The files that options name."""

import os
from pathlib import Path

import typer

from radarsim.wholefile import write_whole


def check_place(path: Path, hint: str) -> None:
    """Find out what would keep a file from being written, as far as that shows before.

    Args:
        path: Where it is to be.
        hint: The option that asks for it.

    Raises:
        typer.BadParameter: If there is no such folder, or no right to write there.
    """
    if reason := _hindrance(path):
        text = f"cannot write {path}: {reason}"
        raise typer.BadParameter(text, param_hint=hint)


def _hindrance(path: Path) -> str:
    if not path.parent.is_dir() or not Path(os.path.realpath(path)).parent.is_dir():
        return "no such folder"
    if path.is_dir():
        return "a folder of that name"
    return "" if os.access(path.parent, os.W_OK | os.X_OK) else "no right to"


def write_file(path: Path, data: bytes, hint: str = "-o") -> None:
    """Write a file whole or not at all, as ``write_whole`` does.

    Args:
        path: Where.
        data: All of it.
        hint: The option that asks for it.

    Raises:
        typer.BadParameter: If it cannot be written.
    """
    try:
        write_whole({path: data})
    except OSError as error:
        text = f"cannot write {path}: {error.strerror}"
        raise typer.BadParameter(text, param_hint=hint) from None
