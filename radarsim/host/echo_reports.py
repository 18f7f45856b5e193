"""Split the echoes of a scan into echo lines, object by object."""

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from radarsim.geometry import Floats
from radarsim.host.echo_order import sort_into_lines
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
