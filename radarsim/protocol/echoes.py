"""Echo lines and target lines: all that one scan of a radar, or one turn, met.

Each echo line reports the echoes of one scan on one object. It names all properties of
the object, so that a client can use it by itself. Names come from maps and from other
clients; they are reduced to characters that a line can contain.

Target lines report what the detector of a radar found in one turn. They are the targets
of a spectrum: a beam can have many, and each has a power. The objects behind them are
unknown, to a real radar as well.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from radarsim.errors import MalformedMessage
from radarsim.geometry import Floats
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.fields import (
    Field,
    Flag,
    ItemReport,
    Number,
    PrintableText,
    Segment,
    Whole,
    fields_of,
)
from radarsim.protocol.line_template import (
    LINE_END,
    WHOLE_IN_SERIES,
    marks,
    reduce_text,
    series_marks,
)
from radarsim.protocol.message import Message, parse_list, parse_number

# A line has at most 4095 bytes. An echo takes up to 37 of them (six digits of the beam,
# nine of the range), two names twice the longest, and everything else less than 300.
ECHOES_A_LINE: Final = 90
# A target takes up to 29 (six digits of the beam, ten of the range and of the power).
TARGETS_A_LINE: Final = 130
LARGEST_DENSITY: Final = 1e9  # no beam enters denser materials
OPAQUE: Final = "Opaque"

_END: Final = f"}}{LINE_END}".encode("latin-1")


class Density(Field[float]):
    """Power that a beam loses per metre; a word where no beam enters."""

    def read(self, message: Message) -> float:
        return message.parse(self.key, _parse_density)

    def write(self, value: float, dialect: Dialect) -> Sequence[Segment]:
        if value == math.inf:
            return (Segment(self.key, OPAQUE),)
        number = min(value, LARGEST_DENSITY)
        return (Segment(self.key, marks(dialect.plain), (number,)),)


class FixedFlag(Flag):
    """A truth value that stays the same for all echoes of an object."""

    def write(self, value: bool, _: Dialect) -> Sequence[Segment]:
        return (Segment(self.key, str(value)),)


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

    object: Annotated[str, PrintableText("Object")]
    material: Annotated[str, PrintableText("Material")]
    density: Annotated[float, Density("Density")]
    transparency: Annotated[float, Number("Transparency", "plain")]
    laser_passes: Annotated[bool, FixedFlag("LaserPasses")]
    robot_passes: Annotated[bool, FixedFlag("RobotPasses")]
    beams: NDArray[np.int64]
    ranges: Floats
    kinds: tuple[str, ...]
    power: Floats
    strength: Floats

    def properties(self, dialect: Dialect) -> Sequence[Segment]:
        """Return the segments about the object."""
        return [
            segment
            for name, field in fields_of(TargetEchoes)
            for segment in field.write(getattr(self, name), dialect)
        ]


class SeenEchoes(Field[TargetEchoes | None]):
    """Echoes, after the properties of their object."""

    def read(self, message: Message) -> TargetEchoes | None:
        if message.get(self.key) is None:
            return None
        kinds, numbers = _parse_echoes(message.require(self.key))
        properties = [field.read(message) for _, field in fields_of(TargetEchoes)]
        beams = numbers[:, 0].astype(np.int64)
        ranges, power, strength = numbers[:, 1:].T
        create: Callable[..., TargetEchoes] = TargetEchoes
        return create(*properties, beams, ranges, kinds, power, strength)

    def write(self, value: TargetEchoes | None, dialect: Dialect) -> Sequence[Segment]:
        if value is None:
            return ()
        # The sign of a zero is taken off, except for that of a range.
        columns = (value.beams, value.ranges, value.power + 0.0, value.strength + 0.0)
        series: Floats = np.column_stack(columns).astype(np.float64).ravel()
        echoes = b" ".join([find_mark(dialect, kind) for kind in value.kinds])
        text = echoes.decode("latin-1")
        return (*value.properties(dialect), Segment(self.key, text, series=series))


class EchoLine(ItemReport):
    """Echoes of one scan, as many as fit into a line.

    Attributes:
        line: Number of the line, from 1 to ``lines``; 0 for a scan without echoes.
        lines: Number of lines of the scan; 0 for a scan without echoes.
        echoes: None for a scan without echoes.
    """

    sensor_type: ClassVar[str] = "Echoes"

    line: Annotated[int, Whole("Line")]
    lines: Annotated[int, Whole("Lines")]
    echoes: Annotated[TargetEchoes | None, SeenEchoes("Echoes")]


# The template of an echo line up to its first echo, and its numbers after three: the
# time, the number of the line, and that of lines.
LineHead: TypeAlias = tuple[bytes, Sequence[float]]


def build_head(dialect: Dialect, scanner: str, target: TargetEchoes) -> LineHead:
    """Return what all lines of a scanner about an object share.

    Args:
        dialect: Dialect of the line.
        scanner: Name of the scanner.
        target: The object; its echoes do not matter.
    """
    line, numbers, _ = EchoLine(0.0, scanner, 0, 0, target).split(dialect)
    head, key, _ = line.rpartition(b"{Echoes")
    return head + key + b" ", numbers[3:]


@lru_cache(100)  # kinds may be those of another server
def find_mark(dialect: Dialect, kind: str) -> bytes:
    """Return the template of an echo: beam, range, power and strength in the series."""
    before = f"{WHOLE_IN_SERIES},{series_marks(dialect.ranges)}"
    after = series_marks(dialect.plain, 2)
    return f"{before},{reduce_text(kind.capitalize())},{after}".encode("latin-1")


def join_echoes(head: bytes, echoes: Sequence[bytes]) -> bytes:
    """Return the template of a line of one or more echoes from ``find_mark``."""
    return head + b" ".join(echoes) + _END


class RadarTargets(ItemReport, eq=False):
    """Targets of one turn of a radar, as many as fit into a line.

    Attributes:
        line: Number of the line, from 1 to ``lines``; 0 for a turn without targets.
        lines: Number of lines of the turn; 0 for one without targets.
        beams: (T,) int64, beam of each target, counted from 0 at the right.
        ranges: (T,) m.
        dbm: (T,) received power, dBm.
    """

    sensor_type: ClassVar[str] = "RadarTargets"

    line: Annotated[int, Whole("Line")]
    lines: Annotated[int, Whole("Lines")]
    beams: NDArray[np.int64]
    ranges: Floats
    dbm: Floats

    @classmethod
    def _read(cls, message: Message) -> list[Any]:
        parts = _split_parts("target", message.get("Targets") or "", 3, "three numbers")
        numbers = (_parse_parts(parts) if parts else np.zeros(0)).reshape(-1, 3)
        name, line, lines = (field.read(message) for _, field in fields_of(cls))
        return [name, line, lines, numbers[:, 0].astype(np.int64), *numbers[:, 1:].T]

    def segments(self, dialect: Dialect) -> Sequence[Segment]:
        segments = ItemReport.segments(self, dialect)
        if not len(self.beams):
            return segments
        target = f"{WHOLE_IN_SERIES},{series_marks(dialect.ranges, 2)}"
        text = " ".join([target] * len(self.beams))
        columns = np.column_stack((self.beams, self.ranges, self.dbm))
        series: Floats = columns.astype(np.float64).ravel()
        return (*segments, Segment("Targets", text, series=series))


def target_lines(
    time: float, scanner: str, beams: NDArray[np.int64], ranges: Floats, dbm: Floats
) -> Sequence[RadarTargets]:
    """Return the target lines of a turn, at least one.

    Args:
        time: s.
        scanner: Name of the scanner item.
        beams: (T,) beam of each target.
        ranges: (T,) m.
        dbm: (T,) dBm.
    """
    count = -(-len(beams) // TARGETS_A_LINE)
    if not count:
        return [RadarTargets(time, scanner, 0, 0, beams, ranges, dbm)]
    lines = []
    for number in range(count):
        some = slice(number * TARGETS_A_LINE, (number + 1) * TARGETS_A_LINE)
        columns = beams[some], ranges[some], dbm[some]
        lines.append(RadarTargets(time, scanner, number + 1, count, *columns))
    return lines


def _parse_echoes(text: str) -> tuple[tuple[str, ...], Floats]:
    """Parse the echoes of a line, all at once: there are hundreds in each scan.

    Returns:
        Kinds, and (E, 4) beams, ranges, powers and strengths.
    """
    parts = _split_parts("echo", text, 5, "five parts")
    kinds = tuple([kind.lower() for kind in parts[2::5]])
    del parts[2::5]
    return kinds, _parse_parts(parts).reshape(-1, 4)


def _split_parts(what: str, text: str, count: int, expected: str) -> list[str]:
    """Return the parts of all words of a text; each word has so many."""
    words = text.split()
    # All words are checked before they are joined: a part too few in one and too many
    # in the next would shift everything between them unnoticed.
    for word in words:
        if word.count(",") != count - 1:
            raise MalformedMessage(f"{what} {word[:80]!r}, expected {expected}")
    return ",".join(words).split(",") if words else []


def _parse_parts(parts: Sequence[str]) -> Floats:
    text = ",".join(parts)
    if not all(parts):  # a list would have one number less
        raise MalformedMessage(f"{text[:80]!r}, expected numbers")
    return parse_list(text)


def _parse_density(text: str) -> float:
    return math.inf if text.lower() == OPAQUE.lower() else parse_number(text)
