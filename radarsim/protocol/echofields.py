"""Echoes on the wire: a line for each object that a scan has seen.

A line tells all of its object, so that a client can read it by itself. Names come from
maps and from other clients; here they become what a line can hold.
"""

import math
import re
from typing import Final

from radarsim.protocol.dialect import Dialect
from radarsim.protocol.numbers import NumberFormat, format_ranges, format_shares
from radarsim.protocol.reports import EchoLine, Seen

# Lines end at 4095 bytes. An echo takes 37 at most (six digits of the beam, nine of the
# range), names take twice the longest, and all else less than 300.
ECHOES_A_LINE: Final = 90
LONGEST_NAME: Final = 210  # of an object or material: those of maps and their copies
LARGEST_DENSITY: Final = 1e9  # no beam gets into what is denser

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
    if report.seen is None:
        return head
    echoes = ("Echoes", _echoes(report.seen, dialect))
    return [*head, *_object(report.seen, dialect.plain), echoes]


def _object(seen: Seen, form: NumberFormat) -> list[tuple[str, str]]:
    density = "Opaque"
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


def _echoes(seen: Seen, dialect: Dialect) -> str:
    columns = (
        map(str, seen.beams.tolist()),
        format_ranges(seen.ranges, dialect.ranges).split(","),
        [kind.capitalize() for kind in seen.kinds],
        format_shares(seen.power, dialect.plain),
        format_shares(seen.strength, dialect.plain),
    )
    return " ".join([",".join(echo) for echo in zip(*columns, strict=True)])
