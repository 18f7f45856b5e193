"""Echo lines: each reports the echoes of one scan on one object.

A line names all properties of its object, so that a client can use it by itself. Names
come from maps and from other clients; they are reduced to characters that a line can
contain.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Final, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from radarsim.errors import MalformedMessage
from radarsim.geometry import Floats
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.line_template import (
    LINE_END,
    NO_SERIES,
    WHOLE,
    WHOLE_IN_SERIES,
    Fields,
    marks,
    printable_name,
    reduce_text,
    series_marks,
)
from radarsim.protocol.message import Message
from radarsim.protocol.numbers import (
    parse_flag,
    parse_number,
    parse_words,
)
from radarsim.protocol.periodic_reports import SensorReport, Split, build_template

# A line has at most 4095 bytes. An echo takes up to 37 of them (six digits of the beam,
# nine of the range), two names twice the longest, and everything else less than 300.
ECHOES_A_LINE: Final = 90
LARGEST_DENSITY: Final = 1e9  # no beam enters what is denser
OPAQUE: Final = "Opaque"

_END: Final = f"}}{LINE_END}".encode("latin-1")


@dataclass(frozen=True, slots=True, eq=False)
class TargetEchoes:
    """Echoes of one object and material, and the properties of both.

    Attributes:
        object: Name of the object in the map, or of a robot; any text.
        material: Name of the material; any text.
        density: Power that a beam loses per metre inside; ``math.inf`` is opaque.
        transparency: Share of a beam that a metre of it, or a sheet, transmits.
        laser_passes: Whether light enters it.
        robot_passes: Whether robots can drive through it.
        beams: (E,) beam of each echo, counted from 0 at the right.
        ranges: (E,) m.
        kinds: Kind of each echo: enter, leave, sheet, hit or spent.
        power: (E,) share of the beam's power that is left on arrival, 0 to 1.
        strength: (E,) share of the beam that is reflected back, 0 to 1.
    """

    object: str
    material: str
    density: float
    transparency: float
    laser_passes: bool
    robot_passes: bool
    beams: NDArray[np.int64]
    ranges: Floats
    kinds: tuple[str, ...]
    power: Floats
    strength: Floats

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the fields of an echo line.

        Raises:
            MalformedMessage: If a field is missing or not readable.
        """
        kinds, numbers = _parse_echoes(message.require("Echoes"))
        return cls(
            object=message.require("Object"),
            material=message.require("Material"),
            density=message.parse("Density", _parse_density),
            transparency=message.parse("Transparency", parse_number),
            laser_passes=message.parse("LaserPasses", parse_flag),
            robot_passes=message.parse("RobotPasses", parse_flag),
            beams=numbers[:, 0].astype(np.int64),
            ranges=numbers[:, 1],
            kinds=kinds,
            power=numbers[:, 2],
            strength=numbers[:, 3],
        )

    def properties(self) -> "ObjectProperties":
        """Return what is told of the object."""
        return ObjectProperties(
            *(self.object, self.material, self.density, self.transparency),
            *(self.laser_passes, self.robot_passes),
        )


class ObjectProperties(NamedTuple):
    """What an echo line tells of its object; see ``TargetEchoes``."""

    object: str
    material: str
    density: float
    transparency: float
    laser_passes: bool
    robot_passes: bool

    @property
    def numbers(self) -> tuple[float, ...]:
        """The numbers among them, in the order of their marks in the line."""
        if self.density == math.inf:
            return (self.transparency,)
        return (min(self.density, LARGEST_DENSITY), self.transparency)

    def fields(self, dialect: Dialect) -> Fields:
        """Return the fields, with marks for the numbers."""
        plain = marks(dialect.plain)
        return (
            ("Object", printable_name(self.object)),
            ("Material", printable_name(self.material)),
            ("Density", OPAQUE if self.density == math.inf else plain),
            ("Transparency", plain),
            ("LaserPasses", str(self.laser_passes)),
            ("RobotPasses", str(self.robot_passes)),
        )


@dataclass(frozen=True, slots=True)
class EchoLine(SensorReport):
    """Echoes of one scan, as many as fit into a line.

    Attributes:
        name: Name of the scanner.
        line: Number of the line, from 1 to ``lines``; 0 for a scan without echoes.
        lines: Number of lines of the scan; 0 for a scan without echoes.
        echoes: None for a scan without echoes.
    """

    sensor_type: ClassVar[str] = "Echoes"

    name: str
    line: int
    lines: int
    echoes: TargetEchoes | None

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message."""
        empty = message.get("Echoes") is None
        return cls(
            message.number_or_nan("Time"),
            message.name,
            int(message.parse("Line", parse_number)),
            int(message.parse("Lines", parse_number)),
            None if empty else TargetEchoes.decode(message),
        )

    @staticmethod
    def fields(_: Dialect, fixed: tuple[str, Fields]) -> Fields:
        """Return the fields after time and type, with marks for numbers."""
        name, echoes = fixed
        counts = (("Line", WHOLE), ("Lines", WHOLE))
        return (("Name", reduce_text(name)), *counts, *echoes)

    def split(self, dialect: Dialect) -> Split:
        """Return the template of the line, its numbers, and its series."""
        numbers = (self.time, self.line, self.lines)
        is_unstamped, seen = math.isnan(self.time), self.echoes
        if seen is None:
            fixed: tuple[str, Fields] = (self.name, ())
            line = build_template(EchoLine, dialect, is_unstamped, fixed)
            return line, numbers, NO_SERIES
        properties = seen.properties()
        head = build_head(dialect, is_unstamped, self.name, properties)
        line = join_echoes(head, [find_mark(dialect, kind) for kind in seen.kinds])
        # The sign of a zero is taken off, except for that of a range.
        columns = (seen.beams, seen.ranges, seen.power + 0.0, seen.strength + 0.0)
        series: Floats = np.column_stack(columns).astype(np.float64).ravel()
        return line, (*numbers, *properties.numbers), series


def build_head(
    dialect: Dialect, is_unstamped: bool, scanner: str, properties: ObjectProperties
) -> bytes:
    """Return the template of a line up to its first echo.

    Its numbers are the time, which is skipped if there is none, the number of the line,
    that of lines, and those of the properties.

    Args:
        dialect: Dialect of the line.
        is_unstamped: Whether there is no time.
        scanner: Name of the scanner.
        properties: What is told of the object.
    """
    # A mark stands for the echoes, and is taken off.
    fields = (*properties.fields(dialect), ("Echoes", WHOLE))
    line = build_template(EchoLine, dialect, is_unstamped, (scanner, fields))
    return line.removesuffix(WHOLE.encode("latin-1") + _END)


@lru_cache(100)  # kinds may be those of another server
def find_mark(dialect: Dialect, kind: str) -> bytes:
    """Return the template of an echo: beam, range, power and strength in the series."""
    before = f"{WHOLE_IN_SERIES},{series_marks(dialect.ranges)}"
    after = series_marks(dialect.plain, 2)
    return f"{before},{reduce_text(kind.capitalize())},{after}".encode("latin-1")


def join_echoes(head: bytes, echoes: Sequence[bytes]) -> bytes:
    """Return the template of a line.

    Args:
        head: From ``build_head``.
        echoes: One or more from ``find_mark``.
    """
    return head + b" ".join(echoes) + _END


def _parse_echoes(text: str) -> tuple[tuple[str, ...], Floats]:
    """Parse the echoes of a line, all at once: there are hundreds in each scan.

    Returns:
        Kinds, and (E, 4) beams, ranges, powers and strengths.
    """
    words = text.split()
    for word in words:
        if word.count(",") != 4:
            raise MalformedMessage(f"echo {word[:80]!r}, expected five parts")
    parts = ",".join(words).split(",")
    kinds = tuple([kind.lower() for kind in parts[2::5]])
    del parts[2::5]
    numbers = parse_words(parts, ",".join(parts))
    return kinds, np.array(numbers).reshape(-1, 4)


def _parse_density(text: str) -> float:
    return math.inf if text.lower() == OPAQUE.lower() else parse_number(text)
