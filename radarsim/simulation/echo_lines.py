"""From the echoes of a scan to the lines that tell them, object by object."""

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats
from radarsim.protocol.echoes import ECHOES_A_LINE
from radarsim.protocol.reports import EchoLine, TargetEchoes
from radarsim.sensors.echoes import KINDS, Echoes

_WORDS = {int(kind): word for kind, word in KINDS.items()}


def echo_lines(
    time: float, item: str, echoes: Echoes, robots: Mapping[int, str]
) -> tuple[EchoLine, ...]:
    """Tell the echoes of a scan: objects by their first beam, then by their part.

    Args:
        time: Of the scan, s.
        item: Name of the scanner.
        echoes: Of the scan.
        robots: Names of the robots, by their numbers.

    Returns:
        At least one line, so that a client knows when it has all of a scan.
    """
    seen = list(_seen(echoes, robots))
    if not seen:
        return (EchoLine(time, item, 0, 0, None),)
    return tuple(
        EchoLine(time, item, number, len(seen), what)
        for number, what in enumerate(seen, start=1)
    )


def _seen(echoes: Echoes, robots: Mapping[int, str]) -> Iterator[TargetEchoes]:
    targets = echoes.targets
    power = _within_one(_left(echoes))
    strength = _within_one(echoes.strength)
    for rows in _rows_of_lines(echoes):
        part = int(echoes.parts[rows[0]])
        target, robot = targets[part], part - len(echoes.scene_parts)
        yield TargetEchoes(
            object=target.object if robot < 0 else robots[robot],
            material=target.material,
            density=target.density,
            transparency=target.transparency,
            laser_passes=target.laser_passes,
            robot_passes=target.robot_passes,
            beams=echoes.beams[rows],
            ranges=echoes.ranges[rows],
            kinds=tuple([_WORDS[kind] for kind in echoes.kinds[rows].tolist()]),
            power=power[rows],
            strength=strength[rows],
        )


def _rows_of_lines(echoes: Echoes) -> Iterator[NDArray[np.int64]]:
    """Give the rows that go into each line: those of one part, as many as fit."""
    _, first, which = np.unique(echoes.parts, return_index=True, return_inverse=True)
    # Rows come beam by beam and unique parts sorted; a stable sort keeps both orders.
    turns = np.argsort(echoes.beams[first], kind="stable")
    turn = np.argsort(turns)[which]
    rows = np.argsort(turn, kind="stable")
    ends = np.cumsum(np.bincount(turn, minlength=1))
    start = 0
    for end in ends.tolist():
        for begin in range(start, end, ECHOES_A_LINE):
            yield rows[begin : min(end, begin + ECHOES_A_LINE)]
        start = end


def _left(echoes: Echoes) -> Floats:
    """Give the share of a beam's power that each echo is met with."""
    full = echoes.settings.penetration_power
    if math.isinf(full):
        return np.ones(len(echoes))
    return echoes.power / full if full else np.zeros(len(echoes))


def _within_one(shares: Floats) -> Floats:
    """Take off what rounding adds to shares, and the sign of zero."""
    kept: Floats = np.clip(shares, 0.0, 1.0) + 0.0
    return kept
