"""Base classes of reports, and of fields that encode and decode their attributes.

An attribute of a report is annotated with its field, which defines key and format:

    velocities: Annotated[tuple[float, ...], Numbers("Vel", "plain")]

The format, here ``plain``, is the name of an attribute of the dialect. Fields are
written in the order of the attributes, or of ``layouts`` if dialects differ. They are
read in any order, with keys in any case.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from math import isnan, nan
from typing import (
    Annotated,
    Any,
    ClassVar,
    Final,
    Generic,
    Literal,
    NamedTuple,
    Self,
    TypeAlias,
    TypeVar,
    dataclass_transform,
    get_type_hints,
)

from radarsim.geometry import Floats, Pose2, Pose3
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.line_template import (
    LINE_END,
    LONGEST_NAME,
    NO_SERIES,
    POSITIVE,
    TRUTH,
    WHOLE,
    WRAPPED,
    NumberFormat,
    fill_lines,
    marks,
    printable_name,
    reduce_text,
    series_marks,
    vector_marks,
)
from radarsim.protocol.message import (
    Message,
    Triple,
    encode_segments,
    parse_flag,
    parse_flipped,
    parse_list,
    parse_number,
    parse_segments,
    parse_triple,
    wrapped_pose,
)

FormatName: TypeAlias = Literal[
    "time", "ranges", "angle", "truth", "ins", "plain", "mount", "robot", "mass"
]
# Maps the name of a dialect to the keys of a line in order; a key may have a constant.
Layouts: TypeAlias = Mapping[str, str]
Split: TypeAlias = tuple[bytes, Sequence[float], Floats]
Value = TypeVar("Value")


class Segment(NamedTuple):
    """One segment of a line, such as ``{Time 1.50}``: its key and its value.

    Attributes:
        key: The key.
        text: The value, with a mark for each number.
        numbers: The numbers of the marks outside the series.
        series: The numbers of the marks in the series.
    """

    key: str
    text: str
    numbers: Sequence[float] = ()
    series: Floats = NO_SERIES


class Field(ABC, Generic[Value]):
    """Encodes one attribute of a report in a line, and decodes it from a line."""

    def __init__(self, key: str) -> None:
        self.key = key

    @abstractmethod
    def read(self, message: Message) -> Value:
        """Return the value of the attribute from a parsed line.

        Raises:
            MalformedMessage: If the attribute is missing or not readable.
        """

    @abstractmethod
    def write(self, value: Value, dialect: Dialect) -> Sequence[Segment]:
        """Return the ``{Key value}`` segments of the attribute, usually one."""


class Text(Field[str]):
    """A field with a text from the server; empty if the line has no such field."""

    def read(self, message: Message) -> str:
        return message.get(self.key) or ""

    def write(self, value: str, _: Dialect) -> Sequence[Segment]:
        return (Segment(self.key, reduce_text(value)),)


class RequiredText(Text):
    """A field with a text from the server, which must not be missing from the line."""

    def read(self, message: Message) -> str:
        return message.require(self.key)


class PrintableText(RequiredText):
    """A field with a text from a user, which is reduced to printable characters."""

    def __init__(self, key: str, longest: int = LONGEST_NAME) -> None:
        super().__init__(key)
        self._longest = longest

    def write(self, value: str, _: Dialect) -> Sequence[Segment]:
        return (Segment(self.key, printable_name(value, self._longest)),)


class FormattedField(Field[Value]):
    """A field with numbers; an attribute of the dialect determines their format."""

    def __init__(self, key: str, format_name: FormatName) -> None:
        super().__init__(key)
        self._format_name = format_name

    def format(self, dialect: Dialect) -> NumberFormat:
        """Return the format of the field's numbers in a dialect."""
        number_format: NumberFormat = getattr(dialect, self._format_name)
        return number_format


class Number(FormattedField[float]):
    """A field with one number, and an optional default for lines without the field."""

    def __init__(
        self, key: str, format_name: FormatName, default: float | None = None
    ) -> None:
        super().__init__(key, format_name)
        self._default = default

    def read(self, message: Message) -> float:
        if self._default is None:
            return message.parse(self.key, parse_number)
        number = message.parse_optional(self.key, parse_number)
        return self._default if number is None else number

    def write(self, value: float, dialect: Dialect) -> Sequence[Segment]:
        number_format = self.format(dialect)
        number = number_format.cut_to_step(value)
        return (Segment(self.key, marks(number_format), (number,)),)


class Numbers(FormattedField[tuple[float, ...]]):
    """A field with any count of numbers, as a tuple."""

    def read(self, message: Message) -> tuple[float, ...]:
        return tuple(message.parse(self.key, parse_list).tolist())

    def write(self, value: tuple[float, ...], dialect: Dialect) -> Sequence[Segment]:
        return (Segment(self.key, marks(self.format(dialect), len(value)), value),)


class Series(FormattedField[Floats]):
    """A field with any count of numbers, as an array; a line has at most one array."""

    def read(self, message: Message) -> Floats:
        return message.parse(self.key, parse_list)

    def write(self, value: Floats, dialect: Dialect) -> Sequence[Segment]:
        text = series_marks(self.format(dialect), len(value))
        return (Segment(self.key, text, series=value),)


class Whole(Field[int]):
    """A field with one integer."""

    def read(self, message: Message) -> int:
        return int(message.parse(self.key, parse_number))

    def write(self, value: int, _: Dialect) -> Sequence[Segment]:
        return (Segment(self.key, WHOLE, (value,)),)


class Flag(Field[bool]):
    """A field with a Boolean, written as ``True`` or ``False``."""

    def read(self, message: Message) -> bool:
        return message.parse(self.key, parse_flag)

    def write(self, value: bool, _: Dialect) -> Sequence[Segment]:
        return (Segment(self.key, TRUTH, (value,)),)


class Extent(Numbers):
    """A field with three lengths, which have no sign to convert to the wire's axes."""

    def read(self, message: Message) -> Triple:
        return message.parse(self.key, parse_triple)


class Point(FormattedField[Triple]):
    """A field with x, y, z, written in the axes of the wire; NaN if missing."""

    def read(self, message: Message) -> Triple:
        return message.parse_optional(self.key, parse_flipped) or (nan, nan, nan)

    def write(self, value: Triple, dialect: Dialect) -> Sequence[Segment]:
        return (Segment(self.key, vector_marks(self.format(dialect)), value),)


class BodyAngles(Point):
    """A field with roll, pitch and yaw, wrapped to (-pi, pi] when it is written."""

    def write(self, value: Triple, dialect: Dialect) -> Sequence[Segment]:
        text = vector_marks(self.format(dialect), WRAPPED)
        return (Segment(self.key, text, value),)


class WheelPose(FormattedField[Pose2]):
    """A field with x, y and unwrapped yaw, written in the axes of the wire."""

    def read(self, message: Message) -> Pose2:
        x, y, yaw = message.parse(self.key, parse_triple)
        return Pose2(x, 0.0 - y, 0.0 - yaw)

    def write(self, value: Pose2, dialect: Dialect) -> Sequence[Segment]:
        # Vectors are written with inverted y and z, and the yaw takes the place of z.
        text = vector_marks(self.format(dialect))
        return (Segment(self.key, text, (value.x, value.y, value.yaw)),)


class Pose(FormattedField[Pose3]):
    """A field with the pose of a body, written as a position and an orientation."""

    def __init__(self, format_name: FormatName) -> None:
        super().__init__("Location", format_name)

    def read(self, message: Message) -> Pose3:
        position = message.parse(self.key, parse_flipped)
        return wrapped_pose(position, message.parse("Orientation", parse_flipped))

    def write(self, value: Pose3, dialect: Dialect) -> Sequence[Segment]:
        number_format, numbers = self.format(dialect), value.numbers()
        is_positive = self._format_name == "ins" and dialect.ins_angles_positive
        changes = WRAPPED + POSITIVE if is_positive else WRAPPED
        angles = vector_marks(number_format, changes)
        return (
            Segment(self.key, vector_marks(number_format), numbers[:3]),
            Segment("Orientation", angles, numbers[3:]),
        )


class Rows(Field[tuple[Any, ...]]):
    """A field with a list of items, such as sonars, that all have the same fields."""

    def __init__(self, *columns: Field[Any], layouts: Layouts | None = None) -> None:
        """Create the field of a list from the fields of one item.

        Args:
            columns: The fields of an item, the name first.
            layouts: Layout of an item in each dialect; None to write all fields.
        """
        super().__init__(columns[0].key)
        self._columns, self._layouts = columns, layouts or {}

    def read(self, message: Message) -> tuple[Any, ...]:
        columns = self._columns
        return tuple(
            tuple([column.read(item) for column in columns]) for item in message.items()
        )

    def write(self, value: tuple[Any, ...], dialect: Dialect) -> Sequence[Segment]:
        written: list[Segment] = []
        for row in value:
            segments = [
                segment
                for column, each in zip(self._columns, row, strict=True)
                for segment in column.write(each, dialect)
            ]
            written += lay_out(segments, self._layouts.get(dialect.name))
        return written


def lay_out(segments: Sequence[Segment], layout: str | None) -> Sequence[Segment]:
    """Return the segments of a line in the order of a layout, if there is a layout.

    Args:
        segments: Segments in the order of their fields.
        layout: See ``Layouts``; None for no layout.
    """
    if layout is None:
        return segments
    # Keys are matched in any case: the sonar layout of UDK has a key in lower case.
    found = {segment.key.lower(): segment for segment in segments}
    return [
        Segment(key, text) if text else found[key.lower()]._replace(key=key)
        for key, text in parse_segments(layout)
    ]


def join_items(segments: Iterable[Segment]) -> list[Segment]:
    """Join the segments of each item to one, as in ``{Name Front Range 1.5}``."""
    joined: list[Segment] = []
    for key, text, numbers, _ in segments:
        if key == "Name":
            joined.append(Segment(key, text, numbers))
        else:
            name = joined[-1]
            both = f"{name.text} {key} {text}"
            joined[-1] = Segment("Name", both, (*name.numbers, *numbers))
    return joined


_FIELDS: Final[dict[type, Sequence[tuple[str, Field[Any]]]]] = {}


def fields_of(report: type) -> Sequence[tuple[str, Field[Any]]]:
    """Return name and field of each annotated attribute of a report class, in order."""
    if report not in _FIELDS:
        hints = get_type_hints(report, include_extras=True)
        annotated = [
            (each.name, getattr(hints[each.name], "__metadata__", ()))
            for each in fields(report)
        ]
        _FIELDS[report] = [(name, data[0]) for name, data in annotated if data]
    return _FIELDS[report]


@dataclass_transform(frozen_default=True)
class LineReport:
    """Base class of reports, whose annotated attributes become fields of a line.

    Every subclass is a frozen dataclass. A subclass with arrays is declared with
    ``eq=False`` and compares by identity.

    Attributes:
        verb: First word of the line.
        layouts: Layout of the line after its verb, by dialect; without a layout, fields
            are written in the order of the attributes.
        item_keys: Keys that servers of some generations write into the segment of the
            item's name.
    """

    verb: ClassVar[str]
    layouts: ClassVar[Layouts] = {}
    item_keys: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, *, eq: bool = True) -> None:
        dataclass(frozen=True, eq=eq)(cls)

    @classmethod
    def decode(cls, message: Message) -> Self:
        """Create the report from the fields of a parsed line.

        Raises:
            MalformedMessage: If a field is missing or not readable.
        """
        create: Callable[..., Self] = cls
        return create(*cls._read(message))

    @classmethod
    def _read(cls, message: Message) -> list[Any]:
        if cls.item_keys:
            message = message.split_fields(*cls.item_keys)
        return [field.read(message) for _, field in fields_of(cls)]

    def segments(self, dialect: Dialect) -> Sequence[Segment]:
        """Return the ``{Key value}`` segments of the report's line in a dialect."""
        segments = [
            segment
            for name, field in fields_of(type(self))
            for segment in field.write(getattr(self, name), dialect)
        ]
        return lay_out(segments, self.layouts.get(dialect.name))

    def head(self, _: Dialect) -> str:
        """Return the first word of the report's line, such as ``SEN``."""
        return self.verb

    def split(self, dialect: Dialect) -> Split:
        """Return the template of the report's line, its numbers, and its array.

        Numbers and series are in the order of their marks.
        """
        numbers: list[float] = []
        series = NO_SERIES
        groups: list[tuple[str, str]] = []
        for key, text, its_numbers, its_series in self.segments(dialect):
            groups.append((key, text))
            numbers += its_numbers
            if its_series is not NO_SERIES:
                series = its_series
        line = encode_segments(self.head(dialect), groups)
        return f"{line}{LINE_END}".encode("latin-1"), numbers, series

    def encode(self, dialect: Dialect) -> str:
        """Encode the report as a line without a line end."""
        template, numbers, series = self.split(dialect)
        line = fill_lines([template], numbers, series)
        return line.removesuffix(b"\r\n").decode("ascii")

    def sources(self, dialect: Dialect) -> list[str]:
        """Return the names of attributes with numbers, in the order of the line."""
        found = [
            (name, field)
            for name, field in fields_of(type(self))
            if any(each.numbers for each in field.write(getattr(self, name), dialect))
        ]
        layout = self.layouts.get(dialect.name)
        if layout is not None:
            keys = [key for key, _ in parse_segments(layout)]
            # The jobs that compute readings write numbers by position in the line, so
            # attributes are sorted by the order of the layout.
            found.sort(key=lambda each: keys.index(each[1].key))
        return [name for name, _ in found]


class SensorReport(LineReport, eq=False):
    """Base class of the readings of one sensor, or of all sensors of one type.

    Attributes:
        sensor_type: Value of ``Type`` on the wire.
        time: Simulated time, s; NaN if the line has none.
    """

    verb: ClassVar[str] = "SEN"
    sensor_type: ClassVar[str]

    time: float

    @classmethod
    def decode(cls, message: Message) -> Self:
        create: Callable[..., Self] = cls
        return create(message.number_or_nan("Time"), *cls._read(message))

    def segments(self, dialect: Dialect) -> Sequence[Segment]:
        segments = LineReport.segments(self, dialect)
        if self.sensor_type in dialect.joined:
            segments = join_items(segments)
        sensor_type = Segment("Type", self.sensor_type)
        if isnan(self.time) or self.sensor_type in dialect.timeless:
            return (sensor_type, *segments)
        time = Segment("Time", marks(dialect.time), (self.time,))
        return (time, sensor_type, *segments)

    def sources(self, dialect: Dialect) -> list[str]:
        time = [] if self.sensor_type in dialect.timeless else ["time"]
        return time + LineReport.sources(self, dialect)


class ItemReport(SensorReport, eq=False):
    """Base class of the readings of one sensor.

    Attributes:
        name: Name of the item.
    """

    name: Annotated[str, Text("Name")]


class ReportGroup:
    """Reports of one robot that are always sent together, each time with new numbers.

    Attributes:
        samples: Reports with placeholder numbers, in the order of their lines.
        dialect: Dialect of the lines.
    """

    def __init__(self, samples: Iterable[LineReport], dialect: Dialect) -> None:
        self.samples = tuple(samples)
        self.dialect = dialect

    @cached_property
    def template(self) -> bytes:
        """The templates of all lines of the group, joined to one."""
        return b"".join([sample.split(self.dialect)[0] for sample in self.samples])
