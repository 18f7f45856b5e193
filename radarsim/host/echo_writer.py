"""Write the echo lines of scans: those of ``echo_lines``, at a fraction of its work.

A scan can have a hundred lines of a few echoes each, in which hardly more than the
numbers are new. What is said of an object is kept, and all lines of a scan are written
in one compiled call.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from radarsim.host.echo_reports import KIND_NAMES, EchoRows, echo_lines, find_target
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.echoes import (
    ObjectProperties,
    build_head,
    find_mark,
    join_echoes,
)
from radarsim.protocol.line_writer import ReportBlock, encode_blocks, fill_block
from radarsim.sensors.echoes import Echoes

MOST_SENSORS: Final = 100  # that are kept; clients can change their settings
MOST_HEADS: Final = 2000  # of a sensor; robots come and go


class LineHead(NamedTuple):
    """What all lines about an object share: the template up to the echoes, numbers."""

    template: bytes
    numbers: tuple[float, ...]


class EchoWriter:
    """Writes the echo lines of scans of one simulation."""

    def __init__(self, robot_names: Callable[[], Mapping[int, str]]) -> None:
        """Start without anything that is kept.

        Args:
            robot_names: Returns the names of the robots by their numbers, which no two
                robots ever share.
        """
        self._robot_names = robot_names
        self._heads: dict[tuple[Dialect, str, SensorSettings], dict[int, LineHead]] = {}

    def write(
        self, time: float, scanner: str, echoes: Echoes, dialect: Dialect
    ) -> bytes:
        """Return the echo lines of a scan, each with CRLF.

        Args:
            time: Time of the scan, s.
            scanner: Name of the scanner item.
            echoes: Echoes of the scan.
            dialect: Dialect of the lines.

        Raises:
            ValueError: If a number is not finite or does not fit into 32 bits.
        """
        rows = EchoRows.of(echoes)
        marks = {kind: find_mark(dialect, name) for kind, name in KIND_NAMES.items()}
        written = [marks[kind] for kind in rows.kinds]
        heads = self._heads_of(dialect, scanner, echoes.settings)
        templates: list[bytes] = []
        numbers: list[float] = []
        for line, (part, start, end) in enumerate(rows.lines, start=1):
            if part not in heads:
                heads[part] = self._make_head(dialect, scanner, echoes, part)
            head = heads[part]
            templates.append(join_echoes(head.template, written[start:end]))
            numbers += (time, line, len(rows.lines), *head.numbers)
        lines = fill_block(templates, numbers, rows.numbers.reshape(-1))
        if lines:
            return lines
        reports = echo_lines(time, scanner, echoes, self._robot_names())
        (lines,) = encode_blocks([ReportBlock(reports, dialect)])
        return lines

    def _heads_of(
        self, dialect: Dialect, scanner: str, settings: SensorSettings
    ) -> dict[int, LineHead]:
        """Return what is kept for a sensor, by part."""
        if len(self._heads) > MOST_SENSORS:
            self._heads.clear()
        heads = self._heads.setdefault((dialect, scanner, settings), {})
        if len(heads) > MOST_HEADS:
            heads.clear()
        return heads

    def _make_head(
        self, dialect: Dialect, scanner: str, echoes: Echoes, part: int
    ) -> LineHead:
        target = find_target(echoes, part, self._robot_names())
        properties = ObjectProperties(
            *(target.object, target.material, target.density, target.transparency),
            *(target.laser_passes, target.robot_passes),
        )
        template = build_head(dialect, False, scanner, properties)
        return LineHead(template, properties.numbers)
