"""Reports that are sent many times, and written from a template.

Between two readings of an item only numbers in its line change. Its template is made
once for each item and dialect. Where the numbers of many reports are computed together,
a ``ReportGroup`` stands for the reports, and none of them has to exist.
"""

from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, ClassVar, Final, NamedTuple, Self, TypeAlias

from radarsim.geometry import Floats
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.line_template import SKIPPED, Fields, fill, marks, template
from radarsim.protocol.message import Message

MOST_TEMPLATES: Final = 4096  # that are kept; a robot has about ten

Split: TypeAlias = tuple[bytes, tuple[float, ...], Floats]


class PeriodicReport:
    """A report that is sent many times, each time with the same template."""

    __slots__ = ()

    @abstractmethod
    def split(self, dialect: Dialect) -> Split:
        """Return the template of the line, its numbers, and its series.

        Both are in the order of their marks, and the series is an array.

        Raises:
            ValueError: If a number that is part of the template is not finite.
        """

    def encode(self, dialect: Dialect) -> str:
        """Write the report as one line without its end.

        Raises:
            ValueError: If a number is not finite.
        """
        return fill(*self.split(dialect)).removesuffix("\r\n")


class NumberedReport(PeriodicReport):
    """A report that follows from numbers, and from what stays the same in many."""

    __slots__ = ()

    @classmethod
    @abstractmethod
    def template(cls, dialect: Dialect, fixed: Any) -> bytes:
        """Return the template of lines with a time stamp, if the dialect has one.

        Args:
            dialect: Dialect of the line.
            fixed: What stays the same, as names and counts.
        """

    @classmethod
    @abstractmethod
    def build(cls, fixed: Any, numbers: Iterator[float]) -> Self:
        """Create a report from its numbers, which are taken from ``numbers``."""


class ReportForm(NamedTuple):
    """All of a report but its numbers.

    Attributes:
        report: Class of the report.
        fixed: What stays the same, as its ``template`` takes it.
    """

    report: type[NumberedReport]
    fixed: Any


class ReportGroup:
    """Reports of one robot that are sent together, again and again.

    Attributes:
        forms: The reports, in the order of their lines.
        dialect: The dialect of their lines.
    """

    def __init__(self, forms: Iterable[ReportForm], dialect: Dialect) -> None:
        self.forms = tuple(forms)
        self.dialect = dialect

    @cached_property
    def template(self) -> bytes:
        """The templates of the lines, after each other."""
        return b"".join([report.template(self.dialect, x) for report, x in self.forms])

    def build(self, numbers: Iterable[float]) -> tuple[Any, ...]:
        """Return the reports; ``numbers`` are those of all of them."""
        each = iter(numbers)
        return tuple(report.build(fixed, each) for report, fixed in self.forms)


@dataclass(frozen=True, slots=True, eq=False)
class SensorReport(PeriodicReport, ABC):
    """One reading.

    Attributes:
        sensor_type: Value of ``Type`` on the wire.
        time: Simulated time, s; NaN if the line has none.
    """

    sensor_type: ClassVar[str]

    time: float

    @classmethod
    @abstractmethod
    def decode(cls, message: Message) -> Self:
        """Read the report from its message.

        Raises:
            MalformedMessage: If a field is missing or not readable.
        """

    @staticmethod
    @abstractmethod
    def fields(dialect: Dialect, fixed: Any) -> Fields:
        """Return the fields after time and type, without what changes in them.

        Args:
            dialect: Dialect of the line.
            fixed: Names, counts and choices that stay the same for many readings.

        Raises:
            ValueError: If a number among them is not finite.
        """

    @staticmethod
    def has_time(_: Dialect) -> bool:
        """Return whether the lines of a dialect have a time stamp."""
        return True

    @classmethod
    def template(cls, dialect: Dialect, fixed: Any) -> bytes:
        """Return the template of lines with a time stamp, if the dialect has one."""
        return find_template(cls, dialect, False, fixed)


def build_template(
    report: type[SensorReport], dialect: Dialect, is_unstamped: bool, fixed: Hashable
) -> bytes:
    """Return the template of a report's line; the first number is the time.

    Args:
        report: Class of the report.
        dialect: Dialect of the line.
        is_unstamped: Whether the time is NaN.
        fixed: What ``fields`` of the class take.

    Raises:
        ValueError: If a number in ``fixed`` is not finite.
    """
    fields = (("Type", report.sensor_type), *report.fields(dialect, fixed))
    if is_unstamped or not report.has_time(dialect):
        return template(f"SEN{SKIPPED}", fields)
    return template("SEN", (("Time", marks(dialect.time)), *fields))


find_template = lru_cache(MOST_TEMPLATES)(build_template)
