"""From where and when the antenna of a radar looks into its directions."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from radarsim.geometry import Floats, Pose3, wrap_angle

Velocity = tuple[float, float, float]  # m/s, map frame

STANDING: Velocity = (0.0, 0.0, 0.0)


class Viewpoints(NamedTuple):
    """From where and when the antenna looks into directions; N of them.

    Attributes:
        positions: (N, 3) m, map frame.
        rotations: (N, 3, 3) that turn vectors of the antenna to the map frame.
        velocities: (N, 3) m/s, map frame.
        times: (N,) s.
    """

    positions: Floats
    rotations: Floats
    velocities: Floats
    times: Floats

    def of(self, which: NDArray[np.int64] | slice) -> "Viewpoints":
        """Return those of some of the directions, by number."""
        return Viewpoints._make(column[which] for column in self)


def fixed_viewpoints(
    pose: Pose3, times: Floats, velocity: Velocity = STANDING
) -> Viewpoints:
    """Return the viewpoints of an antenna at one pose."""
    count = len(times)
    return Viewpoints(
        np.tile(pose.position(), (count, 1)),
        np.tile(pose.rotation(), (count, 1, 1)),
        np.tile(velocity, (count, 1)),
        times,
    )


def join_viewpoints(parts: Iterable[Viewpoints]) -> Viewpoints:
    """Return the viewpoints of directions that follow each other."""
    return Viewpoints._make(map(np.concatenate, zip(*parts, strict=True)))


def moving_viewpoints(
    start: Pose3, end: Pose3, times: Floats, velocity: Velocity
) -> Viewpoints:
    """Return the viewpoints of an antenna that moves evenly.

    Args:
        start: Its pose as it looks into the first direction.
        end: Its pose as it would look into the one after the last.
        times: (N,) s, of the directions.
        velocity: Of the antenna, m/s, map frame.
    """
    if start == end:
        return fixed_viewpoints(end, times, velocity)
    angles = [
        wrap_angle(last - first)
        for first, last in zip(start.numbers()[3:], end.numbers()[3:], strict=True)
    ]
    first = np.array(start.numbers())
    change = np.concatenate([end.position() - start.position(), angles])
    shares = np.arange(len(times)) / len(times)
    poses = [Pose3(*row) for row in (first + shares[:, None] * change).tolist()]
    return Viewpoints(
        np.array([pose.position() for pose in poses]),
        np.array([pose.rotation() for pose in poses]),
        np.tile(velocity, (len(times), 1)),
        times,
    )
