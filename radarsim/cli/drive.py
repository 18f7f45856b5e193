"""``radarsim drive``: drive a robot from the keyboard."""

import asyncio
import logging
import os
import sys
from functools import partial
from typing import Annotated

from annotated_types import Gt, Unit

from radarsim.cli.fields import RobotName, Server, check_robot
from radarsim.cli.output import MESSAGE_FORM, print_message, start_log
from radarsim.plans import RARE
from radarsim.processes import set_exit_code_of_sigterm
from radarsim.protocol.dialect import DriveUnit


def drive(
    server: Server,
    *,
    robot: RobotName = "P3AT",
    start: str | None = None,
    speed: Annotated[float, Gt(0), Unit("m/s")] = 0.4,
    scanner: Annotated[str | None, RARE] = None,
    drive_unit: Annotated[DriveUnit, RARE] = "rad_per_s",
) -> int:
    """Drive a robot from the keyboard, and see its sensor readings.

    Args:
        server: The server.
        robot: Class of the robot to spawn.
        start: Name of a start pose of the map; by default the first free one.
        speed: Initial speed, at most the robot's; + and - change it.
        scanner: Name of the scanner to show; by default the first one.
        drive_unit: Unit of wheel speeds that the server expects.

    Returns:
        The exit code.
    """
    from radarsim.client.teleop import TeleopSettings
    from radarsim.client.teleop import drive as drive_robot

    # Keys are read from stdin and the view is drawn on stdout, so both must be
    # terminals.
    problem = ""
    for name, stream in (("stdout", sys.stdout), ("stdin", sys.stdin)):
        if not stream.isatty():
            problem = f"{name} is not a terminal"
    terminal = os.environ.get("TERM", "")
    if terminal in ("dumb", "unknown"):
        problem = problem or f"terminal {terminal!r} cannot position text"
    if problem:
        print_message(f"{problem}, expected an interactive terminal")
        return 2
    check_robot(robot, served=None)
    settings = TeleopSettings(robot, start, scanner, speed, drive_unit)
    start_log(logging.WARNING, MESSAGE_FORM)
    # The command runs until it is stopped, so SIGTERM gives exit code 0 after the robot
    # has been spawned, and 143 before.
    on_start = partial(set_exit_code_of_sigterm, 0)
    return asyncio.run(drive_robot(*server.connect, settings, on_start))
