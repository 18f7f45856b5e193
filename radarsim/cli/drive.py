"""``radarsim drive``: drive a robot from the keyboard."""

import asyncio
import logging
import os
import sys
from functools import partial
from typing import Annotated

import typer

from radarsim.cli.options import DriveUnit, DriveUnitOption, check_positive, check_robot
from radarsim.cli.output import MESSAGE_FORM, print_message, start_log
from radarsim.processes import set_exit_code_of_sigterm


def drive(
    *,
    host: Annotated[str, typer.Option(help="Host of the server.")] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(min=1, max=65535, help="Port of the server.")
    ] = 3000,
    robot: Annotated[str, typer.Option(help="Class of the robot.")] = "P3AT",
    start: Annotated[
        str | None,
        typer.Option(help="Name of a start pose of the map; the first by default."),
    ] = None,
    scanner: Annotated[
        str | None, typer.Option(help="Scanner to show; the first by default.")
    ] = None,
    speed: Annotated[
        float,
        typer.Option(
            metavar="M_PER_S",
            callback=check_positive,
            help="Speed of driving at first; + and - change it.",
        ),
    ] = 0.4,
    drive_unit: DriveUnitOption = DriveUnit.RAD_PER_S,
) -> None:
    """Drive a robot from the keyboard, and see what it senses."""
    from radarsim.client.teleop.teleop import TeleopSettings
    from radarsim.client.teleop.teleop import drive as drive_robot

    if problem := _terminal_problem():
        print_message(f"{problem}, expected a terminal to drive at")
        raise typer.Exit(2)
    check_robot(robot, served=None)
    settings = TeleopSettings(robot, start, scanner, speed, drive_unit.value)
    # Driving has no end of its own: whoever stops it ends it as it should end.
    start_log(logging.WARNING, MESSAGE_FORM)
    driving = drive_robot(host, port, settings, partial(set_exit_code_of_sigterm, 0))
    raise typer.Exit(asyncio.run(driving))


def _terminal_problem() -> str | None:
    """Return why this terminal cannot show the panel; None if it can."""
    for name, stream in (("stdin", sys.stdin), ("stdout", sys.stdout)):
        if not stream.isatty():
            return f"{name} is no terminal"
    terminal = os.environ.get("TERM", "")
    if terminal in ("dumb", "unknown"):
        return f"terminal {terminal!r} cannot place text"
    return None
