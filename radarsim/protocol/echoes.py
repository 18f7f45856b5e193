"""Echoes on the wire: a line for each object that a scan has seen.

A line tells all of its object, so that a client can read it by itself. Names come from
maps and from other clients; here they become what a line can hold.
"""

import math
import re
from functools import partial
from typing import Final

import numpy as np

from radarsim.errors import MalformedMessage
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.message import Message, read_needed, require
from radarsim.protocol.numbers import (
    NumberFormat,
    format_ranges,
    format_shares,
    read_flag,
    read_list,
    read_number,
)
from radarsim.protocol.reports import EchoLine, TargetEchoes

# Lines end at 4095 bytes. An echo takes 37 at most (six digits of the beam, nine of the
# range), names take twice the longest, and all else less than 300.
ECHOES_A_LINE: Final = 90
LONGEST_NAME: Final = 210  # of an object or material: those of maps and their copies
LARGEST_DENSITY: Final = 1e9  # no beam gets into what is denser
OPAQUE: Final = "Opaque"

_UNFIT = re.compile(r"[^ -z|~]")  # what ASCII does not show, and braces


def echo_fields(report: EchoLine, dialect: Dialect) -> list[tuple[str, str]]:
    """Write what follows the type of such a line, as keys and values.

    Raises:
        ValueError: If a number in it is not finite.
    """
    head = [
        ("Name", report.name),
        ("Line", str(report.line)),
        ("Lines", str(report.lines)),
    ]
    if report.echoes is None:
        return head
    echoes = ("Echoes", _echoes(report.echoes, dialect))
    return [*head, *_object(report.echoes, dialect.plain), echoes]


def read_echo_fields(message: Message, time: float, name: str) -> EchoLine:
    """Read such a line.

    Raises:
        MalformedMessage: If a field is missing or cannot be read.
    """
    line = int(read_needed(message, "Line", read_number))
    lines = int(read_needed(message, "Lines", read_number))
    seen = None if message.get("Echoes") is None else _read_seen(message)
    return EchoLine(time, name, line, lines, seen)


def _read_seen(message: Message) -> TargetEchoes:
    flag = partial(read_flag, any_case=True)
    rows = [_read_echo(word) for word in require(message, "Echoes").split()]
    numbers = np.array([row for _, row in rows])
    return TargetEchoes(
        object=require(message, "Object"),
        material=require(message, "Material"),
        density=read_needed(message, "Density", _read_density),
        transparency=read_needed(message, "Transparency", read_number),
        laser_passes=flag(require(message, "LaserPasses")),
        robot_passes=flag(require(message, "RobotPasses")),
        beams=numbers[:, 0].astype(np.int64),
        ranges=numbers[:, 1],
        kinds=tuple(kind for kind, _ in rows),
        power=numbers[:, 2],
        strength=numbers[:, 3],
    )


def _read_echo(word: str) -> tuple[str, list[float]]:
    """Read one echo; give its kind, and its beam, range, power and strength."""
    parts = word.split(",")
    if len(parts) != 5:
        raise MalformedMessage(f"echo {word[:80]!r}, expected five parts")
    kind = parts.pop(2)
    numbers = read_list(",".join(parts))
    if len(numbers) != 4:
        raise MalformedMessage(f"echo {word[:80]!r}, expected four numbers in it")
    return kind.lower(), numbers


def _read_density(text: str) -> float:
    return math.inf if text.lower() == OPAQUE.lower() else read_number(text)


def _object(seen: TargetEchoes, form: NumberFormat) -> list[tuple[str, str]]:
    density = OPAQUE
    if seen.density != math.inf:
        density = form.text(min(seen.density, LARGEST_DENSITY))
    return [
        ("Object", _name(seen.object)),
        ("Material", _name(seen.material)),
        ("Density", density),
        ("Transparency", form.text(seen.transparency)),
        ("LaserPasses", str(seen.laser_passes)),
        ("RobotPasses", str(seen.robot_passes)),
    ]


def _name(text: str) -> str:
    """Give a name with single blanks and of what ASCII shows; never an empty one."""
    return _UNFIT.sub("?", " ".join(text.split()))[:LONGEST_NAME] or "?"


def _echoes(seen: TargetEchoes, dialect: Dialect) -> str:
    columns = (
        map(str, seen.beams.tolist()),
        format_ranges(seen.ranges, dialect.ranges).split(","),
        [kind.capitalize() for kind in seen.kinds],
        format_shares(seen.power, dialect.plain),
        format_shares(seen.strength, dialect.plain),
    )
    return " ".join([",".join(echo) for echo in zip(*columns, strict=True)])
