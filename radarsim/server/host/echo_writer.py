"""Write the echo lines of scans: those of ``echo_lines``, at a fraction of its work.

A scan can have a hundred lines of a few echoes each, in which hardly more than the
numbers are new. What is said of an object is kept, and all lines of a scan are written
in one compiled call.

Split the echoes of a scan into echo lines, object by object.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np

from radarsim.geometry import Floats
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.echoes import (
    ECHOES_A_LINE,
    ObjectProperties,
    build_head,
    find_mark,
    join_echoes,
)
from radarsim.protocol.line_writer import ReportBlock, encode_blocks, fill_block
from radarsim.protocol.reports import EchoLine, TargetEchoes
from radarsim.sensors.echoes import KINDS, ROBOT, Echoes, Target
from radarsim.server.host.echo_order import sort_into_lines

KIND_NAMES: Final = {int(kind): name for kind, name in KINDS.items()}


class EchoRows(NamedTuple):
    """Echoes in the order of their lines.

    Attributes:
        numbers: (E, 4) beam, range, m, share of the beam's power that is left on
            arrival, and share of the beam that is reflected back, both 0 to 1.
        kinds: Number of the kind of each.
        lines: Of each line the part, its first row, and the row after its last.
    """

    numbers: Floats
    kinds: list[int]
    lines: list[list[int]]

    @classmethod
    def of(cls, echoes: Echoes) -> "EchoRows":
        """Sort echoes into lines of one part each, as many as fit into a line.

        Parts are in the order of their first beam, and of their numbers for the same.
        """
        numbers, order, lines = sort_into_lines(
            *(echoes.parts, echoes.beams, echoes.fronts, echoes.power, echoes.strength),
            *(echoes.settings.penetration_power, ECHOES_A_LINE),
        )
        return cls(numbers, echoes.kinds[order].tolist(), lines.tolist())


def echo_lines(
    time: float, scanner: str, echoes: Echoes, robot_names: Mapping[int, str]
) -> tuple[EchoLine, ...]:
    """Return the echo lines of a scan.

    Objects are in the order of their first beam, and of their parts for the same beam.

    Args:
        time: Time of the scan, s.
        scanner: Name of the scanner item.
        echoes: Echoes of the scan.
        robot_names: Names of the robots, by their numbers.

    Returns:
        At least one line, so that a client knows when it has all lines of a scan.
    """
    rows = EchoRows.of(echoes)
    count = len(rows.lines)
    if not count:
        return (EchoLine(time, scanner, 0, 0, None),)
    lines = []
    for number, (part, start, end) in enumerate(rows.lines, start=1):
        target = find_target(echoes, part, robot_names)
        seen = _target_echoes(target, rows, slice(start, end))
        lines.append(EchoLine(time, scanner, number, count, seen))
    return tuple(lines)


def find_target(echoes: Echoes, part: int, robot_names: Mapping[int, str]) -> Target:
    """Return the object that a part belongs to.

    Args:
        echoes: Echoes of the scan.
        part: As in ``Echoes.parts``.
        robot_names: Names of the robots, by their numbers.
    """
    count = len(echoes.scene_parts)
    if part >= count:
        return Target.of(robot_names[part - count], ROBOT, echoes.settings)
    found = echoes.scene_parts[part]
    return Target.of(found.object_name, found.material, echoes.settings)


def _target_echoes(target: Target, echoes: EchoRows, rows: slice) -> TargetEchoes:
    return TargetEchoes(
        object=target.object,
        material=target.material,
        density=target.density,
        transparency=target.transparency,
        laser_passes=target.laser_passes,
        robot_passes=target.robot_passes,
        beams=echoes.numbers[rows, 0].astype(np.int64),
        ranges=echoes.numbers[rows, 1],
        kinds=tuple([KIND_NAMES[kind] for kind in echoes.kinds[rows]]),
        power=echoes.numbers[rows, 2],
        strength=echoes.numbers[rows, 3],
    )


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
