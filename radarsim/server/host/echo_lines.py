"""Write the echoes of scans as lines, object by object.

A scan can have a hundred lines of a few echoes each, in which hardly more than the
numbers are new. What is said of an object is kept. One compiled call sorts the echoes
of a scan by object, and another one writes all its lines.
"""

import math
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.jit import njit_cached, njit_inline
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
from radarsim.sensors.scan import KINDS, ROBOT, Echoes, Target

_GOLDEN = 2654435761  # multiplies numbers so that their upper bits are spread


@njit_cached
def sort_into_lines(
    parts: NDArray[np.int64],
    beams: NDArray[np.int64],
    ranges: Floats,
    power: Floats,
    strength: Floats,
    full: float,
    echoes_a_line: int,
) -> tuple[Floats, NDArray[np.int64], NDArray[np.int64]]:
    """Sort echoes into lines of one part each, as many as fit into a line.

    Parts are in the order of their first beam, and of their numbers for the same; the
    echoes of a part by beam and range.

    Args:
        parts: (E,) part of each echo; echoes are sorted by beam.
        beams: (E,) beam of each.
        ranges: (E,) m.
        power: (E,) power that is left on arrival.
        strength: (E,) share of the beam that is reflected back.
        full: Full power of a beam.
        echoes_a_line: How many fit into a line.

    Returns:
        (E, 4) beam, range, share of the power and strength, both from 0 to 1, in the
        order of the lines; (E,) the former row of each; (L, 3) of each line the part,
        its first row, and the row after its last.
    """
    count = len(parts)
    group_of, firsts, sizes = _group(parts)
    ranks = _rank(parts, beams, firsts)
    lines = np.zeros((count, 3), np.int64)
    starts = np.zeros(len(firsts), np.int64)  # of each group
    places = np.zeros(len(firsts), np.int64)  # of the next echo of each group
    line, start = 0, 0
    for group in ranks:
        starts[group] = places[group] = start
        end = start + sizes[group]
        while start < end:
            last = min(end, start + echoes_a_line)
            lines[line, 0], lines[line, 1], lines[line, 2] = (
                parts[firsts[group]],
                start,
                last,
            )
            line, start = line + 1, last
    numbers, order = np.zeros((count, 4)), np.zeros(count, np.int64)
    for row in range(count):
        group, beam = group_of[row], float(beams[row])
        place = places[group]
        places[group] += 1
        # Insertion: echoes come sorted by beam already, and a beam has few of one part.
        while place > starts[group] and _follows(numbers[place - 1], beam, ranges[row]):
            for column in range(4):
                numbers[place, column] = numbers[place - 1, column]
            order[place] = order[place - 1]
            place -= 1
        order[place] = row
        numbers[place, 0], numbers[place, 1] = beam, ranges[row]
        numbers[place, 2] = _power_share(power[row], full)
        numbers[place, 3] = _clip_to_unit(strength[row])
    return numbers, order, lines[:line]


@njit_cached
def _group(
    parts: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Group rows by part, in the order of their first rows.

    Returns:
        (E,) the group of each row, (G,) the first row and (G,) the size of each group.
    """
    # A power of two, so that a mask replaces the division; at most half full, so that
    # probes stay short.
    size = 16
    while size < 2 * len(parts):
        size *= 2
    table = np.zeros(size, np.int64)  # groups by the hash of their part, from 1
    group_of = np.zeros(len(parts), np.int64)
    firsts = np.zeros(len(parts), np.int64)
    sizes = np.zeros(len(parts), np.int64)
    groups = 0
    for row in range(len(parts)):
        at = (parts[row] * _GOLDEN >> 8) & (size - 1)
        while table[at] and parts[firsts[table[at] - 1]] != parts[row]:
            at = (at + 1) & (size - 1)
        if not table[at]:
            firsts[groups] = row
            groups += 1
            table[at] = groups
        group = table[at] - 1
        group_of[row] = group
        sizes[group] += 1
    return group_of, firsts[:groups], sizes[:groups]


@njit_cached
def _rank(
    parts: NDArray[np.int64], beams: NDArray[np.int64], firsts: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return groups by their first beam, and for the same beam by their part."""
    ranks = np.zeros(len(firsts), np.int64)
    for group in range(len(ranks)):  # by beam they are sorted already
        part, beam, at = parts[firsts[group]], beams[firsts[group]], group
        while at and beams[firsts[ranks[at - 1]]] == beam:
            if parts[firsts[ranks[at - 1]]] < part:
                break
            ranks[at] = ranks[at - 1]
            at -= 1
        ranks[at] = group
    return ranks


@njit_inline
def _follows(numbers: Floats, beam: float, range_: float) -> bool:
    """Return whether an echo is of a beam, and farther than a range."""
    return bool(numbers[0] == beam and numbers[1] > range_)


@njit_inline
def _power_share(power: float, full: float) -> float:
    """Return the share of a beam's power that is left on arrival."""
    if math.isinf(full):
        return 1.0
    return _clip_to_unit(power / full) if full > 0.0 else 0.0


@njit_inline
def _clip_to_unit(share: float) -> float:
    """Clip rounding errors off a share, and the sign off zero."""
    return 0.0 if share <= 0.0 else min(share, 1.0)


def warm_up() -> None:
    """Compile the kernel, or read it from the cache."""
    numbers, empty = np.zeros(0), np.zeros(0, np.int64)
    sort_into_lines(empty, empty, numbers, numbers, numbers, 1.0, 1)


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
