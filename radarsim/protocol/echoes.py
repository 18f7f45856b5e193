"""Echo lines with the echoes of one scan, and target lines with radar detections.

Each echo line reports the echoes of one scan on one object. It names all properties of
the object, so that a client can use one line without the others. Names come from maps
and from other clients; they are reduced to characters that a line can contain.

Target lines report the detections of a radar in one revolution, as peaks of its range
spectra: a beam can have many targets, each with a power. As with a real radar, targets
do not identify the objects that caused them.
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

# A line has at most 4095 bytes. An echo takes up to 37 bytes (six digits of the beam,
# nine of the range), two names up to 210 each, and everything else less than 300.
ECHOES_A_LINE: Final = 90
# A target takes up to 29 bytes of a line with 4095: six digits of the beam, ten of the
# range, and ten of the power.
TARGETS_A_LINE: Final = 130
LARGEST_DENSITY: Final = 1e9  # no beam enters a denser material
OPAQUE: Final = "Opaque"

_END: Final = f"}}{LINE_END}".encode("latin-1")


class Density(Field[float]):
    """A field with a beam's power loss per metre; infinity is written as ``Opaque``."""

    def read(self, message: Message) -> float:
        return message.parse(self.key, _parse_density)

    def write(self, value: float, dialect: Dialect) -> Sequence[Segment]:
        if value == math.inf:
            return (Segment(self.key, OPAQUE),)
        number = min(value, LARGEST_DENSITY)
        return (Segment(self.key, marks(dialect.plain), (number,)),)


class FixedFlag(Flag):
    """A Boolean property of an object, written as fixed text of a line template."""

    def write(self, value: bool, _: Dialect) -> Sequence[Segment]:
        return (Segment(self.key, str(value)),)


@dataclass(frozen=True, slots=True, eq=False)
class TargetEchoes:
    """The echoes of one object, with the properties of the object and its material.

    Attributes:
        object: Name of the object in the map, or of a robot; any text.
        material: Name of the material; any text.
        density: Power loss of a beam per metre of the material; ``math.inf`` is opaque.
        transparency: Fraction of a beam's power that one metre of the material, or a
            sheet, transmits, 0 to 1.
        laser_passes: Whether a laser beam passes through the object.
        robot_passes: Whether robots can drive through the object.
        beams: (E,) beam index of each echo, counted from 0 at the right.
        ranges: (E,) range of each echo, m.
        kinds: Kind of each echo: enter, leave, sheet, hit or spent.
        power: (E,) fraction of the beam's power on arrival, 0 to 1.
        strength: (E,) fraction of the beam's power that is reflected back, 0 to 1.
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
        """Return the segments with the properties of the object and the material."""
        return [
            segment
            for name, field in fields_of(TargetEchoes)
            for segment in field.write(getattr(self, name), dialect)
        ]


class SeenEchoes(Field[TargetEchoes | None]):
    """A field with the properties of an object, followed by its echoes."""

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
        # Adding 0.0 turns -0.0 into 0.0; ranges may stay -0.0.
        columns = (value.beams, value.ranges, value.power + 0.0, value.strength + 0.0)
        series: Floats = np.column_stack(columns).astype(np.float64).ravel()
        echoes = b" ".join([find_mark(dialect, kind) for kind in value.kinds])
        text = echoes.decode("latin-1")
        return (*value.properties(dialect), Segment(self.key, text, series=series))


class EchoLine(ItemReport):
    """A line with up to ``ECHOES_A_LINE`` echoes of one object in one scan.

    Attributes:
        line: Number of the line, from 1 to ``lines``; 0 for a scan without echoes.
        lines: Count of lines of the scan; 0 for a scan without echoes.
        echoes: The echoes and the object; None for a scan without echoes.
    """

    sensor_type: ClassVar[str] = "Echoes"

    line: Annotated[int, Whole("Line")]
    lines: Annotated[int, Whole("Lines")]
    echoes: Annotated[TargetEchoes | None, SeenEchoes("Echoes")]


# The template of an echo line up to its first echo, and the numbers in it, without the
# first three: the time, the number of the line, and the count of lines.
LineHead: TypeAlias = tuple[bytes, Sequence[float]]


def build_head(dialect: Dialect, scanner: str, target: TargetEchoes) -> LineHead:
    """Return the common start of all echo lines of one scanner and one object.

    Args:
        dialect: Dialect of the line.
        scanner: Name of the scanner.
        target: The object; its echoes are ignored.
    """
    line, numbers, _ = EchoLine(0.0, scanner, 0, 0, target).split(dialect)
    head, key, _ = line.rpartition(b"{Echoes")
    return head + key + b" ", numbers[3:]


@lru_cache(100)  # limited, because lines from other servers may have any kinds
def find_mark(dialect: Dialect, kind: str) -> bytes:
    """Return the text of one echo, with placeholders for beam, range and powers."""
    before = f"{WHOLE_IN_SERIES},{series_marks(dialect.ranges)}"
    after = series_marks(dialect.plain, 2)
    return f"{before},{reduce_text(kind.capitalize())},{after}".encode("latin-1")


def join_echoes(head: bytes, echoes: Sequence[bytes]) -> bytes:
    """Return the template of an echo line from its start and its echo templates."""
    return head + b" ".join(echoes) + _END


class RadarTargets(ItemReport, eq=False):
    """A line with up to ``TARGETS_A_LINE`` targets of one revolution of a radar.

    Attributes:
        line: Number of the line, from 1 to ``lines``; 0 if there are no targets.
        lines: Count of lines of the revolution; 0 if there are no targets.
        beams: (T,) int64, beam index of each target, counted from 0 at the right.
        ranges: (T,) range of each target, m.
        dbm: (T,) received power of each target, dBm.
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
    """Return the lines with the targets of one radar revolution, at least one line.

    Args:
        time: Simulated time, s.
        scanner: Name of the scanner item.
        beams: (T,) beam index of each target.
        ranges: (T,) range of each target, m.
        dbm: (T,) received power of each target, dBm.
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
    """Parse the echoes of a line in one pass, since a scan has hundreds of echoes.

    Returns:
        Kinds, and (E, 4) beams, ranges, powers and strengths.
    """
    parts = _split_parts("echo", text, 5, "five values")
    kinds = tuple([kind.lower() for kind in parts[2::5]])
    del parts[2::5]
    return kinds, _parse_parts(parts).reshape(-1, 4)


def _split_parts(what: str, text: str, count: int, expected: str) -> list[str]:
    """Split a text into words of ``count`` comma-separated parts; return all parts."""
    words = text.split()
    # All words are checked before they are joined. Otherwise a missing part in one word
    # and an extra part in a later one would shift all parts between them unnoticed.
    for word in words:
        if word.count(",") != count - 1:
            raise MalformedMessage(f"{what} {word[:80]!r}, expected {expected}")
    return ",".join(words).split(",") if words else []


def _parse_parts(parts: Sequence[str]) -> Floats:
    text = ",".join(parts)
    if not all(parts):  # parse_list would skip an empty part
        raise MalformedMessage(f"{text[:80]!r}, expected numbers")
    return parse_list(text)


def _parse_density(text: str) -> float:
    return math.inf if text.lower() == OPAQUE.lower() else parse_number(text)
