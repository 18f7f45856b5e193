"""Writes the echoes of scans as lines, grouped by object.

A scan can have a hundred lines of a few echoes each, which differ from the last scan
mostly in numbers. So the start of each line, with the properties of the object, is
cached. One call of the engine sorts the echoes of a scan by object, and another call
writes all lines.
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

MOST_SENSORS: Final = 100  # cached sensors; each change of settings adds one
MOST_HEADS: Final = 2000  # cached objects per sensor; each new robot adds one


def describe_target(
    echoes: Echoes, part: int, robot_names: Mapping[int, str]
) -> TargetEchoes:
    """Return the properties of the object with a given part, without any echoes.

    Args:
        echoes: Echoes of the scan.
        part: Index of the part, see ``Echoes.parts``.
        robot_names: Names of the robots by number.
    """
    target = echoes.target(part, robot_names)
    nothing = np.zeros(0)
    beams = nothing.astype(np.int64)
    own: tuple[Any, ...] = (*astuple(target), beams, nothing, (), nothing, nothing)
    return TargetEchoes(*own)


@lru_cache
def _find_marks(dialect: Dialect) -> dict[int, bytes]:
    """Return the line template of one echo for each kind of echo."""
    return {int(kind): find_mark(dialect, name) for kind, name in KINDS.items()}


class EchoWriter:
    """Writes the echo lines for all scans of one simulation."""

    def __init__(self, robot_names: Callable[[], Mapping[int, str]]) -> None:
        """Start with an empty cache.

        Args:
            robot_names: Returns the names of the robots by number; numbers are never
                reused.
        """
        self._robot_names = robot_names
        self._heads: dict[tuple[Dialect, str, SensorSettings], dict[int, LineHead]] = {}

    def write(
        self, time: float, scanner: str, echoes: Echoes, dialect: Dialect
    ) -> bytes:
        """Return the echo lines of a scan, each with CRLF.

        Objects are sorted by their first beam, then by part. There is at least one
        line, so that a client knows when the echoes of a scan are complete.

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
        """Return the cached line starts of a sensor, by the index of the part."""
        if len(self._heads) > MOST_SENSORS:
            self._heads.clear()
        heads = self._heads.setdefault((dialect, scanner, settings), {})
        if len(heads) > MOST_HEADS:
            heads.clear()
        return heads
