"""Split the echoes of a scan into echo lines, object by object."""

import math
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from radarsim.geometry import Floats
from radarsim.protocol.echoes import ECHOES_A_LINE
from radarsim.protocol.reports import EchoLine, TargetEchoes
from radarsim.sensors.echoes import KINDS, ROBOT, Echoes, Target

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
    lines: list[tuple[int, int, int]]

    @classmethod
    def of(cls, echoes: Echoes) -> "EchoRows":
        """Sort echoes into lines of one part each, as many as fit into a line.

        Parts are in the order of their first beam, and of their numbers for the same.
        """
        # Some hundred echoes are sorted as soon as numpy has begun to.
        rows: dict[int, list[int]] = {}
        for row, part in enumerate(echoes.parts.tolist()):
            rows.setdefault(part, []).append(row)
        beams, kinds = echoes.beams.tolist(), echoes.kinds.tolist()
        parts = sorted(rows, key=lambda part: (beams[rows[part][0]], part))
        places = list(zip(beams, echoes.fronts.tolist(), strict=True))
        order = [
            row for part in parts for row in sorted(rows[part], key=places.__getitem__)
        ]
        columns = (echoes.beams, echoes.fronts, _power_shares(echoes), echoes.strength)
        numbers: Floats = np.column_stack(columns)[order].astype(np.float64, copy=False)
        # Rounding errors are clipped off shares, and the sign off zeros.
        shares = numbers[:, 2:]
        np.add(np.clip(shares, 0.0, 1.0), 0.0, out=shares)
        lines = _split(parts, [len(rows[part]) for part in parts])
        return cls(numbers, [kinds[row] for row in order], lines)


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


def _split(parts: list[int], counts: list[int]) -> list[tuple[int, int, int]]:
    """Return the part and the rows of each line."""
    lines, start = [], 0
    for part, count in zip(parts, counts, strict=True):
        end = start + count
        lines += [
            (part, begin, min(end, begin + ECHOES_A_LINE))
            for begin in range(start, end, ECHOES_A_LINE)
        ]
        start = end
    return lines


def _power_shares(echoes: Echoes) -> Floats:
    """Return the share of a beam's power that is left on arrival, (E,)."""
    full = echoes.settings.penetration_power
    if math.isinf(full):
        return np.ones(len(echoes))
    return echoes.power / full if full else np.zeros(len(echoes))
