"""Write the echoes of scans as lines, object by object.

A scan can have a hundred lines of a few echoes each, in which hardly more than the
numbers are new. What is said of an object is kept, and all lines of a scan are written
in one compiled call.
"""

from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np

from radarsim.geometry import Floats
from radarsim.presets.sensor_settings import SensorSettings
from radarsim.protocol.dialect import Dialect
from radarsim.protocol.echoes import (
    ECHOES_A_LINE,
    EchoLine,
    LineHead,
    TargetEchoes,
    build_head,
    find_mark,
    join_echoes,
)
from radarsim.protocol.line_writer import fill_lines
from radarsim.protocol.reports import to_bytes
from radarsim.sensors.echoes import KINDS, ROBOT, Echoes, Target
from radarsim.server.host.echo_order import sort_into_lines

KIND_NAMES: Final = {int(kind): name for kind, name in KINDS.items()}
MOST_SENSORS: Final = 100  # that are kept; clients can change their settings
MOST_HEADS: Final = 2000  # of a sensor; robots come and go


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
            echoes.parts,
            echoes.beams,
            echoes.fronts,
            echoes.power,
            echoes.strength,
            echoes.settings.penetration_power,
            ECHOES_A_LINE,
        )
        return cls(numbers, echoes.kinds[order].tolist(), lines.tolist())


def describe_target(
    echoes: Echoes, part: int, robot_names: Mapping[int, str]
) -> TargetEchoes:
    """Return the object that a part belongs to, without echoes.

    Args:
        echoes: Echoes of the scan.
        part: As in ``Echoes.parts``.
        robot_names: Names of the robots, by their numbers.
    """
    count = len(echoes.scene_parts)
    if part >= count:
        target = Target.of(robot_names[part - count], ROBOT, echoes.settings)
    else:
        found = echoes.scene_parts[part]
        target = Target.of(found.object_name, found.material, echoes.settings)
    nothing = np.zeros(0)
    return TargetEchoes(
        object=target.object,
        material=target.material,
        density=target.density,
        transparency=target.transparency,
        laser_passes=target.laser_passes,
        robot_passes=target.robot_passes,
        beams=nothing.astype(np.int64),
        ranges=nothing,
        kinds=(),
        power=nothing,
        strength=nothing,
    )


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

        Objects are in the order of their first beam, and of their parts for the same
        beam. There is at least one line, so that a client knows when it has them all.

        Args:
            time: Time of the scan, s.
            scanner: Name of the scanner item.
            echoes: Echoes of the scan.
            dialect: Dialect of the lines.

        Raises:
            ValueError: If a number is not finite or does not fit into 32 bits.
        """
        rows = EchoRows.of(echoes)
        count = len(rows.lines)
        if not count:
            return to_bytes([EchoLine(time, scanner, 0, 0, None).encode(dialect)])
        marks = {kind: find_mark(dialect, name) for kind, name in KIND_NAMES.items()}
        written = [marks[kind] for kind in rows.kinds]
        heads = self._heads_of(dialect, scanner, echoes.settings)
        templates: list[bytes] = []
        numbers: list[float] = []
        for line, (part, start, end) in enumerate(rows.lines, start=1):
            if part not in heads:
                target = describe_target(echoes, part, self._robot_names())
                heads[part] = build_head(dialect, scanner, target)
            head = heads[part]
            templates.append(join_echoes(head, written[start:end]))
            numbers += (time, line, count, *head.numbers)
        return fill_lines(templates, numbers, rows.numbers.reshape(-1))

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
