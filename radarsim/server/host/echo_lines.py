"""Write the echoes of scans as lines, object by object.

A scan can have a hundred lines of a few echoes each, in which hardly more than the
numbers are new. The fields of an object are kept. One call of the engine sorts the
echoes of a scan by object, and another one writes all its lines.
"""

from collections.abc import Callable, Mapping
from dataclasses import astuple
from functools import lru_cache
from typing import Any, Final

import numpy as np

from radarsim.engine import engine
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
from radarsim.protocol.line_template import fill_lines
from radarsim.protocol.reports import to_bytes
from radarsim.sensors.scan import KINDS, Echoes

MOST_SENSORS: Final = 100  # that are kept; clients can change their settings
MOST_HEADS: Final = 2000  # of a sensor; robots come and go


def describe_target(
    echoes: Echoes, part: int, robot_names: Mapping[int, str]
) -> TargetEchoes:
    """Return the object that a part belongs to, without echoes.

    Args:
        echoes: Echoes of the scan.
        part: As in ``Echoes.parts``.
        robot_names: Names of the robots, by their numbers.
    """
    target = echoes.target(part, robot_names)
    nothing = np.zeros(0)
    beams = nothing.astype(np.int64)
    own: tuple[Any, ...] = (*astuple(target), beams, nothing, (), nothing, nothing)
    return TargetEchoes(*own)


@lru_cache
def _find_marks(dialect: Dialect) -> dict[int, bytes]:
    """Return the template of an echo of each kind."""
    return {int(kind): find_mark(dialect, name) for kind, name in KINDS.items()}


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
        """
        written = np.zeros(len(echoes), engine.rows["WrittenEcho"])
        rows = np.zeros(len(echoes), engine.rows["EchoRows"])
        columns = echoes.parts, echoes.beams, echoes.fronts, echoes.power
        count = engine.sort_echoes(
            *[np.ascontiguousarray(each) for each in (*columns, echoes.strength)],
            echoes.settings.penetration_power,
            ECHOES_A_LINE,
            written,
            rows,
        )
        if not count:
            return to_bytes([EchoLine(time, scanner, 0, 0, None).encode(dialect)])
        marks = _find_marks(dialect)
        texts = [marks[kind] for kind in echoes.kinds[rows["before"]].tolist()]
        heads = self._heads_of(dialect, scanner, echoes.settings)
        templates: list[bytes] = []
        numbers: list[float] = []
        for line, (part, start, end, _) in enumerate(rows[:count].tolist(), 1):
            if part not in heads:
                target = describe_target(echoes, part, self._robot_names())
                heads[part] = build_head(dialect, scanner, target)
            head, its_numbers = heads[part]
            templates.append(join_echoes(head, texts[start:end]))
            numbers += (time, line, count, *its_numbers)
        return fill_lines(templates, numbers, written.view(np.float64))

    def _heads_of(
        self, dialect: Dialect, scanner: str, settings: SensorSettings
    ) -> dict[int, LineHead]:
        """Return the kept heads of a sensor, by part."""
        if len(self._heads) > MOST_SENSORS:
            self._heads.clear()
        heads = self._heads.setdefault((dialect, scanner, settings), {})
        if len(heads) > MOST_HEADS:
            heads.clear()
        return heads
