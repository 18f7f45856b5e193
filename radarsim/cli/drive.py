"""``radarsim drive``."""

import asyncio
import math
import os
import sys

import typer

from radarsim.teleop.teleop import Wish, drive

DUMB = ("dumb", "unknown")  # what TERM says where text cannot be placed


def run_driver(host: str, port: int, wish: Wish) -> int:
    """Drive at this terminal; give the exit code.

    Raises:
        RadarsimError: If the server is not there, falls silent or lacks what is wished,
            or the keyboard is gone.
    """
    if not 0 < wish.speed < math.inf:
        raise typer.BadParameter(
            f"speed {wish.speed}, expected above 0", param_hint="--speed"
        )
    fault = terminal_fault()
    if fault:
        typer.echo(f"radarsim: {fault}, expected a terminal to drive at", err=True)
        return 2
    return asyncio.run(drive(host, port, wish))


def terminal_fault() -> str | None:
    """Tell why nobody can drive here; None if somebody can."""
    for name, stream in (("stdin", sys.stdin), ("stdout", sys.stdout)):
        if not stream.isatty():
            return f"{name} is no terminal"
    kind = os.environ.get("TERM", "")
    return f"terminal {kind!r} cannot place text" if kind in DUMB else None
