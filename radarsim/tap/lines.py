"""Lines as they are overheard: who said them, where, and whether scans are in them."""

import re
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

Side: TypeAlias = Literal["client", "server"]  # who says something
Part: TypeAlias = Literal["ranges", "echoes"]

_PARTS: Final[dict[str, Part]] = {"rangescanner": "ranges", "echoes": "echoes"}
_TYPE: Final = re.compile(
    r"SEN\b.*?\{\s*Type\s+(RangeScanner|Echoes)\s*\}", re.IGNORECASE
)


@dataclass(frozen=True, slots=True)
class Line:
    """A line.

    Attributes:
        number: Of the connection.
        side: Who says it.
        text: Without its end.
        part: What it holds of a scan; None for any other line.
    """

    number: int
    side: Side
    text: str
    part: Part | None


def read_line(number: int, side: Side, text: str) -> Line:
    """Find out whether a line holds something of a scan, without reading it.

    >>> read_line(1, "server", "SEN {Time 2} {Type RangeScanner} {Name a} ...").part
    'ranges'
    """
    found = _TYPE.match(text) if side == "server" else None
    return Line(number, side, text, _PARTS[found[1].lower()] if found else None)
