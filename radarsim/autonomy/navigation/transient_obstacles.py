"""Transient obstacles: near ones that the next scan misses, such as the end of a plate.

Theory of operation
===================
The end of a plate is thin, and beams pass beside it: one scan shows it, and the next
one does not. Where the plate is a mirror, what beams show instead is far away. A robot
that steers by each scan alone would turn away from the end in one and on towards it in
the next, until it touches it.

So what a scan has shown near the robot, and the next one looks through, is kept for a
few seconds: beams end there as if they had met it. What has moved is not kept: it is
seen beside its place, or a little farther away.
"""

import math
from collections import deque
from typing import Final

import numpy as np

from radarsim.autonomy.navigation.observation import Observation, wrap_angles
from radarsim.autonomy.navigation.touch_memory import Points, TouchedPlaces

KEPT_FOR: Final = 3.0  # s
REACH: Final = 0.65  # m; beyond, a pole may be between two beams for long
BEHIND: Final = 0.25  # m that beams go on behind what has vanished
# m beside it where beams count as beams to it: side beams see it up to 0.2 m beside
_BESIDE: Final = 0.3
_LEAST_SPREAD: Final = math.radians(2.5)  # between such beams
_SAME: Final = 0.1  # m within which it is the same
_HALF: Final = 0.05  # m; half the side of the box that is kept


class TransientObstacles:
    """Keeps what has vanished from one scan to the next."""

    def __init__(self) -> None:
        self._last: Observation | None = None
        self._kept: deque[tuple[float, Points]] = deque()  # since when, and the box

    def add_to(self, observation: Observation) -> Observation:
        """Return a scan whose beams end at what has vanished; to be called at each.

        Args:
            observation: The newest scan, as it came.
        """
        last, self._last = self._last, observation
        while self._kept and observation.time - self._kept[0][0] >= KEPT_FOR:
            self._kept.popleft()
        if last is not None:
            for box in _vanished(last, observation):
                self._kept.append((observation.time, box))
        places = TouchedPlaces(0.0)
        for _, box in self._kept:
            places.add(box)
        return places.hide(observation)


def _vanished(last: Observation, now: Observation) -> list[Points]:
    """Return boxes, (4,) corners each, map frame, of what a scan no longer shows."""
    near = last.offsets(last.ranges < REACH)
    points = complex(last.pose.x, last.pose.y) + near
    there = points - complex(now.pose.x, now.pose.y)
    bearings = np.angle(there) - now.pose.yaw
    offsets = np.abs(wrap_angles(bearings[:, None] - now.bearings))
    spread = np.maximum(np.arctan2(_BESIDE, np.abs(there)), _LEAST_SPREAD)
    is_beam = offsets <= spread[:, None]
    goes_on = now.ranges > (np.abs(there) + BEHIND)[:, None]
    # where no beam looks, nothing has vanished
    has_vanished = (goes_on | ~is_beam).all(axis=1) & is_beam.any(axis=1)
    boxes: list[Points] = []
    centres: list[complex] = []
    square = np.array([-1 - 1j, 1 - 1j, 1 + 1j, -1 + 1j]) * _HALF
    for k in np.flatnonzero(has_vanished):
        point = complex(points[k])
        if all(abs(point - centre) > _SAME for centre in centres):
            centres.append(point)
            # its front is where the beam ended
            turn = np.exp(1j * np.angle(there[k]))
            boxes.append(point + turn * (square + _HALF))
    return boxes
