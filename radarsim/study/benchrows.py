"""One figure of a benchmark, and how tables and programs are told about it."""

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Row:
    """One measurement.

    Attributes:
        group: A letter that tells what kind of figure this is.
        name: What was measured.
        value: The figure.
        unit: ``x`` for a ratio, else ``ms``, ``us``, ``1/s``, ``MiB``, ``%``.
        limit: The most that it may be; None for a figure without a target.
        note: What else is to be known, in words.
    """

    group: str
    name: str
    value: float
    unit: str
    limit: float | None = None
    note: str = ""

    @property
    def within(self) -> bool | None:
        """Whether the figure keeps its limit; None without one."""
        return None if self.limit is None else self.value <= self.limit

    def to_dict(self) -> dict[str, Any]:
        """Give what JSON can hold."""
        return {**asdict(self), "within": self.within}


GROUPS = {
    "a": "a radar scan against one raw first-hit call on the same rays",
    "b": "all hits of the same rays by Open3D, against the radar scan",
    "c": "scans per second, and threads",
    "d": "what a scan costs as scenes, beams and robots grow",
    "e": "the server over loopback TCP",
    "f": "start-up, best of five",
    "g": "beams of many rays, against as many scans that draw one of these rays",
    "h": "mirrors, and leaves",
}
