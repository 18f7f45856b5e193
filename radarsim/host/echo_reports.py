"""Split the echoes of a scan into echo lines, object by object."""

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.protocol.echoes import ECHOES_A_LINE
from radarsim.protocol.reports import EchoLine, TargetEchoes
from radarsim.sensors.echoes import KINDS, Echoes

_KIND_NAMES = {int(kind): name for kind, name in KINDS.items()}


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
    groups = list(_target_echoes(echoes, robot_names))
    if not groups:
        return (EchoLine(time, scanner, 0, 0, None),)
    return tuple(
        EchoLine(time, scanner, number, len(groups), group)
        for number, group in enumerate(groups, start=1)
    )


def _target_echoes(
    echoes: Echoes, robot_names: Mapping[int, str]
) -> Iterator[TargetEchoes]:
    targets = echoes.targets
    power = _clip_to_unit(_power_shares(echoes))
    strength = _clip_to_unit(echoes.strength)
    for rows in _rows_of_lines(echoes):
        part = int(echoes.parts[rows[0]])
        target, robot = targets[part], part - len(echoes.scene_parts)
        yield TargetEchoes(
            object=target.object if robot < 0 else robot_names[robot],
            material=target.material,
            density=target.density,
            transparency=target.transparency,
            laser_passes=target.laser_passes,
            robot_passes=target.robot_passes,
            beams=echoes.beams[rows],
            ranges=echoes.ranges[rows],
            kinds=tuple([_KIND_NAMES[kind] for kind in echoes.kinds[rows].tolist()]),
            power=power[rows],
            strength=strength[rows],
        )


def _rows_of_lines(echoes: Echoes) -> Iterator[NDArray[np.int64]]:
    """Yield the rows of each line: rows of one part, as many as fit into a line."""
    _, first, part = np.unique(echoes.parts, return_index=True, return_inverse=True)
    # Rows are sorted by beam and unique parts by number; a stable sort keeps both.
    parts_by_beam = np.argsort(echoes.beams[first], kind="stable")
    rank = np.argsort(parts_by_beam)[part]  # (E,) rank of the part of each row
    rows = np.argsort(rank, kind="stable")
    start = 0
    for end in np.cumsum(np.bincount(rank, minlength=1)).tolist():
        for begin in range(start, end, ECHOES_A_LINE):
            yield rows[begin : min(end, begin + ECHOES_A_LINE)]
        start = end


def _power_shares(echoes: Echoes) -> Floats:
    """Return the share of a beam's power that is left on arrival, (E,)."""
    full = echoes.settings.penetration_power
    if math.isinf(full):
        return np.ones(len(echoes))
    return echoes.power / full if full else np.zeros(len(echoes))


def _clip_to_unit(shares: Floats) -> Floats:
    """Clip rounding errors off shares, and the sign off zeros."""
    clipped: Floats = np.clip(shares, 0.0, 1.0) + 0.0
    return clipped
